"""Data sets of the league from their files, and which poses a method predicts without having seen them: the same for all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.campaigns.columns import columns_of, measurements_from
from elastocal.campaigns.holdout import measured_poses
from elastocal.campaigns.joint_space import blocks_of_poses, configurations
from elastocal.fitting.model import Case, case_from
from elastocal.io.json_files import read_json, write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import read_table, write_table
from elastocal.loop.loading import load_whole_campaign
from elastocal.loop.schemas import measurements
from elastocal.mechanics.robot_file import joint_count
from elastocal.random_streams import stream
from elastocal_proof.league.schemas import FOLDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from elastocal.campaigns.campaign import Measurements

    Columns = Mapping[str, np.ndarray]

RANDOM, BLOCKS, SESSION = "random", "blocks", "session"


@dataclass(frozen=True)
class DataSet:
    """A data set of the league as its tables hold it.

    `descriptions`: as `loading.load_campaign` gives them. `columns` (N,): of all measurements. `dealt` (P,): as by `dealt`.
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


def dealt(seen: Measurements, count: int, draws: np.random.Generator) -> dict[str, np.ndarray]:
    """Deal poses into folds, those of a configuration into one, at random and by blocks of joint space.

    Random folds have neighbours among the poses fitted, so they ask how well a method interpolates; blocks of joint space ask
    how well it extrapolates [1].

    `count`: of folds. Returns columns: ``session`` and ``pose`` (P,), and of each split the fold (P,), from 1.

    [1] Roberts, D. R. et al., Cross-validation strategies for data with temporal, spatial, hierarchical, or phylogenetic
        structure, Ecography 40, 2017.
    """
    pairs, index = measured_poses(seen)
    configuration = configurations(seen.joint_angles, index)
    return {
        "session": pairs[:, 0],
        "pose": pairs[:, 1],
        RANDOM: draws.permutation(configuration.max() + 1)[configuration] % count + 1,
        BLOCKS: blocks_of_poses(seen.joint_angles, index, count) + 1,
    }


def rounds(split: str, data: DataSet, others: Sequence[DataSet] = ()) -> Iterator[tuple[int, Case, list[Case]]]:
    """Number, from 1, training poses, and held-out poses of each fold.

    `split`: `RANDOM`, `BLOCKS`, or `SESSION`, by which all other data sets of the same robot are the test.
    """
    if split == SESSION:
        yield 1, data.case(), [other.case() for other in others]
        return
    fold = np.asarray(data.dealt[split])[measured_poses(measurements_from(data.columns))[1]]
    for number in np.unique(fold):
        yield int(number), data.case(fold != number), [data.case(fold == number)]


def deal_league_folds(job: Any) -> None:
    """A data set of the league, checked, with its poses dealt into folds."""
    descriptions, seen = load_whole_campaign(job.params.folder, job.params.robots)
    origin = provenance(job.params, **job.wildcards)
    draws = stream(job.params.seed, job.wildcards.data, "league folds", 0)
    write_table(job.output.measurements, measurements(seen.joint_angles.shape[1]), [columns_of(seen)], origin)
    write_table(job.output.folds, FOLDS, [dealt(seen, job.params.folds, draws)], origin)
    write_json(job.output.descriptions, descriptions)
