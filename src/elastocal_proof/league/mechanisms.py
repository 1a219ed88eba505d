"""Which effects a diagnosis of training poses found, how probable each is and how much of the error it explains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.averaging import squares_explained

if TYPE_CHECKING:
    from elastocal.diagnosis.diagnose import Diagnosis


def mechanism_columns(diagnosis: Diagnosis, fold: int) -> dict[str, np.ndarray | list[str]]:
    """Mechanisms of one fold.

    The share of a mechanism is the sum of squares that it displaces the measurements by, beyond what geometry and frames take
    up, over that of the residual which these leave; all in units of the noise. Mechanisms that resemble each other share, so
    shares need not add up to that of all together.

    Returns (K,): columns of the mechanisms table; none where the data are at fault.
    """
    names: list[str] = []
    probabilities, shares = [], []
    if diagnosis.evidence:
        evidence = diagnosis.evidence
        best = evidence.conclusion.best
        explained: dict[str, float] = {}
        if best.named:
            explained = squares_explained(evidence.linearized.problem, evidence.posterior.models[best.model])
        total = float(evidence.linearized.problem.statistics.squares[0])
        for name, probability in evidence.conclusion.mechanisms.items():
            names.append(name)
            probabilities.append(probability)
            shares.append(explained.get(name, 0.0) / total)
    return {
        "fold": np.full(len(names), fold),
        "mechanism": names,
        "probability": np.array(probabilities, float),
        "share": np.array(shares, float),
    }
