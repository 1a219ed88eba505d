"""Play that the gear crosses where the torque changes its sign: teeth leave one flank and touch the other.

theta_i = D_i tanh(tau_i / tau_0), with theta_i in rad, tau_i the torque of load and declared masses (N m), D_i half the play
(rad) and tau_0 the torque at which it is taken up (N m). Linear in D_i, not in tau_0: makers of gears measure lost motion at
3 % of the rated torque [1]. Derived here: tanh is a smooth step from one flank, -D_i, to the other, +D_i.

[1] Nabtesco, Precision Reduction Gear RV, catalogue, glossary: lost motion, the torsion angle at 3 % of the rated torque.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.full_load import full_torque_Nm
from elastocal.effects.protocol import LOADED_JOINTS, Candidate, Shape, per_joint
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "lost_motion", "gearbox"
MOVES_ROBOT = True
WORDS = "lost motion (backlash)"
# Of the full torque.
_START, _LOWEST, _HIGHEST = 0.03, 0.003, 0.1


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a joint."""

    def at(joint: int) -> Candidate:
        parameters = sized(NAME, "play", ["half_play"], "rad", sites)
        full = full_torque_Nm(sites, joint)
        taken_up = Shape("torque", "N m", _START * full, _LOWEST * full, _HIGHEST * full)

        def displacement(conditions: Conditions, torque: float) -> Displacements:
            return [{joint: np.tanh(conditions.total[:, joint] / torque)}]

        return Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement, LOADED_JOINTS, (taken_up,))

    return per_joint(sites, at)
