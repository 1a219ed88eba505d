"""Configurations of a plan without a tracker: the tip touches, and the camera sees the
whole board."""

import numpy as np
import pytest
from analysed_robots import analysed
from made_setups import make_kind_survey

from elastocal.application.inverse_kinematics import find_beyond_limits
from elastocal.application.planning.cell import build_cell
from elastocal.application.planning.plan import choose_plan, find_allowed_candidates
from elastocal.application.planning.reaching import find_outward_direction
from elastocal.errors import InputError
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.kinematics import compute_poses


def find_candidates(survey, count=150):
    """Find candidates in a cell with a floor at the foot of the robot."""
    return find_allowed_candidates(survey, build_cell(survey.robot), count, 1)


def locate(survey, candidates):
    """Locate the tip in base axes, by forward kinematics alone, (N, 3), m; and its shaft
    or the camera's axis (N, 3)."""
    setup = survey.setup
    angles = survey.robot.model_angles(candidates.joint_angles)
    chain = survey.robot.chain
    position, rotation = compute_poses(chain, angles, chain.point(setup.point))
    return position + rotation @ setup.mount_m, rotation @ setup.mount_rotation


@pytest.mark.parametrize("kind", ["point", "plane", "sphere"])
def test_each_candidate_of_a_contact_touches_and_comes_from_outside(kind):
    survey = make_kind_survey(kind)
    candidates = find_candidates(survey)
    position, rotation = locate(survey, candidates)
    places = np.array(list(survey.setup.places.values()))[candidates.place_index]
    offset = position - places[:, :3]
    if kind == "point":
        height, normal = np.linalg.norm(offset, axis=1), places[:, 3:]
    elif kind == "plane":
        height, normal = (offset * places[:, 3:]).sum(axis=1), places[:, 3:]
        assert np.linalg.norm(offset, axis=1).max() <= 0.5
    else:
        height = np.linalg.norm(offset, axis=1) - places[:, 3]
        normal = offset / np.linalg.norm(offset, axis=1, keepdims=True)
    assert np.abs(height).max() < 1e-6
    cosine = -(rotation[:, :, 2] * normal).sum(axis=1)
    assert cosine.min() >= np.cos(np.radians(60.0)) - 1e-9
    # All places are measured, within the limits, in different postures.
    assert set(candidates.place_index) == set(range(len(survey.setup.places)))
    angles = survey.robot.model_angles(candidates.joint_angles)
    assert not find_beyond_limits(survey.robot, angles).any()
    assert np.ptp(angles, axis=0).min() > 1.0


def draw_rim(middle, normal, radius_m):
    """Points (16, 3), m, of the circle around a board."""
    turn = np.linspace(0, 2 * np.pi, 16)
    across = np.linalg.svd(normal[None])[2][1:]
    return middle + radius_m * np.column_stack([np.cos(turn), np.sin(turn)]) @ across


@pytest.mark.parametrize("camera", ["on_robot", "beside_robot"])
def test_each_candidate_has_all_corners_of_the_board_in_the_image(camera):
    survey = make_kind_survey("board", camera)
    candidates = find_candidates(survey)
    position, rotation = locate(survey, candidates)
    (place,) = survey.setup.places.values()
    is_beside = camera == "beside_robot"
    half = 0.5 * survey.setup.options["board_m"]
    for target, axes in zip(position, rotation, strict=True):
        ends = [(target, axes[:, 2]), (place[:3], place[3:])]
        (eye, view), (middle, normal) = ends[::-1] if is_beside else ends
        sight = draw_rim(middle, normal, half) - eye
        cosine = sight @ view / np.linalg.norm(sight, axis=1)
        assert cosine.min() >= np.cos(np.radians(21.0)) - 1e-9
        assert 0.3 <= np.linalg.norm(middle - eye) <= 1.0
        towards = (eye - middle) / np.linalg.norm(eye - middle)
        assert towards @ normal >= np.cos(np.radians(45.0)) - 1e-9


@pytest.mark.parametrize("kind", ["distance", "line"])
def test_lengths_and_strokes_stay_within_their_limits(kind):
    survey = make_kind_survey(kind)
    candidates = find_candidates(survey)
    position, _ = locate(survey, candidates)
    places = np.array(list(survey.setup.places.values()))[candidates.place_index]
    offset = position - places[:, :3]
    if kind == "distance":
        length = np.linalg.norm(offset, axis=1)
        assert length.min() >= 0.1 and length.max() <= 2.0
    else:
        along = (offset * places[:, 3:]).sum(axis=1)
        assert np.abs(along).max() <= 0.01
        # A gauge that always reads the same says nothing.
        assert np.std(along) > 2e-3


def test_only_a_camera_beside_the_robot_has_a_line_of_sight_that_the_arm_may_hide():
    beside = make_kind_survey("board", "beside_robot").setup
    np.testing.assert_allclose(beside.find_viewpoint(), [1.2, 0.0, 0.6])
    assert make_kind_survey("board").setup.find_viewpoint() is None
    assert make_kind_survey("point").setup.find_viewpoint() is None


def test_a_board_that_the_robot_cannot_see_is_refused():
    survey = make_kind_survey("board", place=[0.0, 0.0, 4.0, 0.0, 0.0, 1.0])
    with pytest.raises(InputError, match=r"--place board.*none of"):
        find_candidates(survey)


def test_a_plan_of_board_poses_is_better_than_random_ones():
    survey = make_kind_survey("board")
    candidates = find_candidates(survey, 300)
    plan = choose_plan(survey, candidates, 18, 5, 1)
    assert plan.accuracy_m[-1] < np.quantile(plan.random_m[:, -1], 0.05)


def test_a_plan_measures_each_feature():
    survey = make_kind_survey("plane")
    plan = choose_plan(survey, find_candidates(survey, 300), 100, 5, 1)
    # Three parameters of a plane, and what it says of the robot.
    assert np.bincount(plan.fitted.place_index).min() > 3


def test_the_way_out_of_an_arm_is_along_its_last_length():
    panda = analysed("panda").chain
    found = find_outward_direction(panda, panda.end_effector)
    np.testing.assert_allclose(found, [0.0, 0.0, -1.0], atol=1e-12)
    chain = parse_chain("Rz(q1) Tx(0.3) Ry(90deg) [tool]", {}, "test")
    found = find_outward_direction(chain, chain.end_effector)
    np.testing.assert_allclose(found, [0.0, 0.0, 1.0], atol=1e-12)
