"""A gear that gets stiffer with torque: more of its teeth, pins or rollers share a larger load.

theta_i = d_i (tau_i - s(tau_i)), with s(tau) = clip(tau, -tau_1, tau_1) or tau_1 tanh(tau / tau_1),

theta_i in rad, tau_i the torque of load and declared masses (N m), d_i < 0 in rad/(N m), and s the part that bends the gear as
at rest: either two slopes that meet at the torque tau_1 (N m); or a slope that falls smoothly, as several kinks do together,
and which below tau_1 is the cubic law tau^3 / (3 tau_1^2). Neither is linear in tau_1. A stiffness that depends on the torque
was measured on strain wave gears [1].

[1] T. D. Tuttle, Understanding and Modeling the Behavior of a Harmonic Drive Gear Transmission, technical report, MIT
    Artificial Intelligence Laboratory, 1992.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.full_load import full_torque_Nm
from elastocal.effects.protocol import LOADED_JOINTS, Candidate, Shape, per_joint
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from collections.abc import Callable

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "stiffening", "gearbox"
MOVES_ROBOT = True
WORDS = "gear stiffening"
# Of the full torque. Slopes that meet at less are those of play; where both laws reach, either may be meant.
_START, _LOWEST, _HIGHEST = 0.3, 0.05, 0.8
_LAWS: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "": lambda load, torque: torque * np.tanh(load / torque),
    "two slopes": lambda load, torque: np.clip(load, -torque, torque),
}


def candidates(sites: Sites) -> list[Candidate]:
    """Two candidates a joint: smooth, and with two slopes. Small gears carry less torque and may bend more by it."""

    def by_law(detail: str) -> list[Candidate]:
        return per_joint(sites, lambda joint: _candidate(sites, joint, detail))

    return [each for detail in _LAWS for each in by_law(detail)]


def _candidate(sites: Sites, joint: int, detail: str) -> Candidate:
    full, as_at_rest = full_torque_Nm(sites, joint), _LAWS[detail]
    beyond = sized(NAME, "lost beyond", ["beyond"], "rad/(N m)", sites, joint)
    meeting = Shape("torque", "N m", _START * full, _LOWEST * full, _HIGHEST * full)

    def displacement(conditions: Conditions, torque: float) -> Displacements:
        load = conditions.total[:, joint]
        return [{joint: load - as_at_rest(load, torque)}]

    return Candidate(NAME, FAMILY, (joint + 1,), detail, beyond, displacement, LOADED_JOINTS, (meeting,))
