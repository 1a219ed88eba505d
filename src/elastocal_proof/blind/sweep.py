"""Scores of the confounding sweep: how an effect is named against the angle at which its near relative stands to it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal_proof.blind.rates import headed, rate
from elastocal_proof.blind.scores import outcome

if TYPE_CHECKING:
    from collections.abc import Mapping

# Upper ends of the bins, degrees.
ANGLES = (5.0, 10.0, 20.0, 40.0, 90.0)
# What may come of a case: the right name, a class that contains it, a wrong single name, or anything else, such as silence.
OUTCOMES = ("right", "class", "wrong", "other")


def swept(truths: Mapping[str, Mapping[str, Any]], verdicts: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Outcome of each case of the sweep.

    `truths`, `verdicts`: by the name of the case; those of other groups are passed over. Returns one row a case: pair, truth,
    design, angle_deg of the alternative on the plant, verdict_angle_deg of the nearest that the analysis saw, verdict, found,
    outcome.
    """
    columns = ["case", "robot", "pair", "truth", "design", "angle_deg", "verdict_angle_deg", "verdict", "found", "outcome"]
    rows = []
    for name, truth in truths.items():
        if truth["case"]["group"] != "sweep":
            continue
        row, alternative = outcome(truth, verdicts[name]), truth["alternative"]
        result = "right" if row["named_right"] else "wrong" if row["wrong_name"] else "other"
        result = "class" if row["verdict"] == "class" and row["holds_truth"] else result
        angles = (effect["angle_to_nearest_deg"] for effect in verdicts[name]["effects"])
        row |= {"case": name, "pair": " / ".join(sorted((row["truth"], alternative["effect"]))), "design": row["setting"]}
        row |= {"angle_deg": alternative["angle_deg"], "outcome": result}
        rows.append(row | {"verdict_angle_deg": min((angle for angle in angles if angle is not None), default=np.nan)})
    return pd.DataFrame(rows, columns=columns)


def against_angle(cases: pd.DataFrame) -> pd.DataFrame:
    """Shares of the outcomes in each bin of the angle, with their intervals, for each pair and for all.

    `cases`: of `swept`.
    """
    bins = np.array(ANGLES)[np.minimum(np.searchsorted(ANGLES, cases["angle_deg"]), len(ANGLES) - 1)]
    columns = ["pair", "angle_up_to_deg", "cases", *(f"{name}{end}" for name in OUTCOMES for end in ("", "_low", "_high"))]
    rows = []
    for mine in (cases.assign(pair="all", bin=bins), cases.assign(bin=bins)):
        for (pair, angle), part in mine.groupby(["pair", "bin"]):
            row: dict[str, Any] = {"pair": pair, "angle_up_to_deg": angle, "cases": len(part)}
            for name in OUTCOMES:
                row |= headed(name, rate(part["outcome"] == name))
            rows.append(row)
    return pd.DataFrame(rows, columns=columns)
