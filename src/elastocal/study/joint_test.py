"""All printed figures at once: does the paper lie among studies of its size?

Figures of one study move together, so that neither how many lie outside nor the product of their p values has a known
distribution. Each further study is therefore judged by all others as the paper is by all: by how many figures have p below the
level, and by Fisher's statistic -2 sum ln p [1]. The rank of the paper among the studies is a p value without assumptions about
how figures depend on one another [2]; of k studies it is no smaller than 1/(k + 1).

[1] Fisher, R. A., Statistical Methods for Research Workers, Oliver and Boyd, 1932.
[2] Barnard, G. A., discussion of The spectral analysis of point processes, Journal of the Royal Statistical Society B 25, 1963.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from elastocal.study.printed import LEVEL, Predicted, holm, predict_scatter


def joint_table(studies: pd.DataFrame, reference: pd.DataFrame, length: int) -> pd.DataFrame:
    """The joint test under both counts of joints in k_sigma (R10).

    `studies`: robot and the columns of `table_schemas.repeated`. `reference`: the printed figures, of which those of Tables 3
    and 4 are judged. `length`: data set length of figures that name none. Returns joints (fixed joints or all joints), cells,
    differ (after Holm's correction), below (p below the level), statistic (Fisher's); of the last two the median and the
    largest of the studies (`..._studies_median`, `..._studies_largest`) and the p value (`..._p`); studies.
    """
    printed = reference[reference.table.isin(["3", "4"])]
    return pd.DataFrame([_row(studies, printed, length, fixed) for fixed in (True, False)])


def _row(studies: pd.DataFrame, printed: pd.DataFrame, length: int, fixed_joints: bool) -> dict[str, Any]:
    cells = printed[["robot", "strategy", "quantity"]].itertuples(index=False, name=None)
    found = [
        (scatter, value)
        for (robot, strategy, quantity), value in zip(cells, printed.value, strict=True)
        if (scatter := predict_scatter(studies, robot, strategy, quantity, length, fixed_joints)) is not None
    ]
    paper = np.array([scatter.p_value(value) for scatter, value in found])
    others = np.array([_judge_by_others(scatter) for scatter, _ in found]).T
    row: dict[str, Any] = {"joints": "fixed joints" if fixed_joints else "all joints", "cells": len(paper)}
    if not found:
        paper, others = np.full(1, np.nan), np.full((1, 1), np.nan)
    row |= {"differ": int((holm(paper) < LEVEL).sum()), "studies": len(others)}
    row |= _rank("below", int((paper < LEVEL).sum()), (others < LEVEL).sum(axis=1))
    return row | _rank("statistic", float(-2 * np.log(paper).sum()), -2 * np.log(others).sum(axis=1))


def _judge_by_others(scatter: Predicted) -> list[float]:
    """p value of each study by the others."""
    some = scatter.values  # noqa: PD011 (of a dataclass)
    printed = np.exp(some) if scatter.logarithmic else some
    return [others.p_value(value) for others, value in zip(scatter.leave_out_each(), printed, strict=True)]


def _rank(name: str, value: float, others: np.ndarray | Sequence[float]) -> dict[str, float]:
    others = np.asarray(others)
    row = {name: value, f"{name}_studies_median": float(np.median(others)), f"{name}_studies_largest": float(others.max())}
    return row | {f"{name}_p": (1 + int((others >= value).sum())) / (1 + len(others))}
