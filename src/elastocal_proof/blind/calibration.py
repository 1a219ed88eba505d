"""Whether stated probabilities are calibrated: reliability diagram, expected calibration error, coverage of 95 % sets.

A hypothesis is a set of mechanisms, as in ``verdict.json``; the empty set is "nothing". What is true of a case is the set of
its mechanisms. Of a mechanism that the catalogue does not have every set that holds "other" is true; one that the joint
compliances absorb at any size is as good as nothing, and no measurement could distinguish the two.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.random_streams import stream
from elastocal_proof.blind.rates import rate
from elastocal_proof.blind.scores import NONE, PROOF, TUNED, head_of, wrong_setup
from elastocal_proof.plant.defects import OUTSIDE

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

OTHER = "other"
_CREDIBLE = 0.95
_BINS = 10
_RESAMPLES = 2000
_COLUMNS = ["case", "robots", "robot", "group", "setting", "truth", "level", "stated", "top", "correct"]
_COLUMNS += ["held", "set_size", "set_probability", "nothing", "alarm_p_value"]
_RELIABILITY = ["robots", "group", "from", "to", "stated", "hits", "cases", "rate", "low", "high"]


def stated(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> dict[str, Any] | None:
    """What was stated of a case, and whether it is so.

    `truth`: a sealed document. `verdict`: as verdict.json. Returns ``stated``, probability of the most probable set of
    mechanisms; ``top``, that set; ``correct``, whether it is the true one; ``held``, whether the smallest set of hypotheses
    that reaches 95 % holds the true one; ``set_size``, of how many these are, and ``set_probability``, what they reach;
    ``nothing``; ``alarm_p_value``. None where nothing was stated, as with a fault of the data.
    """
    probabilities = verdict.get("probabilities")
    if not probabilities or not probabilities["sets"]:
        return None
    ranked = sorted(
        ((frozenset(entry["mechanisms"]), entry["probability"]) for entry in probabilities["sets"]), key=lambda e: -e[1]
    )
    believed, (top, probability) = credible(ranked), ranked[0]
    return head_of(truth) | {
        "stated": probability,
        "top": " + ".join(sorted(top)) or NONE,
        "correct": is_true(top, truth),
        "held": any(is_true(mechanisms, truth) for mechanisms, _ in believed),
        "set_size": len(believed),
        "set_probability": sum(share for _, share in believed),
        "nothing": probabilities["nothing"],
        "alarm_p_value": probabilities["alarm_p_value"],
    }


def is_true(mechanisms: Collection[str], truth: Mapping[str, Any]) -> bool:
    """Whether a set of mechanisms is what is true of a case.

    `truth`: a sealed document.
    """
    effects = truth["case"]["effects"]
    if any(effect.startswith(OUTSIDE) for effect in effects):
        return OTHER in mechanisms
    absorbed = {defect["effect"] for defect in truth["defects"] if defect["of"] == "raw"}
    return set(mechanisms) - wrong_setup(truth) == set(effects) - absorbed


def credible(ranked: Sequence[tuple[frozenset[str], float]]) -> list[tuple[frozenset[str], float]]:
    """The smallest set of hypotheses that reaches 95 %, that of highest posterior probability; all of them where they do not.

    `ranked` (frozenset, float): the most probable first. Returns (frozenset, float).
    """
    reached = np.cumsum([probability for _, probability in ranked])
    return list(ranked[: int(np.searchsorted(reached, _CREDIBLE)) + 1])


def statements(entries: Iterable[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> pd.DataFrame:
    """One row for each case of which something was stated.

    `entries` (dict, dict): ground truth and verdict. Returns columns as of `stated`.
    """
    return pd.DataFrame([row for row in (stated(*entry) for entry in entries) if row], columns=_COLUMNS)


def expected_calibration_error(probability: np.ndarray, correct: np.ndarray, bins: int = _BINS) -> np.ndarray:
    """Mean distance between what is stated and how often it is so: sum over bins of n_b / n |mean stated - share correct|.

    `probability` (..., n): stated, 0 to 1. `correct` (..., n) of bool. `bins`: of equal width. Returns (...,).

    As defined in [1] and [2]. Even of verdicts that are calibrated it is not 0 but what `by_chance` gives, for the share of
    few cases scatters.

    [1] Naeini, M. P., Cooper, G. F. and Hauskrecht, M., Obtaining well calibrated probabilities using Bayesian binning, AAAI
        Conference on Artificial Intelligence, 2015.
    [2] Guo, C., Pleiss, G., Sun, Y. and Weinberger, K. Q., On calibration of modern neural networks, International Conference
        on Machine Learning, 2017.
    """
    probability, correct = np.broadcast_arrays(np.asarray(probability, float), np.asarray(correct, float))
    if probability.shape[-1] == 0:
        return np.full(probability.shape[:-1], np.nan)
    which = _bin_of(probability, bins)
    return sum(np.abs(((probability - correct) * (which == b)).sum(axis=-1)) for b in range(bins)) / probability.shape[-1]


def by_chance(probability: np.ndarray, draws: np.random.Generator, bins: int = _BINS) -> float:
    """Mean of `expected_calibration_error` of verdicts that are calibrated, at the same stated probabilities (n,), float.

    Outcomes are drawn by what is stated, as in consistency resampling [1], where what is stated is drawn too.

    [1] Bröcker, J. and Smith, L. A., Increasing the reliability of reliability diagrams, Weather and Forecasting 22, 2007.
    """
    probability = np.asarray(probability, float)
    so = draws.random((_RESAMPLES, len(probability))) < probability
    return float(expected_calibration_error(probability, so, bins).mean()) if len(probability) else float("nan")


def calibration_error(rows: pd.DataFrame, seed: int) -> dict[str, Any]:
    """Expected calibration error with a basic bootstrap interval [1] of 95 % over cases.

    `rows`: of `statements`. Returns ``hits`` (None), ``cases``, ``rate``, ``low``, ``high`` as `rates.rate` has them, and
    ``by_chance``.

    [1] Davison, A. C. and Hinkley, D. V., Bootstrap Methods and their Application, section 5.2, Cambridge University Press,
        1997.
    """
    probability, correct = rows.stated.to_numpy(float), rows.correct.to_numpy(bool)
    error = float(expected_calibration_error(probability, correct))
    found = {"hits": None, "cases": len(rows), "rate": error}
    if len(rows) < 2:
        return found | {"low": np.nan, "high": np.nan, "by_chance": np.nan}
    draws = stream(seed, "blind", "calibration error", 0)
    picked = draws.integers(len(rows), size=(_RESAMPLES, len(rows)))
    again = expected_calibration_error(probability[picked], correct[picked])
    # The basic interval: a resample of a calibrated sample is less calibrated than the sample, by what the sample is already.
    low, high = 2.0 * error - np.quantile(again, [0.975, 0.025])
    return found | {"low": max(float(low), 0.0), "high": max(float(high), 0.0), "by_chance": by_chance(probability, draws)}


def reliability(rows: pd.DataFrame, bins: int = _BINS) -> pd.DataFrame:
    """Data of the reliability diagram [1].

    `rows`: of `statements`. `bins`: of equal width. Returns one row for each kind of robots, group of cases (``all`` for all of
    them) and bin that has a case: its ends, the mean of what was stated and the share that was so, with a Clopper-Pearson
    interval.

    [1] Murphy, A. H. and Winkler, R. L., Reliability of subjective probability forecasts of precipitation and temperature,
        Applied Statistics 26, 1977.
    """
    found = []
    for robots in (PROOF, TUNED):
        mine = rows[rows.robots == robots]
        for group in ("all", *sorted(set(mine.group))):
            part = mine if group == "all" else mine[mine.group == group]
            which = _bin_of(part.stated.to_numpy(float), bins)
            for number in sorted(set(which.tolist())):
                inside = part[which == number]
                ends = {"from": number / bins, "to": (number + 1) / bins, "stated": inside.stated.mean()}
                found.append({"robots": robots, "group": group} | ends | rate(inside.correct))
    return pd.DataFrame(found, columns=_RELIABILITY)


def _bin_of(probability: np.ndarray, bins: int) -> np.ndarray:
    return np.clip((np.asarray(probability) * bins).astype(int), 0, bins - 1)
