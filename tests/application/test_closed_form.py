"""All eight postures of an arm with a spherical wrist or three parallel axes, in closed
form."""

import numpy as np
import pytest
from analysed_robots import analysed
from hypothesis import given
from hypothesis import strategies as st
from made_chains import perturb_axes
from support import PinocchioPoint

from elastocal.application.closed_form import (
    ParallelAxesArm,
    SphericalWristArm,
    find_closed_form,
)
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.kinematics import compute_pose_differences, compute_poses

# Their axes turn both ways, and their chains put constants and offsets elsewhere.
SPHERICAL = ("kuka", "fanuc", "abb", "gp180", "irb7600", "m900ib700")
PARALLEL = ("ur5", "ur10")
COUNT = 500


def draw_angles(seed=1):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (COUNT, 6))


def solve(chain, position, rotation):
    return find_closed_form(chain).solve_all_postures(position, rotation)


def compute_errors(chain, angles, position, rotation):
    """Largest component of the pose errors, m and rad, (8, N)."""
    reached_position, reached_rotation = compute_poses(
        chain, angles, chain.end_effector
    )
    errors = compute_pose_differences(
        np.broadcast_to(position, reached_position.shape),
        np.broadcast_to(rotation, reached_rotation.shape),
        reached_position,
        reached_rotation,
    )
    return np.abs(errors).max(axis=-1)


