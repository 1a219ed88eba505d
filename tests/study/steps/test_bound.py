"""Cramér-Rao bounds of the strategies, against estimators and dense linear algebra."""

import numpy as np
import pytest
from made_study_blocks import OFFSET, experiments_of, judge, pinocchio_regressors

from elastocal.mechanics.elastostatics import joint_torques
from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.mechanics.robot import with_target_offset
from elastocal.study.metrics import error_moment
from elastocal.study.steps import blocks
from elastocal.study.steps.bound import bound_blocks
from elastocal.study.steps.columns import to_experiments


def test_bounds_of_a_target_off_the_flange_are_those_of_a_load_at_the_flange(kuka):
    moved, experiments = with_target_offset(kuka, OFFSET), experiments_of(kuka)
    scores, loads = judge(kuka), to_experiments(experiments[0])
    (found,) = bound_blocks(experiments, moved.chain, [("6DoF",)], 6, "end_effector", scores)
    torques = joint_torques(kuka.chain, loads.joint_angles, loads.wrench, kuka.chain.end_effector)
    rows = poses_and_jacobians(moved.chain, loads.joint_angles, moved.chain.end_effector)[2] * torques[..., None, :]
    bounds = [np.trace(error_moment(scores) @ np.linalg.inv(np.einsum("kri,krj->ij", one, one))) for one in rows]
    assert found["rms_per_noise"][-1] == pytest.approx(np.sqrt(np.mean(bounds)), rel=1e-6)


def test_the_bound_is_the_root_mean_square_over_the_data_sets_of_all_blocks(kuka, monkeypatch):
    monkeypatch.setattr(blocks, "SETS_PER_BLOCK", 2)
    experiments, scores = experiments_of(kuka, sets=3), judge(kuka)
    (found,) = bound_blocks(experiments, kuka.chain, [("3DoF", "6DoF")], 6, "end_effector", scores)
    assert len(experiments) == 2 and found["length"].tolist() == [1, 2, 3, 4]
    moment, squares = error_moment(scores), []
    for block in experiments:
        parts = [pinocchio_regressors(kuka.chain, block, name).reshape(-1, 4, 6, 6) for name in ("3DoF", "6DoF")]
        for number in range(len(parts[0])):
            matrices = [np.concatenate([part[number, :length].reshape(-1, 6) for part in parts]) for length in (1, 2, 3, 4)]
            squares.append([np.trace(moment @ np.linalg.inv(matrix.T @ matrix)) for matrix in matrices])
    np.testing.assert_allclose(found["rms_per_noise"], np.sqrt(np.mean(squares, axis=0)), rtol=1e-6)


def test_positions_on_the_last_axis_never_bound_its_joint(kuka):
    """The flange lies on the axis of joint 6, so that no position of it shows that joint's compliance."""
    (found,) = bound_blocks(experiments_of(kuka), kuka.chain, [("6DoF",)], 3, "end_effector", judge(kuka))
    assert np.isinf(found["rms_per_noise"]).all()
