"""
The paper's Figure 5 in ten lines
=================================

Kozlov and Klimchik ask how many configurations a strategy needs. Figure 5 of their paper
shows the mean position error of the identified model against the length of the data set.
Here are four of the eight strategies on the KUKA at a noise of 200 µm; `make paper` draws
all of them, with intervals and the printed values beside ours.
"""

# %%
# The robot, the strategies and how the paper is interpreted come from the files of the
# study.
import matplotlib.pyplot as plt
import numpy as np
import yaml

import elastocal as ec
from elastocal.command.terminal import find_pipeline
from elastocal.study.in_memory import Interpretation, StudyInMemory, StudySize
from elastocal.study.metrics import compute_mean_deviation
from elastocal.study.simulation import Loading
from elastocal.study.strategies import strategy_from_document

config = find_pipeline() / "config"
robot = ec.read_robot(config / "robots" / "kuka.yaml")
names = ["6DoF", "4-6DoF-after-3DoF", "5-6DoF-after-4DoF", "3+6DoF-comb"]
files = [config / "strategies" / f"{name}.yaml" for name in names]
strategies = [
    strategy_from_document(yaml.safe_load(file.read_text())) for file in files
]
loading = Loading(
    force_N=1000, offset_m=(0, 0.5, 0), offset_frame="base", joint_range="full_turn"
)
how = Interpretation(loading, rows=6, wrench_at="end_effector", average="stiffness")
size = StudySize(data_sets=1000, configurations=100, tests=500, noise=200e-6)

# %%
# Ten lines: simulate the data sets, identify the compliances from the first 1 to 100
# configurations of each, average their stiffnesses over the data sets, and predict the
# deflections at 500 other configurations.
study = StudyInMemory(robot, "kuka", 1, how, size)
tests = study.make_validation_set()
figure, axes = plt.subplots()
for name, blocks in study.estimate_all(strategies).items():
    compliance = 1 / np.mean(1 / np.concatenate(blocks), axis=0)
    deviation = compute_mean_deviation(
        tests, compliance[None], np.ones((1, size.tests))
    )
    axes.semilogy(np.arange(1, size.configurations + 1), 1e6 * deviation[0], label=name)
axes.set(xlabel="configurations in a data set", ylabel="dev, equation 15 (µm)")
axes.set_ylim(0.5, 80)
axes.legend()
plt.show()
