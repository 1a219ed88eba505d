"""Whether errors say enough of a robot's use, and whether it keeps a tolerance: guarded
acceptance after JCGM 106."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.campaigns.holdout import number_configurations
from elastocal.counting import format_count
from elastocal.fitting.observations import index_poses

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Measurements
    from elastocal.fitting.observations import States
    from elastocal.mechanics.robot import Robot

# With so many configurations the largest error bounds 69 % of all others at 95 %
# confidence; fewer show little more than half.
MIN_CONFIGURATIONS = 8
# Over this turn an error that goes with the sine of a joint's angle changes by half of
# its amplitude: over less it is hardly distinguishable from a constant.
MIN_ROTATION_RAD = 2.0 * np.arcsin(0.25)
# The same of a rail, as a share of its travel.
MIN_TRAVEL_SHARE = 0.1
PASS = "pass"
FAIL = "fail"
UNDECIDED = "undecided"


def count_configurations(states: States | Measurements) -> int:
    """How many configurations states or measurements are of."""
    return (
        int(number_configurations(states.joint_angles, index_poses(states)).max()) + 1
    )


def find_joint_ranges(states: States, robot: Robot) -> list[dict[str, Any]]:
    """Smallest and largest angle of each joint with its unit, degrees or of a rail m,
    JSON-serialisable."""
    ends = np.array(
        [states.joint_angles.min(axis=0), states.joint_angles.max(axis=0)]
    ).T
    units = [
        (pair, "m") if rail else (np.rad2deg(pair), "deg")
        for pair, rail in zip(ends, robot.chain.prismatic, strict=True)
    ]
    return [
        {"low": float(low), "high": float(high), "unit": unit}
        for (low, high), unit in units
    ]


def list_shortfalls(judged: int, fitted: States, robot: Robot) -> list[str]:
    """Why errors at some configurations say too little of a robot: they are too few, or
    a joint hardly moved."""
    found = []
    if judged < MIN_CONFIGURATIONS:
        found.append(
            f"too few: {format_count(judged, 'configuration')}, where at least {MIN_CONFIGURATIONS} must judge"
        )
    moved = np.ptp(fitted.joint_angles, axis=0)
    rails = np.array(robot.chain.prismatic)
    least = np.where(
        rails, MIN_TRAVEL_SHARE * np.ptp(robot.joint_limits, axis=1), MIN_ROTATION_RAD
    )
    for joint in np.flatnonzero(moved < least):
        sizes = [
            f"{size:.3g} m" if rails[joint] else f"{np.rad2deg(size):.0f}°"
            for size in (moved[joint], least[joint])
        ]
        found.append(
            f"too close: joint {joint + 1} moved by {sizes[0]}, and {sizes[1]} are needed"
        )
    return found


@dataclass(frozen=True)
class Conformity:
    """A robot against a tolerance on its root mean square position error.

    `decision`: one of "pass", "fail", "undecided". `limit_m`: what is compared with the
    tolerance to pass: the RMS is larger with the accepted risk. `risk_above`: risk that
    the RMS over all poses like these lies above the tolerance."""

    decision: str
    tolerance_m: float
    limit_m: float
    risk_above: float
    accepted_risk: float


def decide_conformity(
    rms_m: np.ndarray, tolerance_m: float, accepted_risk: float
) -> Conformity:
    """Decide by the RMS over some poses of robots (draws,) that a fit leaves possible.

    The robot passes where the risk that its RMS lies above the tolerance is at most the
    accepted one, fails where the risk that it lies below is, and is undecided between:
    acceptance and rejection with guard bands (JCGM 106:2012, 8.3).
    """
    # One more than were drawn, so that no finite number of draws gives certainty.
    risk = float((1.0 + (rms_m > tolerance_m).sum()) / (2.0 + len(rms_m)))
    decision = (
        PASS
        if risk <= accepted_risk
        else FAIL
        if risk >= 1.0 - accepted_risk
        else UNDECIDED
    )
    return Conformity(
        decision,
        tolerance_m,
        float(np.quantile(rms_m, 1.0 - accepted_risk)),
        risk,
        accepted_risk,
    )
