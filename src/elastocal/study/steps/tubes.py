"""How much the tube of the extended robot matters (interpretation R11): other diameters, the same data sets."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.links import with_tube
from elastocal.study.identification import estimate_compliance
from elastocal.study.metrics import mean_form, mean_square_errors
from elastocal.study.strategies import all_at_once

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.study.steps.in_memory import StudyInMemory


def tube_blocks(study: StudyInMemory, factors: Sequence[float], length: int) -> Iterator[dict[str, np.ndarray]]:
    """Deflection before calibration and what joints alone leave, for each diameter.

    `study`: of a robot with links, all of one tube. `factors`: by which the diameter is another one. `length`: configurations
    from which the compliances of the joints are identified. Yields columns of one block of the tubes table: one diameter.
    """
    tube, point = study.robot.links[0].tube, study.robot.chain.end_effector.name
    n, sets = study.robot.joints, np.arange(study.size.data_sets)
    drawn, strategy = study.experiments(sets), all_at_once((point,), n)
    for factor in factors:
        diameter = factor * tube.outer_diameter_m
        other = replace(study, robot=with_tube(study.robot, replace(tube, outer_diameter_m=diameter)))
        size = np.linalg.norm(other.deflections(drawn)[..., :3], axis=-1)
        short = replace(other, size=replace(study.size, configurations=length))
        compliance = estimate_compliance(strategy, short.measure(sets, (point,)), n)[0][-1]
        yield {
            "diameter": np.full(len(sets), diameter),
            "data_set": sets,
            "mean": size.mean(axis=1),
            "mean_square": (size**2).mean(axis=1),
            "maximum": size.max(axis=1),
            "left": mean_square_errors(mean_form(other.judge()), compliance - other.robot.compliance[:, None]),
        }
