"""Power of the targets of the blind benchmark: how probable it is to reach them.

A target without its power says nothing: with few cases a bad method reaches it by
chance, and with a limit near the nominal rate a good one misses it. Each target
therefore states a rate that is acceptable and one that is not, as in acceptance
sampling [1]_.

References
----------
.. [1] Schilling, E. G. and Neubauer, D. V., Acceptance Sampling in Quality Control,
   chapter 2, CRC Press, 2009.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binom

from elastocal_proof.blind.cases import Plan, list_cases

# Absorbs the rounding of a share at the end of a target's range.
_TOLERANCE = 1e-12


def compute_power(target: Mapping[str, Any], cases: int, rate: str) -> float:
    """Compute the probability that a share lies within a target.

    Parameters
    ----------
    target : mapping
        Entry of the plan, with ``low`` or ``high``.
    cases : int
        Number of independent cases.
    rate : str
        Key of the target that has the true rate, "acceptable" or "unacceptable".

    Returns
    -------
    float
        Not a number if the target has no such rate, or if there is no case.
    """
    if rate not in target or not cases:
        return np.nan
    low = np.ceil(cases * target.get("low", 0.0) - _TOLERANCE * cases)
    high = np.floor(cases * target.get("high", 1.0) + _TOLERANCE * cases)
    probability = binom.cdf(high, cases, target[rate])
    return float(probability - binom.cdf(low - 1, cases, target[rate]))


def tabulate_registered_targets(
    plan: Plan, size: str, seed: int, shares: tuple[float, ...] = (1.0, 0.5)
) -> pd.DataFrame:
    """Tabulate the targets of a benchmark that is not made yet, with their power.

    Parameters
    ----------
    plan : mapping
        Contents of config/blind.yaml.
    size, seed
        Size of the plan and seed of the run.
    shares : tuple of float
        Shares of the cases that are run; the cases of a smaller run are drawn at
        random from all.

    Returns
    -------
    DataFrame
        One row for each target: its words, the planned number of ``cases``, its
        acceptable and unacceptable rate, and for each share the probabilities to reach
        the target at these rates.
    """
    cases = _describe_planned_cases(plan, size, seed)
    rows = []
    for words, figure, target in _iterate_targets(plan):
        count = target.get("cases", np.nan)
        if "acceptable" not in target:
            count = np.nan
        elif "cases" not in target:
            count = len(cases.query(figure["of"]))
        row = {"quantity": words, "target": target["words"], "cases": count}
        row |= {key: target.get(key) for key in ("acceptable", "unacceptable")}
        for share in shares:
            for rate in ("acceptable", "unacceptable"):
                number = 0 if np.isnan(count) else round(share * count)
                row[f"{rate}_at_{share:g}"] = compute_power(target, number, rate)
        rows.append(row)
    return pd.DataFrame(rows)


def _iterate_targets(
    plan: Plan,
) -> Iterator[tuple[str, Mapping[str, Any], Mapping[str, Any]]]:
    """Iterate over the targets with their words and the figure that counts their cases,
    restricted to the level of the target."""
    for figure in plan["figures"]:
        for entry in figure.get("parts", [figure]):
            if "target" not in entry:
                continue
            for level in entry.get("levels", [None]):
                counted = figure.get("of", "group == group")
                words = entry["words"]
                if level is not None:
                    counted = f"({counted}) and level == {level}"
                    words = words.format(at=f"at {level:g}")
                yield words, {"of": counted}, entry["target"]


def _describe_planned_cases(plan: Plan, size: str, seed: int) -> pd.DataFrame:
    """Describe the cases of a benchmark by their planned properties, without making
    them."""
    rows = []
    for case in list_cases(plan, size, seed):
        rows.append(
            {
                "group": case.group,
                "setting": case.setting,
                "hard": bool(case.changes.get("hard")),
                "truth": " + ".join(case.effects) or "none",
                "level": max(case.levels, default=0.0),
                "absorbed": case.effects == ("force_scale",),
            }
        )
    return pd.DataFrame(rows)
