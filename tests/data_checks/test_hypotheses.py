"""A sense, axis, unit, frame or target is named where reading it otherwise lets absurd
measurements fit, and nowhere else."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_campaigns import (
    Plan,
    change_compliances,
    make_campaign,
    replace_measured_columns,
)
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_campaign
from elastocal.data_checks.hypotheses import (
    find_better_interpretation,
    list_discrete_hypotheses,
    list_fitted_hypotheses,
    list_row_shifts,
)
from elastocal.data_checks.placement import place_measurements
from elastocal.mechanics.kinematics import compute_poses

BOX = Path(__file__).resolve().parents[2] / "data" / "measured"


def softer_by_chance(robot, tracker):
    return make_campaign(
        robot, 1, Plan(poses=12, tracker=tracker), change_compliances(robot, 1, 0.3)
    )


@pytest.fixture(scope="module")
def campaign(fanuc):
    return softer_by_chance(fanuc, tracker=False)


@pytest.mark.parametrize(
    ("joint", "tracker"), [(0, False), (2, False), (3, True), (5, False)]
)
def test_a_joint_counted_the_other_way_round_is_named(fanuc, joint, tracker):
    campaign = softer_by_chance(fanuc, tracker)
    angles = campaign.measurements.joint_angles * (1.0 - 2.0 * np.eye(6)[joint])
    (fault,) = find_better_interpretation(
        replace_measured_columns(campaign, joint_angles=angles)
    )
    assert (fault.name, fault.joints) == ("wrong_sign", (joint + 1,))
    before, after = fault.evidence
    assert before > 0.02 and after < 1e-3


def test_loads_that_are_numbered_throughout_have_no_row_beside_them(campaign):
    measured_rows = campaign.measurements
    turned = replace_measured_columns(
        campaign,
        joint_angles=-measured_rows.joint_angles,
        load=np.arange(len(measured_rows)) + 1,
    )
    assert not [
        fault
        for fault in find_better_interpretation(turned)
        if fault.name == "shuffled_rows"
    ]


@pytest.mark.parametrize(
    ("joint", "sign", "phrase"),
    [(2, 1.0, "taken from"), (2, -1.0, "added to"), (5, -1.0, "added to")],
)
def test_a_joint_counted_from_its_neighbour_is_named_with_it(
    campaign, joint, sign, phrase
):
    angles = campaign.measurements.joint_angles.copy()
    angles[:, joint] += sign * angles[:, joint - 1]
    (fault,) = find_better_interpretation(
        replace_measured_columns(campaign, joint_angles=angles)
    )
    assert fault.joints == (joint, joint + 1)
    assert phrase in fault.detail


def test_the_sign_is_that_of_the_column_of_the_file(fanuc):
    """Where the controller counts from elsewhere, turning the column is not turning the
    angle of the model."""
    reported_matrix = np.diag([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
    robot = replace(
        fanuc,
        reported_matrix=reported_matrix,
        reported_offset=np.radians([0, -40, 60, 0, 0, 0]),
    )
    campaign = make_campaign(robot, 3, Plan(poses=14))
    reported = (
        campaign.measurements.joint_angles - robot.reported_offset
    ) @ reported_matrix
    reported[:, 2] *= -1
    angles = reported @ reported_matrix + robot.reported_offset
    (fault,) = find_better_interpretation(
        replace_measured_columns(campaign, joint_angles=angles)
    )
    assert fault.joints == (3,)


def test_orientations_turned_round_are_named(campaign):
    (fault,) = find_better_interpretation(
        replace_measured_columns(
            campaign, rotation_vector=-campaign.measurements.rotation_vector
        )
    )
    assert fault.joints == ()
    assert "rotation vectors" in fault.detail


ELSEWHERE = Rotation.from_rotvec([0.3, -0.5, 1.2]), np.array([2.0, 0.6, -0.2])


def with_turned_mount(campaign, turn, moved_m=0.0):
    """Of the last target, which is also moved along its z axis."""
    is_last_target = campaign.measurements.target[:, None] == 3
    measured = Rotation.from_rotvec(campaign.measurements.rotation_vector)
    displacement = np.where(is_last_target, measured.apply([0.0, 0.0, moved_m]), 0.0)
    vectors = np.where(
        is_last_target, (measured * turn).as_rotvec(), measured.as_rotvec()
    )
    return replace_measured_columns(
        campaign,
        position=campaign.measurements.position + displacement,
        rotation_vector=vectors,
    )


EXCHANGED = {
    "x = y, y = x": [[0, 1, 0], [1, 0, 0], [0, 0, 1]],
    "z = -z": np.diag([1, 1, -1]),
    "x = y, y = z, z = x": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
}


@pytest.mark.parametrize("phrase", EXCHANGED)
def test_exchanged_axes_of_positions_are_named(campaign, phrase):
    written = campaign.measurements.position @ np.array(EXCHANGED[phrase], float).T
    (fault,) = find_better_interpretation(
        replace_measured_columns(campaign, position=written)
    )
    assert fault.name == "swapped_axes"
    assert fault.detail.endswith(f"measurements fit with {phrase}")


@pytest.mark.parametrize(("factor", "unit"), [(1000, "millimetres"), (0.1, "tenth")])
def test_positions_in_another_unit_are_named(campaign, factor, unit):
    (fault,) = find_better_interpretation(
        replace_measured_columns(
            campaign, position=factor * campaign.measurements.position
        )
    )
    assert fault.name == "wrong_unit" and unit in fault.detail
    assert f"fit {1 / factor:g} times" in fault.detail


@pytest.mark.parametrize(
    ("letters", "phrase"), [("XYZ", "moved x, y, z"), ("xyz", "roll, pitch, yaw")]
)
def test_angles_in_the_columns_of_the_rotation_vector_are_named(
    campaign, letters, phrase
):
    angles = Rotation.from_rotvec(campaign.measurements.rotation_vector).as_euler(
        letters
    )
    (fault,) = find_better_interpretation(
        replace_measured_columns(campaign, rotation_vector=angles)
    )
    assert phrase in fault.detail


def test_each_session_has_a_transform_of_its_own(fanuc):
    campaign = make_campaign(fanuc, 1, Plan(poses=14, oriented=False))
    measurements = campaign.measurements
    rotation = ELSEWHERE[0]
    session = (measurements.pose >= 10).astype(np.int32)
    position = rotation.apply(measurements.position) + np.where(
        session[:, None], [0.0, 3.0, 0.0], [1.0, 0.0, 0.0]
    )
    (fault,) = find_better_interpretation(
        replace_measured_columns(campaign, session=session, position=position)
    )
    # That of the session that stands farther off.
    assert (
        fault.name == "wrong_frame"
        and "would stand 3 m away, turned by 76.4°" in fault.detail
    )


def of_the_end(campaign):
    """With the measurements of the last target alone."""
    return replace(
        campaign,
        measurements=campaign.measurements.select(campaign.measurements.target == 3),
    )


def known_targets(fanuc, factor=1.0, which=slice(None)):
    """A campaign whose targets sit 0.1 m or so off their points, written so many times
    as large."""
    offsets = 0.1 * np.array(
        [[1.0, 0.3, -0.5], [-0.4, 1.0, 0.2], [0.3, 0.4, 1.0], [1.0, -1.0, 0.5]]
    )
    points = tuple(
        replace(p, offset_m=tuple(o))
        for p, o in zip(fanuc.chain.points, offsets, strict=True)
    )
    chain = replace(fanuc.chain, points=points)
    rng = np.random.default_rng(4)
    plain = make_campaign(fanuc, 1, Plan(poses=14))
    position = np.empty_like(plain.measurements.position)
    for number, point in enumerate(chain.points):
        mask = plain.measurements.target == number
        position[mask] = compute_poses(
            chain, plain.measurements.joint_angles[mask], point
        )[0]
    written = offsets.copy()
    written[which] *= factor
    targets = tuple(
        replace(t, offset_m=tuple(o))
        for t, o in zip(plain.targets, written, strict=True)
    )
    measured_rows = replace(
        plain.measurements,
        position=position + 6e-5 * rng.standard_normal(position.shape),
    )
    return replace(plain, targets=targets, measurements=measured_rows)


@pytest.mark.parametrize(
    ("which", "phrase"),
    [(slice(None), "T2DoF, T3DoF, T4DoF, T6DoF"), (slice(3, 4), "T6DoF")],
)
def test_target_offsets_in_millimetres_are_named(fanuc, which, phrase):
    campaign = known_targets(fanuc, 1000.0, which)
    (fault,) = find_better_interpretation(campaign)
    assert fault.name == "wrong_unit" and fault.detail.startswith(
        f"the target offset of {phrase} looks like millimetres"
    )


def test_a_target_that_sits_elsewhere_is_named_with_its_place(fanuc):
    campaign = known_targets(fanuc)
    moved = replace(campaign.targets[3], offset_m=(0.3, 0.1, 0.0))
    campaign = replace(campaign, targets=(*campaign.targets[:3], moved))
    (fault,) = find_better_interpretation(of_the_end(campaign))
    assert fault.name == "wrong_target" and "T6DoF would sit" in fault.detail
    # From (0.3, 0.1, 0) to (0.1, -0.1, 0.05).
    assert "would sit 287 mm from there" in fault.detail


@pytest.mark.parametrize(("error_m", "names"), [(0.025, []), (0.06, ["wrong_target"])])
def test_a_last_link_that_is_a_little_longer_than_its_file_is_left_to_physics(
    fanuc, error_m, names
):
    last = replace(
        fanuc.chain.transforms[-1],
        constant=fanuc.chain.transforms[-1].constant + error_m,
    )
    longer = replace(
        fanuc,
        chain=replace(fanuc.chain, transforms=(*fanuc.chain.transforms[:-1], last)),
    )
    campaign = make_campaign(fanuc, 1, Plan(poses=14, oriented=False), longer)
    assert [
        fault.name for fault in find_better_interpretation(of_the_end(campaign))
    ] == names


@pytest.mark.parametrize(
    ("shift", "names"), [(0.0, []), (0.004, []), (0.03, []), (0.06, ["wrong_frame"])]
)
def test_a_base_that_stands_a_little_off_is_left_to_physics(fanuc, shift, names):
    campaign = make_campaign(fanuc, 1, Plan(poses=14))
    moved = replace_measured_columns(
        campaign, position=campaign.measurements.position + np.array([0.0, 0.0, shift])
    )
    assert [fault.name for fault in find_better_interpretation(moved)] == names


def test_an_equivalent_hypothesis_is_listed_as_an_alternative(fanuc):
    """In a frame that nobody knows, axes and rotation vectors exchanged together are
    mirrored in one way or another."""
    campaign = make_campaign(fanuc, 1, Plan(poses=14, tracker=True))
    measured_rows = campaign.measurements
    exchanged = {
        name: getattr(measured_rows, name)[:, [1, 0, 2]]
        for name in ("position", "rotation_vector")
    }
    (fault,) = find_better_interpretation(
        replace_measured_columns(campaign, **exchanged)
    )
    assert fault.name == "swapped_axes" and len(fault.alternatives) >= 3
    assert all("rotation vectors likewise" in phrase for phrase in fault.alternatives)


def test_random_measurements_have_no_better_interpretation(campaign):
    rng = np.random.default_rng(5)
    assert (
        find_better_interpretation(
            replace_measured_columns(
                campaign,
                position=rng.normal(0.0, 1.0, campaign.measurements.position.shape),
            )
        )
        == []
    )


def test_a_robot_that_hardly_moves_is_not_fitted_by_gathering_measurements_in_one_place(
    fanuc,
):
    campaign = make_campaign(
        fanuc, 1, Plan(poses=8, loads=1, tracker=True, oriented=False)
    )
    angles = 0.3 + 1e-3 * np.random.default_rng(2).normal(size=(8, 6))
    position = np.random.default_rng(3).normal(0.0, 1.0, (8, 3))
    pose = campaign.measurements.pose
    assert (
        find_better_interpretation(
            replace_measured_columns(
                campaign, joint_angles=angles[pose], position=position[pose]
            )
        )
        == []
    )


@pytest.mark.parametrize(("degrees", "moved_m"), [(8, 0.0), (180, 0.05)])
def test_a_rotated_mount_is_named_with_its_remedy_and_fitted_only_if_declared_unknown(
    fanuc, degrees, moved_m
):
    campaign = make_campaign(fanuc, 1, Plan(poses=14))
    turn = Rotation.from_rotvec(
        [0.0, 0.6 * np.radians(degrees), 0.8 * np.radians(degrees)]
    )
    written = with_turned_mount(campaign, turn, moved_m)
    (fault,) = find_better_interpretation(written)
    assert fault.name == "wrong_target"
    assert (
        f"T6DoF would be turned by {degrees}" in fault.detail
        and "rotation: unknown" in fault.detail
    )
    assert ("offset_m: unknown" in fault.detail) == bool(moved_m)
    if not moved_m:
        for right in (None, tuple(turn.as_rotvec())):
            mount = replace(campaign.targets[3], rotation=right)
            assert (
                find_better_interpretation(
                    replace(written, targets=(*campaign.targets[:3], mount))
                )
                == []
            )


def test_simple_hypotheses_come_first_and_none_is_listed_twice(fanuc):
    campaign = make_campaign(fanuc, 1, Plan(poses=10))
    single = [*list_discrete_hypotheses(campaign), *list_row_shifts(campaign)]
    assert single[0].joints == (1,)
    details = [hypothesis.detail for hypothesis in single]
    assert len(set(details)) == len(details)
    assert [hypothesis.detail for hypothesis in list_fitted_hypotheses(campaign)] == [
        "the base stands elsewhere",
        "targets have another orientation",
        "targets sit elsewhere",
    ]
    for hypothesis in single:
        read = hypothesis.apply(campaign)
        assert read is not campaign and len(read.measurements) <= len(
            campaign.measurements
        )


@pytest.mark.parametrize(
    ("kind", "keys"),
    [("row of its target", ("target",)), ("pose", ("target", "load", "repeat"))],
)
@pytest.mark.parametrize("steps", [1, -1])
def test_measured_columns_of_each_target_or_pose_moved_by_one_are_named(
    fanuc, kind, keys, steps
):
    campaign = make_campaign(fanuc, 1, Plan(poses=14, loads=1))
    measurements = campaign.measurements
    source = np.arange(14 * 8)
    groups = np.unique(
        np.column_stack([getattr(measurements, key) for key in keys]),
        axis=0,
        return_inverse=True,
    )[1].ravel()
    for group in range(groups.max() + 1):
        members = np.flatnonzero(groups == group)
        source[members] = np.roll(members, steps)
    turned = measurements.rotation_vector[source]
    (fault,) = find_better_interpretation(
        replace_measured_columns(
            campaign, position=measurements.position[source], rotation_vector=turned
        )
    )
    # Of two loads of a pose each second row is of the next pose: both words say so.
    assert fault.name == "shuffled_rows"
    assert fault.detail.endswith("up" if steps > 0 else "down")


@pytest.fixture(scope="module")
def before_a_board():
    """The measured campaign of a camera on a robot, before a board."""
    folder = read_campaign_folder(
        BOX / "fr3_board", BOX.parents[1] / "config" / "robots"
    )
    return read_campaign(folder)


def invert(measurements):
    """Poses of the board in the camera, in place of the camera in the board."""
    inverse = Rotation.from_rotvec(measurements.rotation_vector).inv()
    return {
        "position": -inverse.apply(measurements.position),
        "rotation_vector": inverse.as_rotvec(),
    }


def mirror(measurements):
    """A board whose z axis points the other way in positions and rotations."""
    return {
        "position": measurements.position * [1, 1, -1],
        "rotation_vector": measurements.rotation_vector * [-1, -1, 1],
    }


@pytest.mark.parametrize(
    ("change", "name", "phrase"),
    [
        (lambda rows: {"position": 1000 * rows.position}, "wrong_unit", "millimetres"),
        (lambda rows: {"position": 1.2 * rows.position}, "wrong_scale", "0.8311 times"),
        (lambda rows: {"position": rows.position / 2}, "wrong_scale", "1.995 times"),
        (invert, "inverse_transform", "the board in the camera"),
        (mirror, "swapped_axes", "z = -z"),
    ],
    ids=["mm for m", "squares of another size", "half", "inverse", "mirrored"],
)
def test_faults_of_a_camera_before_a_board_are_named(
    before_a_board, change, name, phrase
):
    columns = change(before_a_board.measurements)
    (fault,) = find_better_interpretation(
        replace_measured_columns(before_a_board, **columns)
    )
    assert fault.name == name
    assert phrase in fault.detail
    assert fault.evidence[1] < fault.evidence[0] / 2


def test_a_camera_before_a_board_has_no_fault_and_small_scales_are_left_to_physics(
    before_a_board,
):
    assert find_better_interpretation(before_a_board) == []
    position = 1.04 * before_a_board.measurements.position
    scaled = replace_measured_columns(before_a_board, position=position)
    assert find_better_interpretation(scaled) == []


@pytest.mark.parametrize("is_link", [True, False], ids=["rotations", "positions"])
def test_positions_in_other_axes_of_the_camera_than_rotations_are_named(
    before_a_board, is_link
):
    columns = before_a_board.measurements
    link = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    axes = link if is_link else link.T
    # The measurements are poses of the camera in the board.
    camera = Rotation.from_rotvec(columns.rotation_vector)
    board_in_camera = camera.inv().apply(columns.position)
    position = camera.apply(board_in_camera @ axes.T)
    mixed = replace_measured_columns(before_a_board, position=position)
    (fault,) = find_better_interpretation(mixed)
    assert fault.name == "swapped_axes"
    assert "positions and rotations of the board have different axes" in fault.detail


def test_the_link_frame_of_a_camera_is_told_from_its_optical_frame(before_a_board):
    estimate = place_measurements(before_a_board).estimate
    mount = Rotation.from_matrix(estimate.target_rotation[0]).as_rotvec()
    target = replace(
        before_a_board.targets[0],
        rotation=tuple(mount),
        offset_m=tuple(estimate.target_offset[0]),
    )
    stated = replace(before_a_board, targets=(target,))
    assert find_better_interpretation(stated) == []
    optical = Rotation.from_rotvec(stated.measurements.rotation_vector)
    link = optical * Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    (fault,) = find_better_interpretation(
        replace_measured_columns(stated, rotation_vector=link.as_rotvec())
    )
    assert "optical frame (z forward, x right) and its link frame" in fault.detail
