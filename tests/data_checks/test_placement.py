"""Measurements beside the nominal robot: frames and targets by the measurements that
agree, and the sizes of distances."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import POINTS, Plan, make_campaign, replace_measured_columns
from scipy.spatial.transform import Rotation
from support import PinocchioPoint

from elastocal.data_checks.placement import (
    place_measurements,
    place_robustly,
    select_spread_poses,
)

EXACT = Plan(poses=12, loads=1, noise=0.0, force=0.0)


@pytest.fixture(scope="module", params=["base", "tracker"])
def exact(request, fanuc):
    """Without loads and without noise."""
    return make_campaign(fanuc, 1, replace(EXACT, tracker=request.param == "tracker"))


@pytest.mark.parametrize("position_in_input", [place_measurements, place_robustly])
def test_measurements_of_the_nominal_robot_lie_where_it_puts_them(
    exact, position_in_input
):
    result = position_in_input(exact)
    np.testing.assert_allclose(result.distance, 0.0, atol=1e-8)
    np.testing.assert_allclose(result.rotation_angle, 0.0, atol=1e-7)


def test_known_targets_are_predicted_by_pinocchio(fanuc):
    campaign = make_campaign(fanuc, 1, replace(EXACT, noise=1e-3))
    moved = tuple(
        replace(target, offset_m=(0.1, -0.2, 0.05 * k))
        for k, target in enumerate(campaign.targets)
    )
    campaign, rows = replace(campaign, targets=moved), campaign.measurements
    result = place_measurements(campaign)
    for row in range(0, len(rows), 7):
        target = moved[rows.target[row]]
        point = PinocchioPoint(
            fanuc.chain,
            replace(fanuc.chain.point(target.point), offset_m=target.offset_m),
        )
        position, rotation, _ = point.pose_and_jacobian(rows.joint_angles[row])
        np.testing.assert_allclose(result.predicted[row], position, rtol=0, atol=1e-12)
        turn = (
            Rotation.from_rotvec(rows.rotation_vector[row])
            * Rotation.from_matrix(rotation).inv()
        )
        assert result.rotation_angle[row] == pytest.approx(turn.magnitude(), abs=1e-9)
        # In the base frame measured positions stay as they are.
        np.testing.assert_array_equal(result.measured[0][row], rows.position[row])


def test_outliers_among_a_quarter_of_the_rows_do_not_move_the_robust_fit(
    fanuc,
):
    campaign = make_campaign(fanuc, 1, replace(EXACT, tracker=True, poses=16))
    rng = np.random.default_rng(2)
    position = campaign.measurements.position.copy()
    far = rng.random(len(position)) < 0.25
    position[far] += [0.3, 0.0, 0.0]
    campaign = replace_measured_columns(campaign, position=position)
    robust = place_robustly(campaign)
    np.testing.assert_allclose(robust.distance[far], 0.3, rtol=1e-6)
    np.testing.assert_allclose(robust.distance[~far], 0.0, atol=1e-6)
    assert place_measurements(campaign).distance[~far].min() > 0.01


def test_normal_errors_have_the_same_robust_fit_and_single_rows_are_no_misfit(
    fanuc,
):
    campaign = make_campaign(fanuc, 1, Plan(poses=12, loads=0, tracker=True))
    np.testing.assert_array_equal(
        place_robustly(campaign).estimate.frame_position,
        place_measurements(campaign).estimate.frame_position,
    )
    exact = make_campaign(fanuc, 1, EXACT)
    outlier = np.where(exact.measurements.pose[:, None] == 3, 0.3, 0.0)
    assert (
        place_measurements(
            replace_measured_columns(
                exact, position=exact.measurements.position + outlier
            )
        ).misfit.max()
        < 1e-6
    )


@pytest.mark.parametrize(
    ("wanted", "poses"), [(4, [0, 4, 7, 11]), (2, [0, 11]), (50, list(range(12)))]
)
def test_poses_are_spread_over_the_campaign_at_their_lowest_load_and_first_repeat(
    fanuc, wanted, poses
):
    campaign = make_campaign(fanuc, 1, Plan(poses=12, loads=2, repeats=2))
    loaded = campaign.measurements.select(campaign.measurements.load > 0)
    order = np.random.default_rng(5).permutation(len(loaded))
    result = select_spread_poses(
        replace(campaign, measurements=loaded.select(order)), wanted
    ).measurements
    for target in range(len(POINTS)):
        assert sorted(result.pose[result.target == target].tolist()) == poses
    assert (result.load == 1).all() and (result.repeat == 0).all()
    # In the order in which they were given.
    position_in_input = [
        np.flatnonzero(loaded.row[order] == row)[0] for row in result.row
    ]
    assert (np.diff(position_in_input) > 0).all()
