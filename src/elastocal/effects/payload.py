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

from elastocal.effects.protocol import Candidate, Parameter

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "payload", "gravity"
# It hangs on the flange in tasks as in the campaign, until someone takes it off.
MOVES_ROBOT = True
WORDS = "weight of an undeclared payload"
# A cable package or a forgotten gripper: some share of what the robot may carry, with its centre so far from the flange. Where
# the rated load is not known, an arm carries about a sixth of its own mass; and where that is not known either, this.
_SHARE_OF_RATED, _RATED_OVER_MASS, _LEVER_M, _USUAL_KG = 0.15, 1 / 6, 0.2, 10.0


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

    plausible = _plausible_kg(sites)
    parameters = (
        Parameter("mass", "kg", plausible),
        *(Parameter(f"moment_{axis}", "kg m", _LEVER_M * plausible) for axis in "xyz"),
    )
    return [
        Candidate(NAME, FAMILY, (), "", parameters, displacement),
        Candidate(NAME, FAMILY, (), "mass", parameters[:1], mass),
    ]


def _plausible_kg(sites: Sites) -> float:
    if sites.payload_kg is not None:
        return _SHARE_OF_RATED * sites.payload_kg
    total = sum(mass.mass_kg for mass in sites.masses)
    return _SHARE_OF_RATED * _RATED_OVER_MASS * total if total else _USUAL_KG
