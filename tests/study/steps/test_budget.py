"""Sets of points in memory: against the pipeline's estimates and bounds of the same data sets."""

import numpy as np
import pytest
from made_studies import USUAL
from made_study_blocks import deflections_of, experiments_of, identified, judge

from elastocal.study.metrics import position_errors
from elastocal.study.steps.bound import bound_blocks
from elastocal.study.steps.budget import budget_blocks
from elastocal.study.steps.in_memory import Size, StudyInMemory

POINT_SETS = {"6DoF": ["6DoF"], "6DoF twice": ["6DoF", "6DoF"], "3+6DoF": ["3DoF", "6DoF"]}
SIZE = Size(data_sets=40, configurations=6, tests=30, noise=1e-5)


@pytest.fixture(scope="module")
def found(kuka):
    blocks = list(budget_blocks(StudyInMemory(kuka, "kuka", 1, USUAL, SIZE), POINT_SETS))
    return {block["points"]: {name: block[name].reshape(40, 6) for name in ("mean_square", "bound")} for block in blocks}


@pytest.mark.parametrize(("points", "strategy"), [("6DoF", "6DoF"), ("3+6DoF", "3+6DoF-comb")])
def test_errors_are_those_of_the_strategy_that_measures_the_points_together(kuka, strategies, found, points, strategy):
    experiments = experiments_of(kuka, 40, 6)
    table = identified(kuka, strategies[strategy], experiments, deflections_of(kuka, experiments, 1e-5))
    models = np.column_stack([table[f"c{j}"] for j in range(1, 7)])[table["length"] == 6]
    expected = (position_errors(judge(kuka), models) ** 2).mean(axis=1)
    np.testing.assert_allclose(found[points]["mean_square"][:, 5], expected, rtol=1e-6)


def test_bounds_are_those_of_the_pipeline(kuka, found):
    sets = [("6DoF",), ("3DoF", "6DoF")]
    blocks = bound_blocks(experiments_of(kuka, 40, 6), kuka.chain, sets, 6, "end_effector", judge(kuka))
    expected = {block["points"]: block["rms_per_noise"] for block in blocks}
    for ours, theirs in (("6DoF", "6DoF"), ("3+6DoF", "3DoF+6DoF")):
        np.testing.assert_allclose(np.sqrt(found[ours]["bound"].mean(axis=0))[2:], 1e-5 * expected[theirs][2:], rtol=1e-8)


def test_a_point_measured_twice_has_half_the_variance_and_noise_of_its_own(found):
    np.testing.assert_allclose(found["6DoF twice"]["bound"], found["6DoF"]["bound"] / 2, rtol=1e-9)
    ratio = found["6DoF twice"]["mean_square"][:, 5] / found["6DoF"]["mean_square"][:, 5]
    # 40 data sets: the mean of the ratio of means has an error of about 15 %.
    assert (ratio.std() > 0.1) and 0.3 < (
        found["6DoF twice"]["mean_square"][:, 5].mean() / found["6DoF"]["mean_square"][:, 5].mean()
    ) < 0.8
