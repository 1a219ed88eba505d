"""A study over again: the scores of all strategies from data sets that no other study has; nothing of these is kept.

How far the scores of studies of one size lie apart tells how far a printed figure may lie from another one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.evaluation import average
from elastocal.study.metrics import k_sigma, mean_form, mean_square_errors, signed_deviation

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from elastocal.mechanics.robot import Robot
    from elastocal.study.steps.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy


def repeated_blocks(
    study: StudyInMemory, studies: Iterable[int], strategies: Sequence[Strategy]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Scores of studies.

    `studies`: their numbers. Yields columns of one block of the repeated table: one strategy in one study.
    """
    robot, read, tests = study.robot, study.interpretation, np.ones((1, study.size.tests))
    for number in studies:
        judge = study.judge(number)
        form, found = mean_form(judge), study.estimates(strategies, number)
        for strategy in strategies:
            blocks = [(compliance, np.ones((1, len(compliance)))) for compliance in found[strategy.name]]
            averages = average(blocks, judge, read.average, read.deviation_of, tests)
            plain = average(blocks, judge, "compliance", "averaged_model", tests)
            scores = score_columns(averages.compliance[0], averages.deviation[0], robot, strategy.fixed_joints)
            others = score_columns(plain.compliance[0], plain.deviation[0], robot, strategy.fixed_joints)
            squares = [mean_square_errors(form, np.moveaxis(each - robot.compliance, 0, -1)) for each, _ in blocks]
            yield {
                **scores,
                **{f"{name}_mean_compliance": others[name] for name in ("k_sigma", "k_sigma_fixed_joints", "deviation")},
                "deviation_signed": signed_deviation(judge, plain.compliance[0]),
                "mean_square": np.concatenate(squares, axis=1).mean(axis=1),
                "study": np.full(len(scores["length"]), number),
                "strategy": strategy.name,
            }


def score_columns(
    compliance: np.ndarray, deviation: np.ndarray, robot: Robot, fixed_joints: Sequence[int]
) -> dict[str, np.ndarray]:
    """Columns of the scores of an averaged model, one row for each length.

    `compliance` (lengths, n): rad/(N m). `deviation` (lengths,): m.
    """
    return {
        "length": np.arange(1, len(compliance) + 1),
        **{f"compliance_{j + 1}": compliance[:, j] for j in range(compliance.shape[1])},
        "k_sigma": k_sigma(compliance, robot.compliance),
        "k_sigma_fixed_joints": k_sigma(compliance, robot.compliance, list(fixed_joints)),
        "deviation": deviation,
    }
