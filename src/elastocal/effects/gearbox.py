"""Effects of gearboxes that are not proportional to the load."""

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
# Start and range of the torque of a law as shares of the full torque: the torque at which
# play is taken up, and the torque at which two slopes meet. Slopes that meet below the
# second range are play. In the overlap of the ranges either law can describe the data.
_PLAY = np.array([0.03, 0.003, 0.1])
_MEETING = np.array([0.3, 0.05, 0.8])
# Torque that bends the gear with its compliance at rest.
_TORQUE_AT_REST: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "": lambda load, torque: torque * np.tanh(load / torque),
    "two slopes": lambda load, torque: np.clip(load, -torque, torque),
}


# A small gear carries less torque, and may bend more under it.
@_gearbox(
    "gear stiffening",
    Size(
        "lost beyond",
        0.5,
        "a gear loses half of its compliance once all teeth carry load",
        JOINT,
        sign=-1,
    ),
    at=lambda sites: [
        (joint, law) for law in _TORQUE_AT_REST for (joint,) in turning_joints(sites)
    ],
    formula=(
        r"\theta_i = d_i \left( \tau_i - s(\tau_i) \right), \quad s(\tau) = "
        r"\mathrm{clip}(\tau, -\tau_1, \tau_1) \quad \text{or} \quad \tau_1 \tanh "
        r"\frac{\tau}{\tau_1}"
    ),
)
def stiffening(entry: Effect, sites: Sites, joint: int, detail: str) -> Candidates:
    """A gear that gets stiffer with torque, because more of its teeth, pins or rollers
    share a larger load.

    theta_i = d_i (tau_i - s(tau_i)), with s(tau) = clip(tau, -tau_1, tau_1) or tau_1
    tanh(tau / tau_1),

    theta_i in rad, tau_i the torque of load and declared masses (N m), d_i < 0 in
    rad/(N m), and s the torque that bends the gear with its compliance at rest. The law
    has either two slopes that meet at the torque tau_1 (N m), or a slope that falls
    smoothly, as with several kinks, and is the cubic law tau^3 / (3 tau_1^2) below tau_1.
    Neither is linear in tau_1. A stiffness that depends on the torque was measured on
    strain wave gears (Tuttle 1992).
    """
    beyond = entry.parameters("lost beyond", ["beyond"], "rad/(N m)", sites, joint)
    meeting = Shape(
        "torque", "N m", *(_MEETING * full_torque_Nm(sites, joint)).tolist()
    )

    def turns(conditions: Conditions, torque: float) -> list[np.ndarray]:
        load = conditions.total[:, joint]
        return [load - _TORQUE_AT_REST[detail](load, torque)]

    yield entry.of_joint(
        joint,
        beyond,
        turns,
        LOADED_JOINTS,
        shapes=(meeting,),
        detail=detail,
        nonlinear_in_load=True,
    )


@_gearbox(
    "lost motion (backlash)",
    Size("play", 1e-4, "a third of an arc minute", sign=1),
    at=turning_joints,
    formula=r"\theta_i = D_i \tanh \frac{\tau_i}{\tau_0}",
)
def lost_motion(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Play that the gear crosses when the torque changes its sign: teeth leave one flank
    and touch the other.

    theta_i = D_i tanh(tau_i / tau_0), with theta_i in rad, tau_i the torque of load and
    declared masses (N m), D_i half the play (rad) and tau_0 the torque at which it is
    taken up (N m). Makers of gears measure it at 3 % of the rated torque (Nabtesco,
    Precision Reduction Gear RV, glossary). Derived here: tanh is a smooth step from one
    flank, -D_i, to the other, +D_i.
    """
    play = entry.parameters("play", ["half_play"], "rad", sites)
    torque = Shape("torque", "N m", *(_PLAY * full_torque_Nm(sites, joint)).tolist())
    yield entry.of_joint(
        joint,
        play,
        lambda conditions, torque: [np.tanh(conditions.total[:, joint] / torque)],
        LOADED_JOINTS,
        shapes=(torque,),
        nonlinear_in_load=True,
    )


@_gearbox(
    "hysteresis",
    Size("turn", 1e-4, "a third of an arc minute"),
    Size("shift", 2e-5, "the nut of a spindle"),
    at=every_joint,
    formula=r"\theta_i = h_i s_i, \quad s_i \in \{-1, 0, +1\}",
)
def hysteresis(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Friction and backlash that hold a joint back on the side from which it was
    approached: the gear stays wound up after a stop.

    theta_i = h_i s_i, with s_i = -1 or +1 the sense in which the joint was approached,
    0 if it is unknown, and h_i half the width of the loop (rad; m for a prismatic joint),
    negative if the joint stops short: friction F sgn(dq/dt) (Armstrong-Hélouvry 1991)
    that remains at rest winds up a gear of compliance c by c F. If the approach is not
    recorded, this effect is part of the repeatability.
    """
    quantity, unit = ("shift", "m") if sites.prismatic[joint] else ("turn", "rad")
    width = entry.parameters(quantity, ["half_width"], unit, sites)
    yield entry.of_joint(
        joint, width, lambda conditions: [conditions.approach[:, joint]], {"approach"}
    )
