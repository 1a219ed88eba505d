"""A joint counted the other way round or from its neighbour, orientations the other way round, loads turned round.

Signs are facts, not parameters: each is tried, and one is named only where nothing else could be as wrong as the readings are
and they fit once it is turned.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from elastocal.faults.deflections import deflections, unit_of_loads
from elastocal.faults.placement import (
    FAR_BETTER,
    IMPLAUSIBLE_M,
    IMPLAUSIBLE_RAD,
    placed,
    rms,
    robustly_placed,
    spread,
    trimmed_rms,
)
from elastocal.faults.protocol import Fault, Value

NAME, FAMILY, AFTER = "wrong_sign", "data", ()
# What a correction leaves as it is may come out this much larger by chance.
_NO_WORSE = 1.2


@dataclass(frozen=True)
class _Reading:
    """One way to read the file: reported angles times a matrix, rotation vectors times a sign."""

    joints: tuple
    detail: str
    matrix: np.ndarray
    turn: float = 1.0


@dataclass(frozen=True)
class _Misfit:
    position_m: float
    orientation_rad: float


def find(campaign, readings):
    """Signs that must be turned for the readings to fit.

    Parameters
    ----------
    campaign : Campaign
    readings : Readings

    Returns
    -------
    list of Fault
    """
    return [*_of_joints_and_orientations(campaign, readings), *_of_loads(campaign, readings)]


def _of_joints_and_orientations(campaign, readings):
    some, joints = spread(readings), campaign.robot.joints
    written = robustly_placed(campaign, some)
    # All readings but a few, or all: a joint may move in a few poses only.
    measures = [measure for measure in (trimmed_rms, rms) if _implausible(_misfit(written, measure))]
    if not measures:
        return []
    # The simplest explanation that holds: two signs are looked at only where one is not enough.
    for ways in (_single(joints, campaign.measured == "pose"), _double(joints)):
        read = [_read(campaign, some, way) for way in ways]
        plain = [placed(campaign, part) for part in read]
        for measure in measures:
            misfits = [_misfit(placement, measure) for placement in plain]
            for best in {int(np.argmin([m.position_m for m in misfits])), int(np.argmin([m.orientation_rad for m in misfits]))}:
                corrected = robustly_placed(campaign, read[best])
                evidence = _evidence(_misfit(written, measure), _misfit(corrected, measure))
                if evidence:
                    way, poses = ways[best], float(len(np.unique(some.pose)))
                    return [Fault(NAME, way.joints, way.detail, (Value("poses tried", poses, "–"),), evidence, (), True)]
    return []


def _of_loads(campaign, readings):
    bent = deflections(campaign, readings)
    found = unit_of_loads(bent) if bent else None
    if found is None or found.sign > 0:
        return []
    detail = "the loads fit turned round, as if they were written as what the robot does to its surroundings"
    slope = Value("deflection over the one expected", found.slope, "–")
    return [Fault(NAME, (), detail, (slope,), (found.rms_as_written, found.rms_corrected), (), True)]


def _single(joints, oriented):
    unit = np.eye(joints)
    ways = []
    for j in range(joints):
        matrix = np.diag(1.0 - 2.0 * unit[j])
        ways.append(_Reading((j + 1,), f"joint {j + 1} fits with its sign turned", matrix))
    for j in range(joints - 1):
        for sign, word in ((1.0, "added to"), (-1.0, "taken from")):
            detail = f"joint {j + 2} fits with the angle of joint {j + 1} {word} it"
            ways.append(_Reading((j + 1, j + 2), detail, unit + sign * np.outer(unit[j + 1], unit[j])))
    if oriented:
        detail = "the rotation vectors fit turned round, as if they took base axes into the target's"
        ways.append(_Reading((), detail, unit, -1.0))
    return ways


def _double(joints):
    unit = np.eye(joints)
    return [
        _Reading(
            (i + 1, j + 1), f"joints {i + 1} and {j + 1} fit with their signs turned", np.diag(1 - 2 * (unit[i] + unit[j]))
        )
        for i, j in combinations(range(joints), 2)
    ]


def _read(campaign, readings, way):
    robot = campaign.robot
    # The sign of a column of the file, which counts from where the controller counts.
    reported = robot.reported_angles(readings.joint_angles)
    turned = readings.rotation_vector
    return replace(
        readings,
        joint_angles=robot.model_angles(reported @ way.matrix.T),
        rotation_vector=None if turned is None else way.turn * turned,
    )


def _misfit(placement, measure):
    return _Misfit(measure(placement.distance), 0.0 if placement.turn is None else measure(placement.turn))


def _implausible(misfit):
    return misfit.position_m > IMPLAUSIBLE_M or misfit.orientation_rad > IMPLAUSIBLE_RAD


def _evidence(written, corrected):
    """RMS before and after, of positions or else of orientations; None where a correction does not convince."""
    positions = written.position_m, corrected.position_m
    orientations = written.orientation_rad, corrected.orientation_rad
    for (before, after), (other_before, other_after), implausible, plausible in (
        (positions, orientations, IMPLAUSIBLE_M, IMPLAUSIBLE_RAD),
        (orientations, positions, IMPLAUSIBLE_RAD, IMPLAUSIBLE_M),
    ):
        improved = before > implausible and after < min(before / FAR_BETTER, implausible)
        if improved and other_after <= max(_NO_WORSE * other_before, plausible):
            return before, after
    return None
