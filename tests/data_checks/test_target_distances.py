"""Distances between targets against the declared ones, without a model of the robot."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, make_campaign

from elastocal.campaigns.campaign import Target, join_measurements
from elastocal.data_checks.target_distances import compare_target_distances

NOISE_M = 5e-5
STATES = 68


@pytest.fixture
def campaign(kuka):
    """Two reflectors, 120 mm apart, on one point in many states, with the noise of a
    tracker; the robot's joint angles say nothing of where they are."""
    made = make_campaign(kuka, 1, Plan(poses=STATES, loads=1, oriented=False))
    measured = made.measurements.select(made.measurements.target < 2)
    rng = np.random.default_rng(1)
    state = np.unique(
        np.column_stack([measured.pose, measured.load]), axis=0, return_inverse=True
    )[1]
    direction = rng.standard_normal((state.max() + 1, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    centre = rng.uniform(-1.0, 1.0, direction.shape)
    side = np.where(measured.target == 0, -0.06, 0.06)
    position = centre[state] + side[:, None] * direction[state]
    position += NOISE_M * rng.standard_normal(position.shape)
    return replace(made, measurements=replace(measured, position=position))


def declare(campaign, distance_m):
    """Declare two reflectors at a distance."""
    targets = (
        Target("R1", "6DoF", (0.05, 0.0, 0.0)),
        Target("R2", "6DoF", (0.05, distance_m, 0.0)),
    )
    return replace(campaign, targets=targets)


@pytest.mark.parametrize(
    ("distance_m", "words"),
    [(0.11947, "0.53 mm farther apart"), (0.12053, "0.53 mm closer together")],
)
def test_a_wrong_distance_is_said_in_one_line_with_the_cure(
    campaign, distance_m, words
):
    (sentence,) = compare_target_distances(declare(campaign, distance_m))
    assert sentence.startswith("R1 and R2 are 0.5")
    assert words.partition(" mm ")[2] in sentence
    assert "measure the tool with the tracker" in sentence


def test_of_several_wrong_distances_the_largest_is_named(campaign):
    measured = campaign.measurements
    first = measured.select(measured.target == 0)
    third = replace(
        first,
        target=np.full(len(first), 2),
        position=np.add(first.position, [0, 0, 0.03]),
    )
    joined = join_measurements(measured, third)
    targets = (
        *declare(campaign, 0.12053).targets,
        # 1.2 mm from where the third reflector is.
        Target("R3", "6DoF", (0.05, 0.0, 0.0312)),
    )
    (sentence,) = compare_target_distances(
        replace(campaign, targets=targets, measurements=joined)
    )
    assert sentence.startswith("R1 and R3 are 1.20 mm")
    assert "further pair" in sentence


def test_chance_is_no_wrong_distance(campaign):
    assert compare_target_distances(declare(campaign, 0.12)) == []


def test_targets_between_which_a_joint_lies_are_not_compared(campaign):
    targets = (
        Target("R1", "4DoF", (0.0, 0.0, 0.0)),
        Target("R2", "6DoF", (0.0, 0.0, 0.0)),
    )
    assert compare_target_distances(replace(campaign, targets=targets)) == []


def test_unknown_offsets_have_no_distance(campaign):
    targets = (Target("R1", "6DoF", None), Target("R2", "6DoF", (0.0, 0.0, 0.0)))
    assert compare_target_distances(replace(campaign, targets=targets)) == []
