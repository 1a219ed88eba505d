"""Whether a robot keeps a tolerance, and the risk of being wrong: guarded acceptance after JCGM 106."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import beta, norm

from elastocal.validation.bootstrap_t import drawn_poses, log_ratio_interval, risk_above

if TYPE_CHECKING:
    from elastocal.validation.held_out import Errors

PASS, FAIL, UNDECIDED = "pass", "fail", "undecided"


@dataclass(frozen=True)
class Conformity:
    """A robot against a tolerance on its root mean square position error.

    Attributes
    ----------
    decision : {"pass", "fail", "undecided"}
    tolerance_m, rms_m : float
    guard_band_m : float
        By how much the RMS must stay below the tolerance to pass.
    risk_above : float
        Risk that the RMS over all poses like these lies above the tolerance.
    accepted_risk : float
    poses : int
    poses_inside : int
        Poses of which no measurement lies beyond the tolerance.
    share_inside : float
        Of all poses like these at least this share lies inside, at 95 % confidence.
    poses_needed : int or None
        Validation poses with which an undecided one would be decided; None where it is decided.
    """

    decision: str
    tolerance_m: float
    rms_m: float
    guard_band_m: float
    risk_above: float
    accepted_risk: float
    poses: int
    poses_inside: int
    share_inside: float
    poses_needed: int | None


def conformity(
    errors: Errors, tolerance_m: float, accepted_risk: float, replicates: int, stream: np.random.Generator
) -> Conformity:
    """Decide whether errors keep a tolerance.

    The robot passes where the risk that its RMS over all poses lies above the tolerance is at most the accepted one, fails
    where the risk that it lies below is, and is undecided between: acceptance and rejection with guard bands [1]_. The risk is
    that of the bootstrap-t over poses, see `held_out.intervals`. The tracker's noise is in the errors and can only make a robot
    look worse. Beside it, free of any distribution, the share of poses inside [2]_.

    Parameters
    ----------
    errors : Errors
        On held-out poses.
    tolerance_m : float
    accepted_risk : float
    replicates : int
    stream : numpy.random.Generator

    Returns
    -------
    Conformity

    References
    ----------
    .. [1] JCGM 106:2012, Evaluation of measurement data: the role of measurement uncertainty in conformity assessment,
       section 8.3.
    .. [2] Clopper, C. J. and Pearson, E. S., The use of confidence or fiducial limits illustrated in the case of the binomial,
       Biometrika 26, 1934.
    """
    poses = errors.poses
    counts = np.bincount(errors.cluster).astype(float)
    squares = np.bincount(errors.cluster, errors.distance**2)
    weights = drawn_poses(poses, replicates, stream)
    rms = float(np.sqrt(squares.sum() / counts.sum()))
    limit = 2.0 * np.log(tolerance_m)
    risk = risk_above(squares, counts, weights, limit)
    ends = np.array([accepted_risk, 1.0 - accepted_risk])
    interval, std_error = log_ratio_interval(squares, counts, weights, ends)
    # The largest RMS that would have passed with the same relative uncertainty.
    guard = tolerance_m * (1.0 - rms / float(np.exp(0.5 * interval[1])))
    decision = PASS if risk <= accepted_risk else FAIL if risk >= 1.0 - accepted_risk else UNDECIDED
    inside = np.bincount(errors.cluster, errors.distance > tolerance_m) == 0
    kept = int(inside.sum())
    lowest = float(beta.ppf(0.05, kept, poses - kept + 1)) if kept else 0.0
    needed = None
    if decision == UNDECIDED:
        apart = max(abs(2.0 * np.log(rms) - limit), 1e-3)
        needed = max(int(np.ceil(poses * (norm.ppf(1.0 - accepted_risk) * std_error / apart) ** 2)), poses + 1)
    return Conformity(decision, tolerance_m, rms, guard, risk, accepted_risk, poses, kept, lowest, needed)
