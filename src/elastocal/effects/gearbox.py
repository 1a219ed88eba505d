"""Gearboxes: effects by the load or the approach, but not in proportion."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import (
    LOADED_JOINTS,
    Shape,
    effect,
    every_joint,
    turning_joints,
)
from elastocal.effects.sizes import JOINT, Size, full_torque_Nm

if TYPE_CHECKING:
    from collections.abc import Callable

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Effect
    from elastocal.mechanics.sites import Sites

_gearbox = partial(effect, "gearbox")
# Start, least and most of the torque of a law, of the full torque. Slopes that meet at
# less are those of play; where both laws reach, either may be meant.
_PLAY = np.array([0.03, 0.003, 0.1])
_MEETING = np.array([0.3, 0.05, 0.8])
_AS_AT_REST: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "": lambda load, torque: torque * np.tanh(load / torque),
    "two slopes": lambda load, torque: np.clip(load, -torque, torque),
}


# Small gears carry less torque and may bend more by it.
@_gearbox(
    "gear stiffening",
    Size(
        "lost beyond",
        0.5,
        "of gears' compliance half goes once all teeth bear",
        JOINT,
        sign=-1,
    ),
    at=lambda sites: [
        (joint, law) for law in _AS_AT_REST for (joint,) in turning_joints(sites)
    ],
    formula=(
        r"\theta_i = d_i \left( \tau_i - s(\tau_i) \right), \quad s(\tau) = "
        r"\mathrm{clip}(\tau, -\tau_1, \tau_1) \quad \text{or} \quad \tau_1 \tanh "
        r"\frac{\tau}{\tau_1}"
    ),
)
def stiffening(entry: Effect, sites: Sites, joint: int, detail: str) -> Candidates:
    """A gear that gets stiffer with torque: more of its teeth, pins or rollers share a
    larger load.

    theta_i = d_i (tau_i - s(tau_i)), with s(tau) = clip(tau, -tau_1, tau_1) or tau_1
    tanh(tau / tau_1),

    theta_i in rad, tau_i the torque of load and declared masses (N m), d_i < 0 in
    rad/(N m), and s the part that bends the gear as at rest: either two slopes that
    meet at the torque tau_1 (N m); or a slope that falls smoothly, as several kinks do
    together, and which below tau_1 is the cubic law tau^3 / (3 tau_1^2). Neither is
    linear in tau_1. A stiffness that depends on the torque was measured on strain wave
    gears (Tuttle 1992).
    """
    beyond = entry.parameters("lost beyond", ["beyond"], "rad/(N m)", sites, joint)
    meeting = Shape(
        "torque", "N m", *(_MEETING * full_torque_Nm(sites, joint)).tolist()
    )

    def turns(around: Conditions, torque: float) -> list[np.ndarray]:
        load = around.total[:, joint]
        return [load - _AS_AT_REST[detail](load, torque)]

    yield entry.of_joint(
        joint, beyond, turns, LOADED_JOINTS, shapes=(meeting,), detail=detail
    )


@_gearbox(
    "lost motion (backlash)",
    Size("play", 1e-4, "a third of an arc minute", sign=1),
    at=turning_joints,
    formula=r"\theta_i = D_i \tanh \frac{\tau_i}{\tau_0}",
)
def lost_motion(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Play that the gear crosses where the torque changes its sign: teeth leave one
    flank and touch the other.

    theta_i = D_i tanh(tau_i / tau_0), with theta_i in rad, tau_i the torque of load and
    declared masses (N m), D_i half the play (rad) and tau_0 the torque at which it is
    taken up (N m). Makers of gears measure it at 3 % of the rated torque (Nabtesco,
    Precision Reduction Gear RV, glossary). Derived here: tanh is a smooth step from one
    flank, -D_i, to the other, +D_i.
    """
    play = entry.parameters("play", ["half_play"], "rad", sites)
    taken_up = Shape("torque", "N m", *(_PLAY * full_torque_Nm(sites, joint)).tolist())
    yield entry.of_joint(
        joint,
        play,
        lambda around, at: [np.tanh(around.total[:, joint] / at)],
        LOADED_JOINTS,
        shapes=(taken_up,),
    )


@_gearbox(
    "hysteresis",
    Size("turn", 1e-4, "a third of an arc minute"),
    Size("shift", 2e-5, "the nut of a spindle"),
    at=every_joint,
    formula=r"\theta_i = h_i s_i, \quad s_i \in \{-1, 0, +1\}",
)
def hysteresis(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Friction and backlash that hold a joint back on the side from which it came: the
    gear stays wound up after a stop.

    theta_i = h_i s_i, with s_i = -1 or +1 the sense in which the joint was approached,
    0 where it is not known, and h_i half the width of the loop (rad; m for a prismatic
    joint), negative where the joint stays short: friction F sgn(dq/dt)
    (Armstrong-Hélouvry 1991) that is left at rest winds up a gear of compliance c by c
    F. Where the approach is not recorded this is part of the repeatability.
    """
    quantity, unit = ("shift", "m") if sites.prismatic[joint] else ("turn", "rad")
    width = entry.parameters(quantity, ["half_width"], unit, sites)
    yield entry.of_joint(
        joint, width, lambda around: [around.approach[:, joint]], {"approach"}
    )