def measure_distances(angles, others):
    """Largest difference of joint angles modulo whole turns."""
    return np.abs((angles - others + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


@pytest.mark.parametrize("name", SPHERICAL + PARALLEL)
def test_every_posture_reaches_the_pose_and_one_is_that_of_the_pose(name):
    chain = analysed(name).chain
    drawn = draw_angles()
    pose = compute_poses(chain, drawn, chain.end_effector)
    angles, is_reached = solve(chain, *pose)
    assert compute_errors(chain, angles, *pose)[is_reached].max() < 1e-9
    assert measure_distances(angles, drawn).min(axis=0).max() < 1e-6


@pytest.mark.parametrize("name", SPHERICAL)
def test_eight_postures_differ_or_the_arm_does_not_reach_backwards(name):
    """The elbow and the wrist always have two sides. The arm that faces away from the
    pose need not reach it."""
    chain = analysed(name).chain
    pose = compute_poses(chain, draw_angles(), chain.end_effector)
    angles, is_reached = solve(chain, *pose)
    counts = is_reached.sum(axis=0)
    assert set(counts) == {4, 8} and (counts == 8).mean() > 0.5
    for first in range(8):
        for second in range(first):
            both = is_reached[first] & is_reached[second]
            distances = measure_distances(angles[first], angles[second])
            assert distances[both].min() > 1e-3


def test_a_pose_beyond_the_reach_has_no_posture():
    chain = analysed("kuka").chain
    position, rotation = compute_poses(chain, draw_angles(), chain.end_effector)
    _, is_reached = solve(chain, position + 10.0, rotation)
    assert not is_reached.any()


@pytest.mark.parametrize("angle_5", [0.0, 1e-12, np.pi])
def test_an_aligned_wrist_has_a_posture_that_reaches_the_pose(angle_5):
    chain = analysed("kuka").chain
    drawn = draw_angles()
    drawn[:, 4] = angle_5
    pose = compute_poses(chain, drawn, chain.end_effector)
    angles, is_reached = solve(chain, *pose)
    assert (is_reached.sum(axis=0) >= 4).all()
    assert compute_errors(chain, angles, *pose)[is_reached].max() < 1e-7


@pytest.mark.parametrize(
    "text",
    [
        "Rz(q1) Ry(q2) Tz(a) Ry(q3) Tx(a) Rx(q4) Ry(q5) Tz(d) Rx(q6) [6DoF]",
        "Rz(q1) Rx(q2) Tz(a) Ry(q3) Tx(a) Rx(q4) Ry(q5) Tx(d) Rx(q6) [6DoF]",
        "Rz(q1) Ry(q2) Tz(a) Ry(q3) Tx(a) Tx(q4) Ry(q5) Tx(d) Rx(q6) [6DoF]",
    ],
    ids=["offset wrist", "crossed shoulder", "prismatic"],
)
def test_other_arms_have_no_closed_form(text):
    assert find_closed_form(parse_chain(text, {"a": 1.0, "d": 0.1}, "")) is None


def test_an_exact_arm_is_preferred_to_a_nearly_exact_one():
    """The last three axes of this arm with parallel axes miss each other by 12 mm."""
    text = (
        "Rz(q1) Ry(q2) Tz(0.6) Ry(q3) Tx(0.5) Ry(q4) Tx(0.012) Rz(q5) Tz(0.01) Ry(q6)"
        " [6DoF]"
    )
    arm = find_closed_form(parse_chain(text, {}, ""))
    assert isinstance(arm, ParallelAxesArm) and arm.is_exact


@pytest.mark.parametrize("name", ["iiwa14", "panda", "wam"])
def test_robots_with_seven_joints_have_no_closed_form(name):
    assert find_closed_form(analysed(name).chain) is None


@pytest.mark.parametrize("name", ["kuka", "ur10"])
def test_postures_reach_the_pose_of_an_independent_robot(name):
    chain = analysed(name).chain
    by_pinocchio = PinocchioPoint(chain, chain.end_effector)
    drawn = draw_angles(2)[:20]
    poses = [by_pinocchio.pose_and_jacobian(angles)[:2] for angles in drawn]
    position, rotation = (np.array(values) for values in zip(*poses, strict=True))
    angles, is_reached = solve(chain, position, rotation)
    assert (is_reached.sum(axis=0) >= 2).all()
    for posture, row in np.argwhere(is_reached):
        reached = by_pinocchio.pose_and_jacobian(angles[posture, row])
        np.testing.assert_allclose(reached[0], position[row], rtol=0, atol=1e-9)
        np.testing.assert_allclose(reached[1], rotation[row], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", PARALLEL)
def test_an_arm_with_parallel_axes_has_pairs_of_postures(name):
    """Each side of the elbow has another one. The UR arms reach most poses in all eight
    postures."""
    chain = analysed(name).chain
    pose = compute_poses(chain, draw_angles(), chain.end_effector)
    angles, is_reached = solve(chain, *pose)
    counts = is_reached.sum(axis=0)
    assert set(counts) == {2, 4, 6, 8} and (counts == 8).mean() > 0.5
    for first in range(8):
        for second in range(first):
            both = is_reached[first] & is_reached[second]
            distances = measure_distances(angles[first], angles[second])
            assert distances[both].min() > 1e-4


def test_an_aligned_wrist_of_a_stretched_arm_leaves_a_start_for_newtons_method():
    """Joint 6 has any angle if axis 6 is parallel to axes 2 to 4, and with most of them
    the stretched elbow does not reach the pose."""
    chain = analysed("ur10").chain
    drawn = draw_angles()
    drawn[:, 2] = 1e-3
    drawn[:, 4] = 0.0
    pose = compute_poses(chain, drawn, chain.end_effector)
    _, is_reached = solve(chain, *pose)
    assert is_reached.any(axis=0).all()


signs = st.lists(st.sampled_from(["", "-"]), min_size=6, max_size=6)
lengths = st.lists(st.floats(-0.5, 0.5), min_size=13, max_size=13)
tilts = st.lists(st.floats(-45.0, 45.0), min_size=3, max_size=3)


@given(signs, lengths, tilts, st.integers(0, 2**32 - 1))
def test_any_arm_with_parallel_axes_is_solved(signs, lengths, tilts, seed):
    """Offsets along and across all axes, tilted axes, joints that turn either way."""
    joints = [f"({sign}q{number})" for number, sign in enumerate(signs, 1)]
    steps = [
        f"T{axis}({length:.9f})"
        for axis, length in zip("xyzxyxyzxyzyz", lengths, strict=True)
    ]
    turns = [f"Rx({tilt:.9f}deg)" for tilt in tilts]
    text = (
        f"{steps[0]} Rz{joints[0]} {' '.join(steps[1:3])} {turns[0]}"
        f" Ry{joints[1]} Tz(0.6) {' '.join(steps[3:5])}"
        f" Ry{joints[2]} Tx(0.7) {' '.join(steps[5:8])}"
        f" Ry{joints[3]} {' '.join(steps[8:11])} {turns[1]}"
        f" Rz{joints[4]} Tz(0.1) {turns[2]} Ry{joints[5]} {' '.join(steps[11:])} [6DoF]"
    )
    chain = parse_chain(text, {}, "")
    assert find_closed_form(chain).is_exact
    drawn = np.random.default_rng(seed).uniform(-np.pi, np.pi, (5, 6))
    pose = compute_poses(chain, drawn, chain.end_effector)
    angles, is_reached = solve(chain, *pose)
    assert is_reached.any(axis=0).all()
    errors = compute_errors(chain, angles, *pose)
    # Near a singular posture an angle has half the digits of a pose.
    assert errors[is_reached].max() < 1e-6
    assert measure_distances(angles, drawn).min(axis=0).max() < 1e-3


@pytest.mark.parametrize("name", ["kuka", "ur10"])
def test_an_arm_with_calibrated_axes_is_solved_as_the_nearest_one(name):
    chain = perturb_axes(analysed(name).chain, 1e-3)
    arm = find_closed_form(chain)
    assert not arm.is_exact and find_closed_form(analysed(name).chain).is_exact
    drawn = draw_angles()
    pose = compute_poses(chain, drawn, chain.end_effector)
    angles, is_reached = arm.solve_all_postures(*pose)
    distances = np.where(is_reached, measure_distances(angles, drawn), np.inf)
    # Errors of millimetres over levers of decimetres, but near singular postures.
    assert np.quantile(distances.min(axis=0), 0.9) < 0.05


def test_axes_that_cross_twice_the_tolerance_apart_have_no_closed_form():
    lengths = {"a": 1.0, "d": 0.1, "e": 0.05}
    text = "Rz(q1) Ry(q2) Tz(a) Ry(q3) Tx(a) Rx(q4) Ry(q5) Tz(e) Rx(q6) Tx(d) [6DoF]"
    assert find_closed_form(parse_chain(text, lengths, "")) is None
    lengths["e"] = 0.01
    assert isinstance(
        find_closed_form(parse_chain(text, lengths, "")), SphericalWristArm
    )
