"""Weight at the flange that the model does not know: a tool, a cable package or an adapter that nobody declared.

theta = diag(c) J^T (m g, m r x g), with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian
of the end-effector, g gravity (m/s^2), m the mass (kg) and r its centre from there (m). Given the compliances it is linear in
m and in the first moments m r along the axes of the end-effector (kg m) [1].

[1] C. G. Atkeson, C. H. An and J. M. Hollerbach, Estimation of inertial parameters of manipulator loads and links,
    International Journal of Robotics Research 5, 1986.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import LOADED_JOINTS, Candidate, Parameter
from elastocal.effects.sizes import size_of

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "payload", "gravity"
# It hangs on the flange in tasks as in the campaign, until someone takes it off.
MOVES_ROBOT = True
WORDS = "weight of an undeclared payload"
# From the flange to the centre of a gripper.
_LEVER_M = 0.2


def displacement(conditions: Conditions) -> Displacements:
    """Joint deflections per kilogram at the end-effector, and per kilogram metre along its axes."""
    gravity = np.array(conditions.sites.gravity_m_s2)
    levers = [np.zeros_like(conditions.wrench[:, :3]), *np.moveaxis(conditions.end_rotation, -1, 0)]
    columns = []
    for lever, mass in zip(levers, (1.0, 0.0, 0.0, 0.0), strict=True):
        force = np.broadcast_to(mass * gravity, lever.shape)
        turned = conditions.joint_deflections(np.concatenate([force, np.cross(lever, gravity)], axis=-1))
        columns.append(dict(enumerate(turned.T)))
    return columns


def candidates(sites: Sites) -> list[Candidate]:
    """Two candidates at the flange: a tool, and a mass alone, which is most of what a tool does."""

    def mass(conditions: Conditions) -> Displacements:
        return displacement(conditions)[:1]

    plausible = size_of(NAME, "mass", sites)
    parameters = (
        Parameter("mass", "kg", plausible),
        *(Parameter(f"moment_{axis}", "kg m", _LEVER_M * plausible) for axis in "xyz"),
    )
    # Where neither a load nor what the links weigh is known, what hangs on the flange is not distinguishable from that.
    known = LOADED_JOINTS - {"load"}
    return [
        Candidate(NAME, FAMILY, (), "", parameters, displacement, known),
        Candidate(NAME, FAMILY, (), "mass", parameters[:1], mass, known),
    ]
