"""A gear that gets stiffer with torque: J_i k3_i tau_i^3, or J_i d_i sign(tau_i) max(|tau_i| - tau_1, 0).

Catalogue row 12, which names both laws. The second has two slopes, not linear in the torque tau_1 where they meet.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter, Shape, full_torque_Nm, lever_m, per_joint

NAME, FAMILY = "stiffening", "gearbox"
WORDS = "gear stiffening"
# The end of the robot moves by so much under the full torque.
_MOVED_M = 5e-3
# Slopes that meet at less of the full torque are those of play, see `lost_motion`.
_START, _LOWEST, _HIGHEST = 0.3, 0.1, 0.8


def candidates(sites):
    """Two candidates a joint: smooth, and with two slopes. Small gears carry less torque and may bend more by it."""
    return [*per_joint(sites, lambda joint: _cubic(sites, joint)), *per_joint(sites, lambda joint: _two_slopes(sites, joint))]


def _cubic(sites, joint):
    full = full_torque_Nm(sites, joint)
    cubic = Parameter("cubic", "rad/(N m)^3", _MOVED_M / lever_m(sites, joint) / full**3, sign=-1)

    def displacement(circumstances):
        return [{joint: circumstances.total[:, joint] ** 3}]

    return Candidate(NAME, FAMILY, (joint + 1,), "", (cubic,), displacement, frozenset({"load"}))


def _two_slopes(sites, joint):
    full = full_torque_Nm(sites, joint)
    beyond = Parameter("beyond", "rad/(N m)", _MOVED_M / lever_m(sites, joint) / full, sign=-1)
    meeting = Shape("torque", "N m", _START * full, _LOWEST * full, _HIGHEST * full)

    def displacement(circumstances, torque):
        load = circumstances.total[:, joint]
        return [{joint: load - np.clip(load, -torque, torque)}]

    return Candidate(NAME, FAMILY, (joint + 1,), "two slopes", (beyond,), displacement, frozenset({"load"}), (meeting,))
