"""Which poses a method predicts without having seen them: the same for every method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.holdout import measured_poses
from elastocal.campaigns.joint_space import blocks_of_poses, configurations

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elastocal.campaigns.campaign import Measurements

RANDOM, BLOCKS, SESSION = "random", "blocks", "session"
# Of one data set's own poses; a session is another data set of the same robot.
WITHIN = (RANDOM, BLOCKS)
SPLITS = (*WITHIN, SESSION)


def dealt(measurements: Measurements, count: int, draws: np.random.Generator) -> dict[str, np.ndarray]:
    """Deal poses into folds, those of a configuration into one, at random and by blocks of joint space.

    Random folds have neighbours among the poses fitted, so they ask how well a method interpolates; blocks of joint space ask
    how well it extrapolates [1].

    `count`: of folds. Returns columns: ``session`` and ``pose`` (P,), and of each split the fold (P,), from 1.

    [1] Roberts, D. R. et al., Cross-validation strategies for data with temporal, spatial, hierarchical, or phylogenetic
        structure, Ecography 40, 2017.
    """
    pairs, index = measured_poses(measurements)
    configuration = configurations(measurements.joint_angles, index)
    return {
        "session": pairs[:, 0],
        "pose": pairs[:, 1],
        RANDOM: draws.permutation(configuration.max() + 1)[configuration] % count + 1,
        BLOCKS: blocks_of_poses(measurements.joint_angles, index, count) + 1,
    }


def fold_of_each(measurements: Measurements, split: str, dealt_out: Mapping[str, np.ndarray]) -> np.ndarray:
    """Fold of each measurement, ndarray of int (N,); `dealt_out` as by `dealt`, of the same measurements."""
    return np.asarray(dealt_out[split])[measured_poses(measurements)[1]]
