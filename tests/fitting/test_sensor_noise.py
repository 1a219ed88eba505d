"""Noise that differs between directions and ranges is estimated and whitens the rows."""

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

from elastocal_proof.plant.contacts import see_board

END = read_ur10().chain.end_effector.name
DOCUMENT = {
    "measured": "board",
    "camera": "on_robot",
    "frame": "unknown",
    "targets": {"tip": {"point": END, "offset_m": "unknown", "rotation": "unknown"}},
}


@pytest.fixture
def folder(tmp_path):
    """A camera on the flange that sees a board half a metre before it."""
    workshop = open_workshop(6, limits=0.45)
    position, rotation = workshop.find_tool(workshop.joint_limits.mean(axis=1))
    turn = Rotation.from_euler("x", np.pi - 0.3).as_matrix()
    board = (position + rotation @ np.array([0.0, 0.0, 0.6]), rotation @ turn)
    rows = []
    for _ in range(80):
        angles = workshop.draw_angles()
        seen, vector = see_board(workshop, angles, board, 2e-4, 0.2)
        columns = dict(
            zip(("x", "y", "z", "rx", "ry", "rz"), [*seen, *vector], strict=True)
        )
        rows.append({"angles": angles, **columns})
    return write_contacts(tmp_path / "cell", DOCUMENT, rows)


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
