"""Noise that differs between directions and ranges is estimated and whitens the rows."""

from dataclasses import replace

import numpy as np
import pytest
from contact_campaigns import (
    TOOL_M,
    build_contact_case,
    count_std_errors,
    fit_contacts,
    open_workshop,
    read_ur10,
    write_contacts,
)
from scipy.spatial.transform import Rotation

from elastocal.fitting.noise import estimate_noise
from elastocal.fitting.sensor_noise import compute_sensor_roots, compute_target_std_m
from elastocal_proof.plant.contacts import find_view, see_board

END = read_ur10().chain.end_effector.name
DOCUMENT = {
    "measured": "board",
    "camera": "on_robot",
    "frame": "unknown",
    "targets": {"tip": {"point": END, "offset_m": "unknown", "rotation": "unknown"}},
}


# Position of the middle of the board in a frame with its origin at a corner, m.
MIDDLE_M = np.array([0.15, 0.1, 0.0])
NOISE = {"position_m": 3e-4, "orientation_rad": 8e-4}


def see_boards(folder, document=DOCUMENT, middle=(0.0, 0.0, 0.0), repeats=1):
    """See a board half a metre before a camera on the flange."""
    workshop = open_workshop(6, limits=0.45)
    position, rotation = workshop.find_tool(workshop.joint_limits.mean(axis=1))
    turn = Rotation.from_euler("x", 0.3).as_matrix()
    board = (position + rotation @ np.array([0.0, 0.0, 0.6]), rotation @ turn)
    rows = []
    for number in range(80 * repeats):
        pose, repeat = divmod(number, repeats)
        if repeat == 0:
            angles = find_view(workshop, board)
        seen, vector = see_board(workshop, angles, board, 2e-4, 0.2)
        seen = seen - Rotation.from_rotvec(vector).apply(middle)
        columns = dict(
            zip(("x", "y", "z", "rx", "ry", "rz"), [*seen, *vector], strict=True)
        )
        numbers = {"pose": pose, "repeat": repeat}
        rows.append({"angles": angles, **numbers, **columns})
    return write_contacts(folder / "cell", document, rows)


@pytest.fixture
def folder(tmp_path):
    """A board whose frame has its origin in the middle."""
    return see_boards(tmp_path)


def test_the_noise_of_a_camera_is_larger_along_the_view_and_in_the_tilt(folder):
    shaped = build_contact_case(folder).model.shaped_noise
    across, along, tilt, spin = shaped.factors
    # The board is 0.2 m wide and some 0.6 m away: the plant has a ratio of three.
    assert 2.0 < along / across < 4.5
    assert tilt > 1.5 * spin


def test_offsets_and_mount_come_back_and_the_whitened_residual_is_white(folder):
    fitted = fit_contacts(folder)
    assert fitted.converged
    assert np.abs(count_std_errors(fitted)).max() < 5.0
    np.testing.assert_allclose(fitted.estimate.target_offset[0], TOOL_M, atol=5e-3)
    white = fitted.whiten(fitted.residual)
    level = np.sqrt((white**2).mean(axis=0))
    assert level.max() < 2.0 * level.min()


def test_the_origin_of_the_board_does_not_change_its_noise(tmp_path, folder):
    corner = see_boards(tmp_path / "corner", middle=MIDDLE_M)
    expected, shaped = (
        build_contact_case(each).model.shaped_noise for each in (folder, corner)
    )
    moved = shaped.options["middle_m"] - expected.options["middle_m"]
    np.testing.assert_allclose(moved, MIDDLE_M, atol=0.02)
    np.testing.assert_allclose(shaped.factors, expected.factors, rtol=0.1)


def test_declared_noise_is_that_of_the_board_in_the_camera(tmp_path, folder):
    declared = see_boards(tmp_path / "declared", {**DOCUMENT, "noise": NOISE})
    estimated = build_contact_case(folder).model.shaped_noise
    case = build_contact_case(declared)
    shaped = case.model.shaped_noise
    shape = shaped.describe(case.observations)
    squares = (shape.sizes * shaped.factors[shape.groups]) ** 2
    np.testing.assert_allclose(
        np.sqrt(squares.reshape(-1, 2, 3).mean(axis=(0, 2))), list(NOISE.values())
    )
    assert shaped.reference_m == NOISE["position_m"]
    ratio = shaped.factors / estimated.factors
    assert ratio[0] == pytest.approx(ratio[1])
    assert ratio[2] == pytest.approx(ratio[3])


def test_noise_is_that_of_what_is_read_by_the_residual_and_by_repeats(tmp_path, folder):
    case = build_contact_case(folder)
    by_residual, _ = estimate_noise(case)
    repeated = build_contact_case(see_boards(tmp_path / "repeated", repeats=4))
    by_repeats, _ = estimate_noise(repeated)
    assert (by_residual.source, by_repeats.source) == ("residual", "repeats")
    # The plant's, an angle of view of 0.2 mrad and a board of 0.2 m.
    range_m = np.linalg.norm(case.observations.position, axis=1)
    variances = 2 * (2e-4 * range_m) ** 2 + (1e-3 * range_m**2) ** 2
    expected_m = np.sqrt(variances.mean() / 3)
    assert by_residual.position_m == pytest.approx(expected_m, rel=0.2)
    assert by_repeats.position_m == pytest.approx(expected_m, rel=0.2)


def test_the_noise_of_a_camera_on_the_robot_has_the_tilt_times_the_range(folder):
    fitted = fit_contacts(folder)
    observations = build_contact_case(folder).observations
    draws = np.random.default_rng(2).standard_normal((300, len(observations), 6, 1))
    roots = compute_sensor_roots(
        fitted.model, fitted.estimate, observations, fitted.noise
    )
    simulated = np.array([(roots @ draw)[:, :3, 0] for draw in draws])
    std_m = compute_target_std_m(
        fitted.model, fitted.estimate, observations, fitted.noise
    )
    assert std_m == pytest.approx(simulated.std(), rel=0.02)
    assert std_m > 2.0 * fitted.noise.position_m
    plain = replace(fitted.model, shaped_noise=None)
    assert (
        compute_target_std_m(plain, fitted.estimate, observations, fitted.noise)
        == fitted.noise.position_m
    )
