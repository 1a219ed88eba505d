"""Effects that no command contains, at the poses that are asked."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import make_calibrated_robot, plain_model
from scipy.linalg import block_diag
from synthetic import make_states

from elastocal.application.accuracy import predict_errors
from elastocal.application.scope import determine_scope
from elastocal.effects.catalogue import candidates_on
from elastocal.mechanics.kinematics import compute_jacobians
from elastocal.mechanics.sites import build_sites

HALF_WIDTH_RAD = 4e-4
STATES = replace(make_states(6, 60), wrench=np.zeros((60, 6)))


@pytest.fixture(scope="module")
def calibrated(fanuc):
    """A robot that is commanded without the hysteresis of its first two joints."""
    candidates = candidates_on(build_sites(fanuc))
    chosen = [candidates["hysteresis@1"], candidates["hysteresis@2"]]
    calibrated = make_calibrated_robot(fanuc, "joint_offset@3", relative_std=1e-4)
    model = plain_model(fanuc, "joint_offset@3")
    model = replace(model, effects=(*calibrated.model.effects, *chosen))
    estimate = replace(
        calibrated.estimate,
        coefficients=(
            *calibrated.estimate.coefficients,
            *2 * [np.array([HALF_WIDTH_RAD])],
        ),
        shapes=(*calibrated.estimate.shapes, *2 * [np.zeros(0)]),
    )
    covariance = block_diag(calibrated.covariance, np.zeros((2, 2)))
    scope = determine_scope(calibrated, model, estimate, covariance, STATES)
    return replace(calibrated, scope=scope, fitted=STATES)


def compute_branches(calibrated, angles):
    """Displacements (N, 4, 3) by both joints, approached from either side."""
    chain = calibrated.robot.chain
    jacobian = compute_jacobians(chain, angles, chain.end_effector)[:, :3]
    sides = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    return HALF_WIDTH_RAD * np.einsum("nij,kj->nki", jacobian[:, :, :2], sides)


def test_a_bound_follows_the_jacobian_of_the_pose_and_holds_for_either_side(calibrated):
    angles = STATES.joint_angles
    commands = calibrated.robot.reported_angles(angles)
    predicted = predict_errors(calibrated, commands, STATES.wrench, draws=0)
    lengths = np.linalg.norm(compute_branches(calibrated, angles), axis=2)
    expected_m = np.sqrt((lengths**2).mean(axis=1))
    np.testing.assert_allclose(predicted.left_out_m, expected_m, rtol=0.02)
    assert predicted.left_out_m.max() > 1.4 * predicted.left_out_m.min()
    held = lengths <= predicted.bound_m[:, None]
    assert held.mean() > 0.93
    assert predicted.bound_m.mean() < 1.2 * lengths.max(axis=1).mean()
