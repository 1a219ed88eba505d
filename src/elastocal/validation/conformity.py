"""Whether a robot keeps a tolerance, and the risk of being wrong: guarded acceptance after JCGM 106."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import betaincinv, ndtri

from elastocal.validation.bootstrap_t import drawn_poses, log_ratio_interval, risk_above

if TYPE_CHECKING:
    from elastocal.validation.held_out import Errors

PASS, FAIL, UNDECIDED = "pass", "fail", "undecided"


@dataclass(frozen=True)
class Conformity:
    """A robot against a tolerance on its root mean square position error.

    `decision`: one of "pass", "fail", "undecided". `limit_m`: what is compared with the tolerance to pass: the RMS is larger
    with the accepted risk. `guard_band_m`: by how much the RMS must stay below the tolerance to pass. `risk_above`: risk that
    the RMS over all poses like these lies above the tolerance. `poses_inside`: poses of which no measurement lies beyond the
    tolerance; None where nobody measured. `share_inside`: of all poses like these at least this share lies inside, at 95 %
    confidence. `poses_needed`: validation poses with which an undecided one would be decided; None where it is decided.
    """

    decision: str
    tolerance_m: float
    rms_m: float
    limit_m: float
    guard_band_m: float
    risk_above: float
    accepted_risk: float
    poses: int
    poses_inside: int | None = None
    share_inside: float | None = None
    poses_needed: int | None = None


def predicted_conformity(rms_m: np.ndarray, poses: int, tolerance_m: float, accepted_risk: float) -> Conformity:
    """Decide by the RMS over some poses of robots (draws,) that a fit leaves possible, as `conformity` does by measurements."""
    value, limit = float(np.sqrt((rms_m**2).mean())), float(np.quantile(rms_m, 1.0 - accepted_risk))
    # One more than were drawn, so that no finite number of draws gives certainty.
    risk = float((1.0 + (rms_m > tolerance_m).sum()) / (2.0 + len(rms_m)))
    guard = tolerance_m * (1.0 - value / limit) if limit > 0.0 else 0.0
    return Conformity(_decision(risk, accepted_risk), tolerance_m, value, limit, guard, risk, accepted_risk, poses)


def conformity(
    errors: Errors,
    tolerance_m: float,
    accepted_risk: float,
    replicates: int,
    stream: np.random.Generator,
    noise_m: float = 0.0,
) -> Conformity:
    """Decide whether errors keep a tolerance.

    The robot passes where the risk that its RMS over all poses lies above the tolerance is at most the accepted one, fails
    where the risk that it lies below is, and is undecided between: acceptance and rejection with guard bands [1]. The risk is
    that of the bootstrap-t over poses, see `held_out.intervals`. Noise of the tracker is taken off as squares: the mean
    square is compared with the sum of both squares. Beside it, free of any distribution and with the noise in it, the share of
    poses inside [2].

    `errors`: as measured. `noise_m`: root mean square length of the noise in the errors.

    [1] JCGM 106:2012, Evaluation of measurement data: the role of measurement uncertainty in conformity assessment, section
        8.3.
    [2] Clopper, C. J. and Pearson, E. S., The use of confidence or fiducial limits illustrated in the case of the binomial,
        Biometrika 26, 1934.
    """
    poses = errors.poses
    counts = np.bincount(errors.cluster).astype(float)
    squares = np.bincount(errors.cluster, errors.distance**2)
    weights = drawn_poses(poses, replicates, stream)
    square, noise = float(squares.sum() / counts.sum()), noise_m**2
    limit = float(np.log(tolerance_m**2 + noise))
    risk = risk_above(squares, counts, weights, limit)
    ends = np.array([accepted_risk, 1.0 - accepted_risk])
    interval, std_error = log_ratio_interval(squares, counts, weights, ends)
    highest = float(np.exp(interval[1]))
    # The largest RMS that would have passed with the same relative uncertainty.
    guard = tolerance_m - _without(square / highest * (tolerance_m**2 + noise), noise)
    decision = _decision(risk, accepted_risk)
    inside = np.bincount(errors.cluster, errors.distance > tolerance_m) == 0
    kept = int(inside.sum())
    lowest = float(betaincinv(kept, poses - kept + 1, 0.05)) if kept else 0.0
    needed = None
    if decision == UNDECIDED:
        apart = max(abs(np.log(square) - limit), 1e-3)
        needed = max(int(np.ceil(poses * (ndtri(1.0 - accepted_risk) * std_error / apart) ** 2)), poses + 1)
    found = tolerance_m, _without(square, noise), _without(highest, noise), guard, risk, accepted_risk
    return Conformity(decision, *found, poses, kept, lowest, needed)


def _decision(risk: float, accepted: float) -> str:
    return PASS if risk <= accepted else FAIL if risk >= 1.0 - accepted else UNDECIDED


def _without(square: float, noise: float) -> float:
    return float(np.sqrt(max(square - noise, 0.0)))
