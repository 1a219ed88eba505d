"""Whether a robot keeps a tolerance, and the risk of being wrong: guarded acceptance after JCGM 106."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PASS, FAIL, UNDECIDED = "pass", "fail", "undecided"


@dataclass(frozen=True)
class Conformity:
    """A robot against a tolerance on its root mean square position error.

    `decision`: one of "pass", "fail", "undecided". `limit_m`: what is compared with the tolerance to pass: the RMS is larger
    with the accepted risk. `guard_band_m`: by how much the RMS must stay below the tolerance to pass. `risk_above`: risk that
    the RMS over all poses like these lies above the tolerance."""

    decision: str
    tolerance_m: float
    rms_m: float
    limit_m: float
    guard_band_m: float
    risk_above: float
    accepted_risk: float
    poses: int


def predicted_conformity(rms_m: np.ndarray, poses: int, tolerance_m: float, accepted_risk: float) -> Conformity:
    """Decide by the RMS over some poses of robots (draws,) that a fit leaves possible.

    The robot passes where the risk that its RMS lies above the tolerance is at most the accepted one, fails where the risk that
    it lies below is, and is undecided between: acceptance and rejection with guard bands [1].

    [1] JCGM 106:2012, Evaluation of measurement data: the role of measurement uncertainty in conformity assessment, section
        8.3.
    """
    value, limit = float(np.sqrt((rms_m**2).mean())), float(np.quantile(rms_m, 1.0 - accepted_risk))
    # One more than were drawn, so that no finite number of draws gives certainty.
    risk = float((1.0 + (rms_m > tolerance_m).sum()) / (2.0 + len(rms_m)))
    guard = tolerance_m * (1.0 - value / limit) if limit > 0.0 else 0.0
    return Conformity(_decision(risk, accepted_risk), tolerance_m, value, limit, guard, risk, accepted_risk, poses)


def _decision(risk: float, accepted: float) -> str:
    return PASS if risk <= accepted else FAIL if risk >= 1.0 - accepted else UNDECIDED
