"""Weight at the flange that the model does not know: mass and first moments of a tool.

Catalogue row 9: theta = c J^T w of the tool's weight. Linear in mass and mass times centre, given the joint compliances.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "payload", "gravity"
WORDS = "weight of an undeclared payload"
_PARAMETERS = (Parameter("mass", "kg", 10.0), *(Parameter(f"moment_{axis}", "kg m", 2.0) for axis in "xyz"))


def displacement(circumstances):
    """Joint deflections per kilogram at the end-effector, and per kilogram metre along its axes."""
    gravity = np.array(circumstances.sites.gravity_m_s2)
    levers = [np.zeros_like(circumstances.wrench[:, :3]), *np.moveaxis(circumstances.end_rotation, -1, 0)]
    columns = []
    for lever, mass in zip(levers, (1.0, 0.0, 0.0, 0.0), strict=True):
        force = np.broadcast_to(mass * gravity, lever.shape)
        turned = circumstances.joint_deflections(np.concatenate([force, np.cross(lever, gravity)], axis=-1))
        columns.append(dict(enumerate(turned.T)))
    return columns


def candidates(sites):
    """Two candidates at the flange: a tool, and a mass alone, which is most of what a tool does."""

    def mass(circumstances):
        return displacement(circumstances)[:1]

    return [
        Candidate(NAME, FAMILY, (), "", _PARAMETERS, displacement),
        Candidate(NAME, FAMILY, (), "mass", _PARAMETERS[:1], mass),
    ]
