"""Two campaigns of one robot, before and after a crash, a repair or a year: whether it moves differently, and by what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from elastocal.application.accuracy import remove_rigid_motion
from elastocal.application.calibrated import forward, pose_sensitivities, square_root
from elastocal.errors import InputError
from elastocal.fitting.parameters import parameters

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot


@dataclass(frozen=True)
class Change:
    """A parameter that both campaigns have.

    `before`, `after`, `std_error`: standard error of the difference. `p_value`: that it did not change, adjusted for all that
    are compared (Holm).
    """

    owner: str
    name: str
    unit: str
    before: float
    after: float
    std_error: float
    p_value: float


@dataclass(frozen=True)
class Comparison:
    """How two campaigns differ.

    `rms_m`: of the distance between both robots' positions over some poses, unloaded, after the best rigid motion of their
    bases. `expected_m`: the same where nothing changed, by the uncertainty of both: median. `p_value`: that nothing changed.
    `changes`: most certain first; empty where the campaigns leave different parameters at their values.
    """

    rms_m: float
    expected_m: float
    p_value: float
    largest_m: float
    changes: tuple[Change, ...]


def compare_campaigns(
    before: CalibratedRobot, after: CalibratedRobot, reported_angles: np.ndarray, draws: int, stream: np.random.Generator
) -> Comparison:
    """Compare what two campaigns found of one robot.

    Positions are compared after the best rigid motion [1]: where the tracker was set up is no property of the robot. The same
    distance is drawn as it would be if nothing had changed, from the covariances of both; its rank is the p-value [2].

    `reported_angles` (N, n): rad, over the workspace. Raises `InputError`: two robots of different chains.

    [1] Kabsch, W., A solution for the best rotation to relate two sets of vectors, Acta Crystallographica A32, 1976.
    [2] Davison, A. C. and Hinkley, D. V., Bootstrap Methods and their Application, section 4.2, Cambridge, 1997.
    """
    if before.robot.chain != after.robot.chain:
        raise InputError("--compare", "", f"another robot, {before.robot.name}", f"a campaign of {after.robot.name}")
    ends = [forward(each, reported_angles)[0] for each in (before, after)]
    apart = remove_rigid_motion(ends[1] - ends[0], ends[0])
    distance = np.linalg.norm(apart, axis=-1)
    rms = float(np.sqrt((distance**2).mean()))
    off = np.zeros((draws, *ends[0].shape))
    for each in (before, after):
        moved = pose_sensitivities(each, reported_angles)[:, :3] @ square_root(each.covariance)
        off += np.einsum("nik,dk->dni", moved, stream.standard_normal((draws, moved.shape[-1])))
    drawn = np.sqrt((remove_rigid_motion(off, ends[0]) ** 2).sum(axis=2).mean(axis=1))
    p_value = (1.0 + (drawn >= rms).sum()) / (1.0 + draws)
    return Comparison(rms, float(np.median(drawn)), float(p_value), float(distance.max()), _changes(before, after))


def _changes(before: CalibratedRobot, after: CalibratedRobot) -> tuple[Change, ...]:
    """Differences of the parameters of both, where both leave the same ones at their values."""
    from statsmodels.stats.multitest import multipletests

    found = [_values(each) for each in (before, after)]
    kept = [{key for key, (_, error, _) in values.items() if error > 0.0} for values in found]
    if kept[0] != kept[1] or not kept[0]:
        return ()
    keys = [key for key in found[1] if key in kept[1]]
    old, new = (np.array([values[key][:2] for key in keys]) for values in found)
    errors = np.hypot(old[:, 1], new[:, 1])
    raw = 2.0 * ndtr(-np.abs(new[:, 0] - old[:, 0]) / errors)
    adjusted = multipletests(raw, method="holm")[1]
    changes = [
        Change(
            key[0], key[1], found[1][key][2], float(old[row, 0]), float(new[row, 0]), float(errors[row]), float(adjusted[row])
        )
        for row, key in enumerate(keys)
    ]
    return tuple(changes[row] for row in np.argsort(raw, kind="stable"))


def _values(calibrated: CalibratedRobot) -> dict[tuple[str, str], tuple[float, float, str]]:
    """Value, standard error and unit by owner and name."""
    listed = parameters(calibrated.model, calibrated.estimate)
    pairs = zip(calibrated.estimate.coefficients, calibrated.estimate.shapes, strict=True)
    values = np.concatenate([np.zeros(0), *(part for pair in pairs for part in pair)])
    errors = np.sqrt(np.diag(calibrated.covariance))
    return {
        (owner, parameter.name): (float(value), float(error), parameter.unit)
        for (owner, parameter), value, error in zip(listed, values, errors, strict=True)
    }
