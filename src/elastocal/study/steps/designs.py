"""Which configurations (RQ3): random against optimal ones, measured at the end-effector."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.random_streams import stream
from elastocal.study.designs import rate_designs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.study.steps.in_memory import StudyInMemory

# Interpretation R3 both ways: a robot on the floor cannot turn its joints fully.
JOINT_RANGES = ("full_turn", "limits")


def design_worths(study: StudyInMemory, candidates: int, sizes: Sequence[int]) -> dict[str, np.ndarray]:
    """Random against optimal configurations, measured at the end-effector.

    `candidates`: random configurations among which is chosen. `sizes`: configurations of a design. Returns columns joint_range:
    of candidates and validation configurations, design, configurations, rms, low and high (m).
    """
    found, ranges = [], []
    for joint_range in JOINT_RANGES:
        within = study.under(joint_range=joint_range)
        drawn = within.experiments([0], candidates, "candidates of designs")
        rows = study.robot.compliance / study.size.noise * within.regressor(drawn)[0, :, : study.interpretation.rows]
        accuracy = study.robot.compliance * within.regressor(within.tests())[0, :, :3]
        some = rate_designs(rows, accuracy, sizes, stream(study.seed, study.key, "random designs", 0))
        found += some
        ranges += [joint_range] * len(some)
    return {
        "joint_range": np.array(ranges, object),
        "design": np.array([worth.kind for worth in found], object),
        "configurations": np.array([worth.configurations for worth in found]),
        **{name: np.array([getattr(worth, name) for worth in found]) for name in ("rms", "low", "high")},
    }
