"""Scores of further studies, made up, and a few from the study's own steps."""

import pandas as pd
from made_metrics import LENGTHS
from made_study_blocks import PAPER

from elastocal.study.evaluation import repeated_blocks
from elastocal.study.in_memory import Interpretation, Size, StudyInMemory

USUAL = Interpretation(PAPER, 6, "end_effector", "stiffness")
SIZE = Size(data_sets=4, configurations=5, tests=30, noise=1e-5)


def studies_of(robot="arm", strategy="A", biases=(20.0, 22.0, 24.0)):
    """Studies whose k_sigma and deviation fall as bias / length: percent and µm."""
    parts = []
    for number, bias in enumerate(biases, 1):
        frame = pd.DataFrame({"robot": robot, "study": number, "strategy": strategy, "length": LENGTHS})
        frame["k_sigma"], frame["k_sigma_fixed_joints"] = bias / LENGTHS, 0.5 * bias / LENGTHS
        frame["deviation"], frame["compliance_1"] = 1e-6 * bias / LENGTHS, 1e-6 * bias
        parts.append(frame)
    return pd.concat(parts, ignore_index=True)


def blocks_of(robot, strategies, interpretation=USUAL, size=SIZE, studies=(1, 2)):
    return list(repeated_blocks(StudyInMemory(robot, "kuka", 1, interpretation, size), studies, strategies))


def few_of(robot, key="kuka"):
    """A study of six data sets of 20 configurations."""
    return StudyInMemory(robot, key, 1, USUAL, Size(data_sets=6, configurations=20, tests=30, noise=1e-5))
