"""Cross-validation over blocks of joint space and over sessions: how far a model carries, from the training poses alone.

Poses drawn at random have neighbours among those fitted, so their errors say how well a model interpolates; whole blocks of
joint space left out say how well it extrapolates (block cross-validation [1]). The effects stay those that were chosen with
all training poses: what is refitted is their size, so the errors carry the selection's optimism.

[1] Roberts, D. R. et al., Cross-validation strategies for data with temporal, spatial, hierarchical, or phylogenetic structure,
    Ecography 40, 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.holdout import FEWEST_TRAINING_POSES
from elastocal.campaigns.joint_space import blocks_of_poses, configurations
from elastocal.fitting.observations import state_clusters
from elastocal.validation.held_out import Errors, intervals, position_errors, summary
from elastocal.validation.left_out import refits

if TYPE_CHECKING:
    from typing import Any

    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.observations import Observations, States

# A quarter of the poses is about the share that campaigns hold out at random, so that both errors come from as many poses.
JOINT_SPACE_BLOCKS = 4


@dataclass(frozen=True)
class Split:
    """A partition of the states of observations.

    `labels`: name of each part. `part` (S,) of int: index into `labels`, of every state.
    """

    name: str
    labels: tuple[int, ...]
    part: np.ndarray


def splits_of(states: States) -> list[Split]:
    """The partitions that some states allow: blocks of joint space and, where there are several, sessions.

    Returns without those that leave too few configurations to fit.
    """
    pose = state_clusters(states)
    configuration = configurations(states.joint_angles, pose)[pose]
    sessions, session = np.unique(states.session, return_inverse=True)
    found = [Split("session", tuple(sessions.tolist()), session.ravel())] if len(sessions) > 1 else []
    if configuration.max() + 1 >= JOINT_SPACE_BLOCKS:
        labels = tuple(range(1, JOINT_SPACE_BLOCKS + 1))
        found.insert(0, Split("joint space", labels, blocks_of_poses(states.joint_angles, pose, JOINT_SPACE_BLOCKS)[pose]))
    return [split for split in found if _fewest_left(split, configuration) >= FEWEST_TRAINING_POSES]


def cross_validated(fitted: Fit, observations: Observations, part: np.ndarray) -> Errors:
    """Position errors of observations, each predicted by a refit without the part that it belongs to.

    Leave-one-block-out cross-validation, see `left_out.refits`.

    `fitted`, `observations`, `part`: as in `left_out.refits`.
    """
    distance = np.empty(len(observations))
    for refit in refits(fitted, observations, part):
        errors = position_errors(fitted.model, refit.there, refit.left_out)
        distance[refit.within[observations.state]] = errors.distance
    return Errors(distance, observations.cluster)


def split_rows(
    declared: Fit, final: Fit, observations: Observations, replicates: int, stream: np.random.Generator
) -> list[dict[str, Any]]:
    """Cross-validated errors of the declared and the final model over every split that the training poses allow.

    `observations`: training poses, which both were fitted to. `replicates`: of the bootstrap over poses. Returns rows of
    splits.csv: each part of each split, and "all" parts together. Intervals take poses as independent, which refits that share
    most of their poses make only nearly true [1].

    [1] Bengio, Y. and Grandvalet, Y., No unbiased estimator of the variance of K-fold cross-validation, Journal of Machine
        Learning Research 5, 2004.
    """
    rows = []
    for split in splits_of(observations.states):
        before = cross_validated(declared, observations, split.part)
        after = before if final is declared else cross_validated(final, observations, split.part)
        rows.append(error_row(split.name, "all", before, after, replicates, stream))
        of_each = split.part[observations.state]
        for number, label in enumerate(split.labels):
            pair = _part(before, of_each == number), _part(after, of_each == number)
            rows.append(error_row(split.name, label, *pair, replicates, stream))
    return rows


def error_row(
    split: str, block: str | int, before: Errors, after: Errors, replicates: int, stream: np.random.Generator
) -> dict[str, Any]:
    """One row of splits.csv."""
    limits, reductions = intervals([before, after], replicates, stream)
    row: dict[str, Any] = {"split": split, "block": block, "poses": before.poses}
    rms = [summary(errors.distance)["rms_m"] for errors in (before, after)]
    for stage, value, limit in zip(("before", "after"), rms, limits, strict=True):
        row |= {f"{stage}_rms_m": value, f"{stage}_rms_m_low": limit["rms_m"][0], f"{stage}_rms_m_high": limit["rms_m"][1]}
    change = reductions[1]
    row |= {"reduction": 1.0 - rms[1] / rms[0], "reduction_low": change.low, "reduction_high": change.high}
    return row | {"reduction_std_error": change.std_error}


def _fewest_left(split: Split, configuration: np.ndarray) -> int:
    return min(len(np.unique(configuration[split.part != number])) for number in range(len(split.labels)))


def _part(errors: Errors, mask: np.ndarray) -> Errors:
    return Errors(errors.distance[mask], np.unique(errors.cluster[mask], return_inverse=True)[1])
