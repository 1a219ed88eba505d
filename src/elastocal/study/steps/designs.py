"""Which configurations (RQ3): random against optimal ones, measured at the end-effector."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.random_streams import stream
from elastocal.study.designs import worths

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.study.steps.in_memory import StudyInMemory


def design_worths(study: StudyInMemory, candidates: int, sizes: Sequence[int]) -> dict[str, np.ndarray]:
    """Random against optimal configurations, measured at the end-effector.

    Parameters
    ----------
    study : StudyInMemory
    candidates : int
        Random configurations among which is chosen.
    sizes : sequence of int
        Configurations of a design.

    Returns
    -------
    dict of str to ndarray
        Columns design, configurations, rms, low and high (m).
    """
    scaled = study.robot.compliance / study.size.noise
    drawn = study.experiments([0], candidates, "candidates of designs")
    rows = scaled * study.regressor(drawn)[0, :, : study.interpretation.rows]
    accuracy = study.robot.compliance * study.regressor(study.tests())[0, :, :3]
    found = worths(rows, accuracy, sizes, stream(study.seed, study.key, "random designs", 0))
    return {
        "design": np.array([worth.kind for worth in found], object),
        "configurations": np.array([worth.configurations for worth in found]),
        **{name: np.array([getattr(worth, name) for worth in found]) for name in ("rms", "low", "high")},
    }
