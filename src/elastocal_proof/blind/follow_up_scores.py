"""Scores of the loop once more: how often the name is right after so many further poses, proposed or random."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.diagnosis.verdict import CLASS
from elastocal_proof.blind.cases import GEAR_GRAVITY, SEVERAL_JOINTS, UNDECLARED
from elastocal_proof.blind.follow_up import ARMS, POSES
from elastocal_proof.blind.rates import rate
from elastocal_proof.blind.scores import outcome

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_CASE_COLUMNS = ["case", "robots", "robot", "group", "setting", "truth", "level", "promised", "arm", "poses_added"]
_CASE_COLUMNS += ["verdict", "found", "named_right", "holds_truth", "wrong_name"]
_COLUMNS = ["robots", "arm", "poses_added", "cases", "right_name", "low", "high", "still_class", "wrong_name", "other_verdict"]
_PROMISE_COLUMNS = ["robots", "quantity", "hits", "cases", "rate", "low", "high", "target", "holds"]
# Non-centrality at which nine of ten experiments resolve two alternatives at odds of 19 to 1.
PROMISE = 16.0
_POSES_COLUMNS = ["robots", "arm", "cases", "reached", "median_poses"]


def followed(
    truths: Mapping[str, Mapping[str, Any]],
    first: Mapping[str, Mapping[str, Any]],
    anew: Sequence[Mapping[str, Any]],
    promised: Mapping[str, float],
) -> pd.DataFrame:
    """Score of the verdict on each case followed up, after each number of poses.

    `truths`: sealed documents by the name of the case. `first`: verdicts on the campaigns as they were. `anew`: ``campaign,
    arm, poses, verdict``: verdicts on the campaigns with further poses. `promised`: separation that the proposal promises from
    the nearest alternative with all its poses. Returns one row for each case, arm and number of poses, 0 among them. After a
    single name no more is measured, and it stands.
    """
    verdicts = {(entry["campaign"], entry["arm"], entry["poses"]): entry["verdict"] for entry in anew}
    rows = []
    for name in sorted({entry["campaign"] for entry in anew}):
        for arm in ARMS:
            verdict = first[name]
            for poses in (0, *POSES):
                verdict = verdicts.get((name, arm, poses), verdict)
                rows.append({"arm": arm, "poses_added": poses, "promised": promised[name]} | outcome(truths[name], verdict))
    return pd.DataFrame(rows, columns=_CASE_COLUMNS)


def promised(proposals: pd.DataFrame) -> dict[str, float]:
    """Separation from the nearest alternative with all poses, by the name of the case, of tables of proposals.

    None where a proposal states that it leaves alternatives aside, for it promises no single name then.
    """
    if "separation" not in proposals:
        return {}
    whole = proposals["indistinguishable"].fillna("") == ""
    nearest = proposals["separation"].where(whole, 0.0).groupby(proposals["case"]).max()
    return {str(case): float(separation) for case, separation in nearest.items()}


def with_one_effect(cases: pd.DataFrame) -> pd.Series:
    """Which rows are of cases that a single name can be right for: one effect of the catalogue that measurements can show."""
    groups = ("single", "setting", "sweep", SEVERAL_JOINTS, GEAR_GRAVITY, UNDECLARED)
    return cases["group"].isin(groups) & ~cases["truth"].isin(("none", "force_scale"))


def with_prospects(cases: pd.DataFrame) -> pd.Series:
    """Which rows are of cases whose proposal promises as much separation as the verdict asks for.

    The others are aliases, exact ones or nearly so: no poses and loads of this kind would distinguish them.
    """
    return cases["promised"] >= PROMISE


def promises_kept(cases: pd.DataFrame) -> pd.DataFrame:
    """How often an experiment that promises enough resolves the case, and how often as many random poses do.

    `cases`: of `followed`, with one effect each. Returns one row for each kind of robots and quantity, with its target: the
    right name alone after all poses, of the cases whose proposal promises a separation of at least `PROMISE`; and the ratio of
    proposed to random poses in that.
    """
    last = cases[(cases["poses_added"] == max(POSES)) & (cases["promised"] >= PROMISE)]
    rows: list[dict[str, Any]] = []
    for robots, part in last.groupby("robots"):
        kept = {arm: rate(part.loc[part["arm"] == arm, "named_right"]) for arm in ARMS}
        for arm in ARMS:
            words, least = ("at least 90 %", 0.9) if arm == ARMS[0] else ("", 0.0)
            holds = kept[arm]["rate"] >= least if words else None
            rows.append(
                {"robots": robots, "quantity": f"right name alone after {arm} poses", "target": words, "holds": holds}
                | kept[arm]
            )
        ratio = kept["proposed"]["rate"] / kept["random"]["rate"] if kept["random"]["hits"] else np.inf
        row = {"hits": None, "cases": len(part) // len(ARMS), "rate": ratio, "low": np.nan, "high": np.nan}
        rows.append({"robots": robots, "quantity": "proposed over random", "target": "at least 2", "holds": ratio >= 2.0} | row)
    return pd.DataFrame(rows, columns=_PROMISE_COLUMNS)


def rates(cases: pd.DataFrame) -> pd.DataFrame:
    """How often the name is right, with its interval.

    `cases`: of `followed`. Returns columns right_name to high are shares of the cases, the others counts.
    """
    rows = []
    for key, part in cases.groupby(["robots", "arm", "poses_added"]):
        right, still, wrong = rate(part["named_right"]), (part["verdict"] == CLASS).sum(), part["wrong_name"].sum()
        rest = len(part) - right["hits"] - still - wrong
        rows.append((*key, len(part), right["rate"], right["low"], right["high"], still, wrong, rest))
    return pd.DataFrame(rows, columns=_COLUMNS)


def poses_needed(cases: pd.DataFrame) -> pd.DataFrame:
    """How many further poses it took until the right name.

    `cases`: of `followed`. Returns for the cases that reached it, their number and their median.
    """
    rows = []
    for key, part in cases.groupby(["robots", "arm"]):
        needed = part[part["named_right"]].groupby("case")["poses_added"].min()
        rows.append((*key, part["case"].nunique(), len(needed), needed.median()))
    return pd.DataFrame(rows, columns=_POSES_COLUMNS)
