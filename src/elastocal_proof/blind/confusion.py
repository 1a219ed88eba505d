"""Confusion matrix: ground truth against verdict, as counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from elastocal.diagnosis.verdict import ADEQUATE, CLASS, NAMED, NOT_TESTABLE, SEVERAL, UNEXPLAINED
from elastocal.effects.catalogue import effects
from elastocal_proof.blind.cases import GEAR_GRAVITY, MOVED, SEVERAL_JOINTS, UNDECLARED

if TYPE_CHECKING:
    from collections.abc import Collection

PAIR = "pair"
# Groups of which the settings are a column of their own: their cases are of another kind than a single effect's.
_APART = ("sweep", SEVERAL_JOINTS, GEAR_GRAVITY, MOVED, UNDECLARED)
CLASS_WITH, CLASS_WITHOUT = "class with the truth", "class without the truth"
FAULT = "named: fault of the data"
WORDS = (CLASS_WITH, CLASS_WITHOUT, SEVERAL, UNEXPLAINED, NOT_TESTABLE, ADEQUATE)


def confused(cases: pd.DataFrame) -> pd.DataFrame:
    """Ground truth against verdict.

    `cases`: of `case_rows.case_row`. Returns one row for each kind of robots, settings (usual, hard, or a group of its own such
    as a sweep), truth and level; one column for each name of the catalogue stated alone and for each other verdict, all of them
    always there: every row adds up to its cases.
    """
    names = [*effects()]
    entries = zip(cases["verdict"], cases["found"], cases["holds_truth"], strict=True)
    verdicts = [_column(verdict, found, holds_truth, names) for verdict, found, holds_truth in entries]
    setting = cases.setting.where(cases.setting == "usual", "hard").where(~cases.group.isin(_APART), cases.group)
    truth = cases.truth.where(cases.group != PAIR, PAIR)
    table = pd.crosstab([cases.robots, setting, truth, cases.level], pd.Series(verdicts, cases.index, name="stated"))
    return table.reindex(columns=[*names, FAULT, *WORDS], fill_value=0).reset_index().rename(columns={"setting": "settings"})


def _column(verdict: str, found: str, holds_truth: bool, names: Collection[str]) -> str:
    if verdict == NAMED:
        return found if found in names else FAULT
    if verdict == CLASS:
        return CLASS_WITH if holds_truth else CLASS_WITHOUT
    return verdict
