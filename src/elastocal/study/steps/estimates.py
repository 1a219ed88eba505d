"""Compliances of a study in memory, by several strategies from the same measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.strategies import Stage, Strategy, drop_forgotten_stages

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.study.steps.in_memory import StudyInMemory


def estimates(study: StudyInMemory, strategies: Sequence[Strategy], number: int = 0) -> dict[str, list[np.ndarray]]:
    """Estimates of all data sets of a study, block by block.

    `strategies`: those that are one estimator under equation 11 are worked out once and share their arrays. `number`: of the
    study. Returns (sets, lengths, n): by the names of the strategies; rad/(N m), not a number where a length does not determine
    them.
    """
    stages = {strategy.name: drop_forgotten_stages(strategy, study.robot.joints).stages for strategy in strategies}
    points = tuple(dict.fromkeys(name for some in stages.values() for stage in some for name in stage.points))
    found: dict[tuple[Stage, ...], list[np.ndarray]] = {}
    for sets in study.blocks(number):
        measurements = study.measure(sets, points)
        for estimator in dict.fromkeys(stages.values()):
            compliance = study.estimate(Strategy("", estimator), measurements)
            found.setdefault(estimator, []).append(np.moveaxis(compliance, -1, 0))
    return {name: found[estimator] for name, estimator in stages.items()}
