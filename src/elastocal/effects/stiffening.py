"""A gear that gets stiffer with torque: J_i d_i (tau_i - s(tau_i)), where s is the part that bends the gear as at rest.

Catalogue row 12. Either two slopes that meet at the torque tau_1, s = clip(tau, -tau_1, tau_1); or a slope that falls
smoothly, s = tau_1 tanh(tau / tau_1), as several kinks do together, and which below tau_1 is the cubic law tau^3 / (3 tau_1^2).
Neither is linear in tau_1.
"""

import numpy as np

from elastocal.effects.full_load import full_torque_Nm, lever_m
from elastocal.effects.protocol import Candidate, Parameter, Shape, per_joint

NAME, FAMILY = "stiffening", "gearbox"
WORDS = "gear stiffening"
# The end of the robot moves by so much under the full torque.
_MOVED_M = 5e-3
# Of the full torque. Slopes that meet at less are those of play; where both laws reach, either may be meant.
_START, _LOWEST, _HIGHEST = 0.3, 0.05, 0.8
_LAWS = {
    "": lambda load, torque: torque * np.tanh(load / torque),
    "two slopes": lambda load, torque: np.clip(load, -torque, torque),
}


def candidates(sites):
    """Two candidates a joint: smooth, and with two slopes. Small gears carry less torque and may bend more by it."""
    return [
        each for detail in _LAWS for each in per_joint(sites, lambda joint, detail=detail: _candidate(sites, joint, detail))
    ]


def _candidate(sites, joint, detail):
    full, as_at_rest = full_torque_Nm(sites, joint), _LAWS[detail]
    beyond = Parameter("beyond", "rad/(N m)", _MOVED_M / lever_m(sites, joint) / full, sign=-1)
    meeting = Shape("torque", "N m", _START * full, _LOWEST * full, _HIGHEST * full)

    def displacement(conditions, torque):
        load = conditions.total[:, joint]
        return [{joint: load - as_at_rest(load, torque)}]

    return Candidate(NAME, FAMILY, (joint + 1,), detail, (beyond,), displacement, frozenset({"load"}), (meeting,))
