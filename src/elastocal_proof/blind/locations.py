"""Scores of the locations that a verdict states: the joints, or the links that begin at
them, of the effects that it names.

A repair needs the joint as well as the mechanism. So each true effect that acts at joints
is one row, even if the verdict does not state it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from elastocal_proof.plant.kinds import OUTSIDE

# A sealed document, or a part of it or of verdict.json.
Document = Mapping[str, Any]

RIGHT = "right"
PARTLY = "partly"
WRONG = "wrong"
NOT_STATED = "not stated"
SEVERAL_LOCATIONS = "several"
# Columns of the confusion table that are no single joint.
_NO_JOINT = (SEVERAL_LOCATIONS, NOT_STATED)
_COLUMNS = [
    "case",
    "group",
    "robot",
    "setting",
    "level",
    "effect",
    "true_joints",
    "stated_joints",
    "outcome",
    "stated",
    "right",
    "wrong",
]


def list_locations(truth: Document, verdict: Document) -> list[dict[str, Any]]:
    """List the true effects of a case that act at joints, with the joints that the
    verdict states.

    Effects outside of the catalogue have no name under which a location could be
    stated, and an effect that the declared model absorbs cannot be found.

    Parameters
    ----------
    truth, verdict : mapping
        Sealed document of a case, and its verdict as in verdict.json.

    Returns
    -------
    list of dict
        ``true_joints``, ``stated_joints``: numbers joined by "-". ``outcome``: "right"
        if they are the same joints, "partly" if they share one, "wrong" if they share
        none, and "not stated" if the verdict does not name the effect or no joint of
        it.
    """
    case = truth["case"]
    true_joints: dict[str, set[int]] = {}
    for defect in truth["defects"]:
        effect = defect["effect"]
        if not effect.startswith(OUTSIDE) and defect["of"] != "raw":
            true_joints.setdefault(effect, set()).update(defect["joints"])
    stated_joints = {
        effect["name"]: set(effect["joints"]) for effect in verdict["effects"]
    }
    rows = []
    for effect, joints in true_joints.items():
        if not joints:
            continue
        stated = stated_joints.get(effect, set())
        outcome = _compare_joints(joints, stated)
        rows.append(
            {
                "case": truth["campaign"],
                "group": case["group"],
                "robot": case["robot"],
                "setting": case["setting"],
                "level": max(case["levels"], default=0.0),
                "effect": effect,
                "true_joints": _join(joints),
                "stated_joints": _join(stated),
                "outcome": outcome,
                "stated": outcome != NOT_STATED,
                "right": outcome == RIGHT,
                "wrong": outcome == WRONG,
            }
        )
    return rows


def _compare_joints(true_joints: set[int], stated_joints: set[int]) -> str:
    if not stated_joints:
        return NOT_STATED
    if stated_joints == true_joints:
        return RIGHT
    return PARTLY if stated_joints & true_joints else WRONG


def _join(joints: set[int]) -> str:
    return "-".join(map(str, sorted(joints)))


def tabulate_locations(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Tabulate rows of `list_locations`; the columns are there without a row, too."""
    return pd.DataFrame(rows, columns=_COLUMNS)


def tabulate_confusion(locations: pd.DataFrame) -> pd.DataFrame:
    """Count by which joint, or link, a verdict states an effect that acts at one.

    Parameters
    ----------
    locations : DataFrame
        Rows of `list_locations`, as they are made or read.

    Returns
    -------
    DataFrame
        One row for each true joint; a column for each stated joint, for several stated
        joints and for none. Rows whose effect acts at several joints are not counted.
    """
    true_joints = locations.true_joints.astype(str)
    single = locations[~true_joints.str.contains("-")]
    stated = single.stated_joints.fillna("").map(_describe_stated)
    counts = pd.crosstab(true_joints[single.index].astype(int), stated)
    joints = sorted(
        {*counts.index.astype(str), *counts.columns}.difference(_NO_JOINT), key=int
    )
    columns = [*joints, *_NO_JOINT]
    counts = counts.reindex(columns=columns, fill_value=0)
    return counts.rename_axis(index="true", columns=None).reset_index()


def _describe_stated(joints: Any) -> str:
    """Describe stated joints by the only one, or as several or none."""
    text = str(joints)
    if not text:
        return NOT_STATED
    if "-" in text:
        return SEVERAL_LOCATIONS
    # A column of numbers with gaps is read as real numbers.
    return str(int(float(text)))
