"""Synthetic metrics, replicates and scores of further studies, and small studies in
memory."""

import numpy as np
import pandas as pd
from made_study_blocks import PAPER

from elastocal.study.in_memory import Interpretation, StudyInMemory, StudySize

LENGTHS = np.arange(1, 101)
USUAL = Interpretation(PAPER, 6, "end_effector", "stiffness")
SIZE = StudySize(data_sets=4, configurations=5, tests=30, noise=1e-5)


def studies_of(robot="arm", strategy="A", biases=(20.0, 22.0, 24.0)):
    """Make studies whose k_sigma (percent) and deviation (µm) fall as bias / length."""
    frames = []
    for number, bias in enumerate(biases, 1):
        frame = pd.DataFrame(
            {"robot": robot, "study": number, "strategy": strategy, "length": LENGTHS}
        )
        frame["k_sigma"] = bias / LENGTHS
        frame["k_sigma_fixed_joints"] = 0.5 * bias / LENGTHS
        frame["deviation"] = 1e-6 * bias / LENGTHS
        frame["compliance_1"] = 1e-6 * bias
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def few_of(robot, key="kuka"):
    """Make a study of six data sets of 20 configurations."""
    return StudyInMemory(
        robot,
        key,
        1,
        USUAL,
        StudySize(data_sets=6, configurations=20, tests=30, noise=1e-5),
    )


def metrics_of(strategy, bias=100.0, robot="arm"):
    """Make metrics whose k_sigma (percent) and deviation (µm) fall as bias / length."""
    frame = pd.DataFrame(
        {"robot": robot, "noise_um": 200.0, "strategy": strategy, "length": LENGTHS}
    )
    for name, scale in (
        ("k_sigma", 1.0),
        ("k_sigma_fixed_joints", 0.5),
        ("deviation", 1e-6),
    ):
        frame[name] = scale * bias / LENGTHS
        frame[f"{name}_std_error"] = scale
    frame["initial_deviation"] = 1e-3
    frame["initial_deviation_std_error"] = 1e-5
    return frame


def replicates_of(strategy, bias=100.0, robot="arm", spread=(-0.1, 0.0, 0.1)):
    """Make replicates of metrics, whose biases differ by a relative spread."""
    frames = []
    for number, relative in enumerate(spread, 1):
        frame = metrics_of(strategy, bias * (1 + relative), robot)
        frames.append(frame.assign(replicate=number))
    return pd.concat(frames, ignore_index=True)
