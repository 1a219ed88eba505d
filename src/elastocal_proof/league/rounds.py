"""A data set of the league from its files, and training and held-out poses of each of its folds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.columns import measurements_from
from elastocal.fitting.case import Case, case_from
from elastocal.io.json_files import read_json
from elastocal.io.storage import read_table
from elastocal.loop.schemas import measurements
from elastocal.mechanics.robot_file import joint_count
from elastocal_proof.league.folds import SESSION, fold_of_each
from elastocal_proof.league.schemas import FOLDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path
    from typing import Any

    Columns = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class DataSet:
    """A data set of the league as its tables hold it.

    `descriptions`: as `loading.load_campaign` gives them. `columns` (N,): of all measurements. `dealt` (P,): as by
    `folds.dealt`.
    """

    descriptions: Mapping[str, Any]
    columns: Columns
    dealt: Columns

    def case(self, chosen: np.ndarray | None = None) -> Case:
        """A case of some of the measurements, ndarray of bool (N,), or of all."""
        kept = self.columns if chosen is None else {name: values[chosen] for name, values in self.columns.items()}
        return case_from(self.descriptions, kept)


def load_data_set(descriptions_path: str | Path, measurements_path: str | Path, folds_path: str | Path) -> DataSet:
    """Read a data set from files as `deal_league_folds` wrote them."""
    descriptions = read_json(descriptions_path)
    joints = joint_count(descriptions["robot"], descriptions["source"])
    return DataSet(descriptions, read_table(measurements_path, measurements(joints)), read_table(folds_path, FOLDS))


def training_rounds(split: str, data: DataSet) -> Iterator[tuple[int, Case]]:
    """Training poses of each fold.

    `split`: one of `folds.SPLITS`. Yields `fold`: from 1; the only one where another data set is the test.
    """
    if split == SESSION:
        yield 1, data.case()
        return
    fold = fold_of_each(measurements_from(data.columns), split, data.dealt)
    for number in np.unique(fold):
        yield int(number), data.case(fold != number)


def held_out_rounds(split: str, data: DataSet, others: Sequence[DataSet]) -> Iterator[tuple[int, list[Case]]]:
    """Held-out poses of each fold.

    `others`: of the same robot, the test where `split` is by session. Yields `fold`: as by `training_rounds`.
    """
    if split == SESSION:
        yield 1, [other.case() for other in others]
        return
    fold = fold_of_each(measurements_from(data.columns), split, data.dealt)
    for number in np.unique(fold):
        yield int(number), [data.case(fold == number)]
