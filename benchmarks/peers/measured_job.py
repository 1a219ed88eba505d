"""The job that each package gets: measured arrays of a UR5, and a nominal URDF.

A script of a package has a function `predict`, whose lines `run.py` counts.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent
URDF = str(FOLDER / "ur5.urdf")
# Names the file of arrays that `run.py` has written.
VARIABLE = "ELASTOCAL_PEERS_JOB"


@dataclass(frozen=True)
class Job:
    """Poses to fit and poses to predict, in the order in which they were measured.

    Attributes
    ----------
    all_q : (P, 6) array
        Joint angles, rad.
    all_x : (P, 3) array
        Measured positions of the reflector, m.
    is_held_out : (P,) bool array
        Poses to predict.
    """

    all_q: np.ndarray
    all_x: np.ndarray
    is_held_out: np.ndarray

    @property
    def q(self) -> np.ndarray:
        """Joint angles (N, 6) to fit, rad."""
        return self.all_q[~self.is_held_out]

    @property
    def x(self) -> np.ndarray:
        """Positions (N, 3) to fit, m."""
        return self.all_x[~self.is_held_out]

    @property
    def held_out_q(self) -> np.ndarray:
        """Joint angles (H, 6) at which positions are predicted, rad."""
        return self.all_q[self.is_held_out]

    @property
    def held_out_x(self) -> np.ndarray:
        """Positions (H, 3) that judge the prediction, m."""
        return self.all_x[self.is_held_out]


def load_job() -> Job:
    """Load the arrays that `run.py` has written."""
    with np.load(os.environ[VARIABLE]) as arrays:
        return Job(**arrays)


def run(predict: Callable[[Job], np.ndarray]) -> None:
    """Print the errors of predicted positions (H, 3), m, and the CPU time of the
    process, s."""
    job = load_job()
    errors_m = np.linalg.norm(predict(job) - job.held_out_x, axis=1)
    print_result({"errors_m": errors_m.tolist()})


def print_result(result: dict[str, object]) -> None:
    """Print a result with the CPU time of the process so far, s."""
    print(json.dumps(result | {"cpu_s": time.process_time()}))
