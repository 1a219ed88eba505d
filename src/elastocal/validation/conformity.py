"""Conformity of a robot with a tolerance, by guarded acceptance after JCGM 106.

Also: whether the validation covers enough of the robot's workspace to decide.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.holdout import number_configurations
from elastocal.counting import format_count
from elastocal.fitting.observations import index_poses
from elastocal.verdict import JointRange

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Measurements
    from elastocal.fitting.observations import States
    from elastocal.mechanics.robot import Robot

# The largest error of this number of configurations bounds 69 % of all others at 95 %
# confidence; the largest error of fewer bounds little more than half.
MIN_CONFIGURATIONS = 8
# Over this rotation, an error that is a sine of a joint's angle changes by half of its
# amplitude. Over a smaller one it is hardly distinguishable from a constant.
MIN_ROTATION_RAD = 2.0 * np.arcsin(0.25)
# The same for a rail, as a share of its travel.
MIN_TRAVEL_SHARE = 0.1
PASS = "pass"
FAIL = "fail"
UNDECIDED = "undecided"


def count_configurations(states: States | Measurements) -> int:
    """Count the distinct configurations of states or measurements."""
    numbers = number_configurations(states.joint_angles, index_poses(states))
    return int(numbers.max()) + 1


def find_joint_ranges(states: States, robot: Robot) -> tuple[JointRange, ...]:
    """Find the smallest and largest angle of each joint, in degrees, or m for a rail."""
    low = states.joint_angles.min(axis=0)
    high = states.joint_angles.max(axis=0)
    ranges = []
    for joint, is_rail in enumerate(robot.chain.prismatic):
        limits = np.array([low[joint], high[joint]])
        if not is_rail:
            limits = np.rad2deg(limits)
        unit = "m" if is_rail else "deg"
        ranges.append(JointRange(float(limits[0]), float(limits[1]), unit))
    return tuple(ranges)


def list_shortfalls(configurations: int, fitted: States, robot: Robot) -> list[str]:
    """List why errors at some validation configurations say too little of a robot.

    There are too few configurations, or a joint hardly moved in the fitted states.
    """
    shortfalls = []
    if configurations < MIN_CONFIGURATIONS:
        count = format_count(configurations, "configuration")
        shortfalls.append(
            f"too few: {count}, where at least {MIN_CONFIGURATIONS} must judge"
        )
    travel = np.ptp(fitted.joint_angles, axis=0)
    is_rail = np.array(robot.chain.prismatic)
    needed = np.where(
        is_rail,
        MIN_TRAVEL_SHARE * np.ptp(robot.joint_limits, axis=1),
        MIN_ROTATION_RAD,
    )
    for joint in np.flatnonzero(travel < needed):
        moved, least = (
            f"{size:.3g} m" if is_rail[joint] else f"{np.rad2deg(size):.0f}°"
            for size in (travel[joint], needed[joint])
        )
        shortfalls.append(
            f"too close: joint {joint + 1} moved by {moved}, and {least} are needed"
        )
    return shortfalls


@dataclass(frozen=True)
class Conformity:
    """Decision on a tolerance of the root mean square position error of a robot.

    Attributes
    ----------
    decision : "pass", "fail" or "undecided"
    tolerance_m : float
    limit_m : float
        Compared with the tolerance to pass: the RMS exceeds it with the accepted risk.
    risk_above : float
        Risk that the RMS over all poses like the measured ones exceeds the tolerance.
    accepted_risk : float
    """

    decision: str
    tolerance_m: float
    limit_m: float
    risk_above: float
    accepted_risk: float


def decide_conformity(
    rms_m: np.ndarray,
    tolerance_m: float,
    accepted_risk: float,
    determined_rms_m: np.ndarray | None = None,
) -> Conformity:
    """Decide whether a robot keeps a tolerance.

    It passes if the risk that its RMS exceeds the tolerance is at most the accepted
    one, fails if the risk that it does not is at most that, and is otherwise undecided:
    acceptance and rejection with guard bands (JCGM 106:2012, 8.3). A robot fails by
    measurements alone: if it is only a prior that makes its error large, nothing is
    known against it, and it is undecided.

    Parameters
    ----------
    rms_m : (draws,) array
        RMS error over the same poses of robots drawn from those that a fit leaves
        possible.
    tolerance_m : float
    accepted_risk : float
    determined_rms_m : (draws,) array, optional
        The same of robots whose undetermined parameters are as estimated, see
        `accuracy.predict_determined_rms_m`; by default the measurements determine all.
    """
    risk = _compute_risk(rms_m, tolerance_m)
    determined_risk = risk
    if determined_rms_m is not None:
        determined_risk = _compute_risk(determined_rms_m, tolerance_m)
    if risk <= accepted_risk:
        decision = PASS
    elif min(risk, determined_risk) >= 1.0 - accepted_risk:
        decision = FAIL
    else:
        decision = UNDECIDED
    limit_m = float(np.quantile(rms_m, 1.0 - accepted_risk))
    return Conformity(decision, tolerance_m, limit_m, risk, accepted_risk)


def _compute_risk(rms_m: np.ndarray, tolerance_m: float) -> float:
    """Compute the share of draws above a tolerance. One more draw counts on each side,
    so that no finite number of draws gives certainty."""
    return float((1.0 + (rms_m > tolerance_m).sum()) / (2.0 + len(rms_m)))
