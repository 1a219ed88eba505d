"""Poses of ISO 9283 and a milling path: where they lie, and that the robot reaches them
within its limits."""

import numpy as np
import pandas as pd
import pytest

from elastocal.application.inverse_kinematics import find_beyond_limits
from elastocal.mechanics.kinematics import compute_poses
from elastocal.study.uses import (
    REFERENCE,
    build_pairs_table,
    build_ranks_table,
    make_iso_9283_poses,
    make_milling_path,
    score_strategies,
)

CENTRE = (1.6, 0.0, 1.0)


def find_positions(robot, use):
    position, rotation = compute_poses(
        robot.chain, use.joint_angles[0], robot.chain.end_effector
    )
    assert not find_beyond_limits(robot, use.joint_angles[0]).any()
    # The spindle looks down.
    np.testing.assert_allclose(
        rotation[..., 0], np.tile([0, 0, -1.0], (len(position), 1)), atol=1e-6
    )
    return position


def test_five_poses_lie_on_the_diagonals_of_a_cube_a_tenth_from_their_ends(robot):
    use = make_iso_9283_poses(robot, CENTRE, 1.0, 800.0)
    position = find_positions(robot, use) - CENTRE
    np.testing.assert_allclose(position[0], 0, atol=1e-6)
    # Space diagonals of the unit cube have length sqrt 3.
    np.testing.assert_allclose(
        np.linalg.norm(position[1:], axis=1), 0.4 * np.sqrt(3), atol=1e-6
    )
    np.testing.assert_allclose(position[1] + position[3], 0, atol=1e-6)
    # One plane through the centre, sloped by 45 degrees.
    np.testing.assert_allclose(position[:, 0], position[:, 2], atol=1e-6)
    np.testing.assert_array_equal(
        use.wrench[0], np.tile([0, 0, -800.0, 0, 0, 0], (5, 1))
    )


def test_a_milling_path_is_straight_and_level_with_a_force_against_its_feed(robot):
    use = make_milling_path(robot, CENTRE, 0.5, 500.0)
    position = find_positions(robot, use)
    steps = np.diff(position, axis=0)
    np.testing.assert_allclose(steps, np.tile(steps[0], (len(steps), 1)), atol=1e-6)
    assert np.linalg.norm(position[-1] - position[0]) == pytest.approx(0.5) and steps[
        0, 2
    ] == pytest.approx(0, abs=1e-6)
    force = use.wrench[0, :, :3]
    assert (
        np.linalg.norm(force, axis=1) == pytest.approx(500.0)
        and (force @ steps[0] < 0).all()
        and (force[:, 2] > 0).all()
    )
    # No jump from one posture to another.
    assert np.abs(np.diff(use.joint_angles[0], axis=0)).max() < 0.05


LENGTH = 20
SETS = 200


def uses_of(strategy, size, seed=1, tests=50):
    """Errors of data sets that strategies share, times a size in µm."""
    errors = (
        1e-6 * size * np.abs(np.random.default_rng(seed).normal(size=(SETS, tests)))
    )
    pooled = np.quantile(errors, 0.95)
    # Of |normal|: density 2 phi(1.96) at the quantile.
    slope = 1e-6 * size / (2 * np.exp(-(1.96**2) / 2) / np.sqrt(2 * np.pi))
    return pd.DataFrame(
        {
            "strategy": strategy,
            "data_set": np.arange(SETS),
            "mean": errors.mean(axis=1),
            "mean_square": (errors**2).mean(axis=1),
            "p95": np.quantile(errors, 0.95, axis=1),
            "pooled_p95": pooled,
            "pooled_p95_influence": slope * ((errors > pooled).mean(axis=1) - 0.05),
            "iso_9283": errors[:, :5].max(axis=1),
            "path_mean_square": (errors[:, 5:10] ** 2).mean(axis=1),
            "path_max": errors[:, 5:10].max(axis=1),
        }
    )


def average(strategy, k_sigma, fixed):
    values = {
        "k_sigma": k_sigma,
        "k_sigma_fixed_joints": fixed,
        "deviation": 1e-6 * k_sigma,
    }
    metrics = pd.DataFrame([{"strategy": strategy, "length": LENGTH} | values])
    drawn = [
        {"strategy": strategy, "length": LENGTH, "replicate": n + 1} for n in range(50)
    ]
    wobble = 1 + 0.05 * np.random.default_rng(2).normal(size=50)
    replicates = pd.DataFrame(drawn).assign(
        **{name: value * wobble for name, value in values.items()}
    )
    return metrics, replicates


@pytest.fixture(scope="module")
def found():
    """Strategy B leaves 1.5 times the error of A, C is A under another name, and only the
    fixed joints of B have a better score."""
    uses = pd.concat([uses_of("A", 50.0), uses_of("B", 75.0), uses_of("C", 50.0)])
    both = [average("A", 4.0, 4.0), average("B", 6.0, 2.0), average("C", 4.0, 4.0)]
    metrics, replicates = (pd.concat(parts) for parts in zip(*both, strict=True))
    return {"arm": score_strategies(uses, metrics, replicates, LENGTH)}


def test_scores_are_in_the_units_of_people_with_roots_of_means_of_squares(found):
    rms = found["arm"][REFERENCE]
    # Root of the mean square of a normal variable: its standard deviation.
    assert rms["A"].value == pytest.approx(50.0, rel=0.02) and rms[
        "B"
    ].value == pytest.approx(1.5 * rms["A"].value)
    # Half the relative error of a mean of 50 squares in 200 data sets, which is known
    # to 5 %.
    assert rms["A"].compute_std_error() == pytest.approx(
        50 * np.sqrt(2 / (50 * 200)) / 2, rel=0.2
    )
    assert found["arm"]["pooled_p95_um"]["A"].value == pytest.approx(
        1.96 * 50, rel=0.03
    )
    assert found["arm"]["dev_um"]["A"].value == pytest.approx(4.0)


def test_one_estimator_under_two_names_has_one_rank_and_ratio_one(found):
    table = build_ranks_table(found, "A").set_index(["metric", "strategy"])
    assert table["rank"][REFERENCE].to_dict() == {"A": 1, "B": 3, "C": 1}
    assert table.loc[
        (REFERENCE, "C"), ["ratio", "ratio_low", "ratio_high"]
    ].tolist() == [1.0, 1.0, 1.0]
    assert table["rank"]["k_sigma_percent_fixed_joints"].to_dict() == {
        "A": 2,
        "B": 1,
        "C": 2,
    }


def test_only_a_metric_with_the_opposite_order_is_marked_as_reversed(found):
    table = build_pairs_table(found)
    assert set(table.strategy) == {"A"} and set(table.other) == {"B"}
    assert table[table.reversed].metric.tolist() == ["k_sigma_percent_fixed_joints"]


def test_metrics_of_unreachable_positions_are_left_out():
    uses = uses_of("A", 50.0).assign(iso_9283=np.nan)
    scored = score_strategies(uses, *average("A", 4.0, 4.0), LENGTH)
    assert "iso_9283_um" not in scored and {REFERENCE, "path_rms_um"} < set(scored)
