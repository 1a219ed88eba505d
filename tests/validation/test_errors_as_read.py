"""Errors of a board are stated as the camera reads it, beside those of the camera."""

import numpy as np
import pytest
from contact_campaigns import (
    ROBOTS,
    build_contact_case,
    fit_contacts,
    open_workshop,
    read_ur10,
    write_contacts,
)
from scipy.spatial.transform import Rotation

from elastocal.loop.whole import diagnose_folder
from elastocal.validation.held_out import compute_errors_as_read
from elastocal_proof.plant.contacts import see_board

COLUMNS = ("x", "y", "z", "rx", "ry", "rz")
END = read_ur10().chain.end_effector.name
DOCUMENT = {
    "measured": "board",
    "frame": "unknown",
    "targets": {"tip": {"point": END, "offset_m": "unknown", "rotation": "unknown"}},
}
# An error of one reading: the board is seen elsewhere and turned, in the camera's axes.
SHIFT_M = np.array([1e-3, -2e-3, 3e-3])
TURN_RAD = np.array([2e-3, 0.0, -1e-3])


def measure(seed, noise_rad, count=60):
    """Rows of a board half a metre before the camera on the flange."""
    workshop = open_workshop(seed, limits=0.45)
    position, rotation = workshop.find_tool(workshop.joint_limits.mean(axis=1))
    board = position + 0.6 * rotation[:, 2], rotation
    rows = []
    for _ in range(count):
        angles = workshop.draw_angles()
        seen, vector = see_board(workshop, angles, board, noise_rad, 0.2)
        rows.append(
            {"angles": angles, **dict(zip(COLUMNS, [*seen, *vector], strict=True))}
        )
    return rows


def read_positions(rows):
    """Positions (N, 3), m, of the board in the camera."""
    return np.array([(row["x"], row["y"], row["z"]) for row in rows])


@pytest.mark.parametrize("camera", ["on_robot", "beside_robot"])
def test_the_error_of_a_reading_is_stated_in_the_axes_of_the_camera(tmp_path, camera):
    rows = measure(6, 0.0)
    if camera == "beside_robot":
        # The same geometry with board and camera exchanged.
        for row in rows:
            seen = np.array([row[name] for name in COLUMNS])
            inverse = Rotation.from_rotvec(seen[3:]).inv()
            exchanged = [*-inverse.apply(seen[:3]), *inverse.as_rotvec()]
            row.update(zip(COLUMNS, exchanged, strict=True))
    document = {**DOCUMENT, "camera": camera}
    document["noise"] = {"position_m": 1e-5, "orientation_rad": 1e-5}
    document["holdout"] = {"poses": [1, 2, 3]}
    fitted = fit_contacts(write_contacts(tmp_path / "exact", document, rows))
    wrong = rows[0]
    seen = np.array([wrong[name] for name in COLUMNS])
    turned = Rotation.from_rotvec(TURN_RAD) * Rotation.from_rotvec(seen[3:])
    wrong.update(zip(COLUMNS, [*seen[:3] + SHIFT_M, *turned.as_rotvec()], strict=True))
    case = build_contact_case(write_contacts(tmp_path / "wrong", document, rows))
    errors = compute_errors_as_read(
        fitted.model, fitted.estimate, case.observations, case.campaign.measuring
    )
    np.testing.assert_allclose(errors[0], [*SHIFT_M, *TURN_RAD], atol=2e-6)
    np.testing.assert_allclose(errors[1:], 0.0, atol=2e-6)


def test_a_verdict_states_the_board_in_the_camera(tmp_path):
    document = {**DOCUMENT, "camera": "on_robot", "campaign": "cell"}
    document["holdout"] = {"poses": list(range(20))}
    rows = measure(7, 1e-4)
    write_contacts(tmp_path / "cell", document, rows)
    heldout = diagnose_folder(tmp_path / "cell", ROBOTS, 1)["heldout"]
    in_camera = heldout["in_camera"]
    assert in_camera["after_m"] < in_camera["before_m"]
    # Forty fitted poses leave little but the noise of the twenty held-out ones.
    noise = read_positions(rows[:20]) - read_positions(measure(7, 0.0)[:20])
    rms_m = np.sqrt((noise**2).sum(axis=1).mean())
    assert in_camera["after_m"] == pytest.approx(rms_m, rel=0.25)
    # The camera itself is off by the tilt of the board too, over the range.
    assert heldout["after"]["rms_m"] > 1.5 * in_camera["after_m"]
