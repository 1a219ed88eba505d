"""How often a verdict stays that of the clean file, and how often the bad rows are named, beside what the issue asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal_proof.blind.bad_rows import CLEAN, DAMAGED, FEWER, NAMED_FROM
from elastocal_proof.blind.rates import rate

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

SAME, SAME_JOINTS, NAMED, UNTOUCHED = "verdict of the clean file", "and its joints", "row named", "no row lost"
# Least share of each, as the issue sets them.
TARGETS = {SAME: 0.97, NAMED: 0.95, UNTOUCHED: 0.98}
_CASE = ["robot", "seed"]
_COLUMNS = ["quantity", "of", *rate([]), "target", "holds"]


def judge_cases(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Every slip with whether the verdict on its case stayed the same.

    `tables`: rows of `bad_rows.compare_verdicts` by robot.
    """
    frame = pd.concat([table.assign(robot=robot) for robot, table in tables.items()], ignore_index=True)
    for version in (DAMAGED, FEWER):
        alike = [frame[f"{version}_{name}"] == frame[f"{CLEAN}_{name}"] for name in ("verdict", "found", "found_at")]
        frame[f"{version}_same"] = alike[0] & alike[1]
        frame[f"{version}_same_joints"] = alike[0] & alike[2]
    frame["heldout_ratio"] = frame[f"{DAMAGED}_heldout_rms_m"] / frame[f"{CLEAN}_heldout_rms_m"]
    return frame[[*_CASE, *(name for name in frame if name not in _CASE)]]


def summarize(slips: pd.DataFrame) -> pd.DataFrame:
    """Each rate with its interval of 95 %, of all cases and of parts of them, and with its target where it has one.

    `slips`: of `judge_cases`.
    """
    return pd.DataFrame(
        [row for part in (_of_cases(slips), _of_slips(slips), _of_errors(slips)) for row in part], columns=_COLUMNS
    )


def _of_cases(slips: pd.DataFrame) -> Iterator[dict[str, Any]]:
    cases = slips.drop_duplicates(_CASE)
    yield _rated(SAME, "all cases", cases[f"{DAMAGED}_same"], judged=True)
    yield _rated(SAME, "with as many good rows deleted", cases[f"{FEWER}_same"])
    yield _rated(SAME_JOINTS, "all cases", cases[f"{DAMAGED}_same_joints"])
    yield _rated(SAME_JOINTS, "with as many good rows deleted", cases[f"{FEWER}_same_joints"])
    for name in ("kind", "mixture", "robot"):
        for value, part in cases.groupby(name):
            yield _rated(SAME, str(value), part[f"{DAMAGED}_same"])
    yield _rated(UNTOUCHED, "clean files", cases["clean_rows_lost"] == 0, judged=True)
    yield _rated(UNTOUCHED, "good rows of damaged files", cases["wrongly_named"] == 0)
    yield _rated("refused when read", "all cases", cases[f"{DAMAGED}_verdict"] == "refused")


def _of_slips(slips: pd.DataFrame) -> Iterator[dict[str, Any]]:
    large = slips[slips["size"] >= NAMED_FROM]
    yield _rated(NAMED, f"from {NAMED_FROM:g} standard deviations", large["named"], judged=True)
    yield _rated(NAMED, "smaller", slips[slips["size"] < NAMED_FROM]["named"])
    for words, part in large.groupby(np.where(large["held_out"], "held out", "fitted")):
        yield _rated(NAMED, str(words), part["named"])
    for kind, part in large.groupby("kind"):
        yield _rated(NAMED, str(kind), part["named"])


def _of_errors(slips: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Held-out errors of the damaged file over those of the clean one, by quantiles of the cases."""
    ratio = slips.drop_duplicates(_CASE)["heldout_ratio"].dropna()
    for words, share in (("median", 0.5), ("95th percentile", 0.95), ("largest", 1.0)):
        value = float(ratio.quantile(share)) if len(ratio) else np.nan
        row = {"hits": None, "cases": len(ratio), "rate": value, "low": np.nan, "high": np.nan, "target": np.nan, "holds": None}
        yield {"quantity": "held-out RMS error over the clean file's", "of": words} | row


def _rated(quantity: str, of: str, hits: pd.Series, judged: bool = False) -> dict[str, Any]:
    found = rate(hits)
    target = TARGETS[quantity] if judged else np.nan
    holds = bool(found["rate"] >= target) if judged and found["cases"] else None
    return {"quantity": quantity, "of": of} | found | {"target": target, "holds": holds}
