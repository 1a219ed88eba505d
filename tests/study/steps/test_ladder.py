"""The ladder of models on few data sets of a robot whose links yield."""

import numpy as np
import pandas as pd
from made_studies import few_of
from made_study_blocks import compliances, deflections_of, experiments_of, identified, judge

from elastocal.study.metrics import position_errors
from elastocal.study.steps.ladder import ladder_blocks


def test_the_ladder_of_a_robot_with_elastic_links_falls_and_flattens(kuka_extended):
    blocks = list(ladder_blocks(few_of(kuka_extended), lengths=[10, 20], noises=[1e-6]))
    assert [(block["length"][0], len(block["length"])) for block in blocks] == [(10, 36), (20, 36)]
    table = pd.DataFrame(blocks[1])
    rms = np.sqrt(table.groupby("link_springs").mean_square.mean())
    # Joints alone leave tenths of a millimetre, all springs what linearisation leaves.
    assert rms[0] > 1e-4 and rms[5] < 0.1 * rms[0]
    assert (table.groupby("data_set").chosen.sum() == 1).all()
    assert (table[table.link_springs == 0].added_link == 0).all()
    assert sorted(table[(table.data_set == 0) & (table.link_springs > 0)].added_link) == [1, 2, 3, 4, 5]


def test_joints_alone_leave_what_the_reduced_model_leaves(kuka_extended, strategies):
    """The first rung is equation 11 with poses of the end-effector."""
    experiments = experiments_of(kuka_extended, 6, 20)
    table = identified(kuka_extended, strategies["6DoF"], experiments, deflections_of(kuka_extended, experiments))
    expected = (position_errors(judge(kuka_extended), compliances(table, 20)) ** 2).mean(axis=1)
    (block,) = ladder_blocks(few_of(kuka_extended), lengths=[20], noises=[0.0])
    # The judge predicts with exact kinematics, the ladder by the linear equation: percents of a percent.
    np.testing.assert_allclose(block["mean_square"][block["link_springs"] == 0], expected, rtol=0.02)
