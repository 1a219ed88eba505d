"""The kind `point`: its derivatives, and parameters that come back from a simulation."""

import numpy as np
from checked_kinds import check_derivatives
from contact_campaigns import check_recovery, open_workshop, spread_places

from elastocal.measuring.point import POINT
from elastocal_proof.plant.contacts import seat_in_socket


def measure(seed):
    """Rows of a ball in three sockets with play."""
    workshop = open_workshop(seed)
    places = spread_places(workshop, 3)
    return [
        {
            "angles": seat_in_socket(workshop, places[row % 3], 5e-5),
            "feature": f"socket{row % 3}",
        }
        for row in range(45)
    ]


DOCUMENT = {
    "measured": "point",
    "features": {f"socket{number}": {"kind": "point"} for number in range(3)},
    "noise": {"position_m": 5e-5},
}


def test_derivatives_are_those_of_the_residual():
    check_derivatives(POINT, np.array([0.1, 0.2, 0.3]), np.zeros((4, 3)))


def test_joint_offsets_and_tool_come_back_within_their_standard_errors(tmp_path):
    check_recovery(tmp_path / "cell", DOCUMENT, measure(2))


def measure_bar(seed, stands, length_m):
    """Rows of both ends of a bar that stands at so many places."""
    workshop = open_workshop(seed)
    rows = []
    while len(rows) < 2 * stands:
        first = workshop.find_tool(workshop.draw_angles())[0]
        direction = workshop.draws.standard_normal(3)
        second = first + length_m * direction / np.linalg.norm(direction)
        try:
            ends = [seat_in_socket(workshop, end, 5e-5) for end in (first, second)]
        except ValueError:
            continue
        session = len(rows) // 2
        for name, angles in zip("AB", ends, strict=True):
            rows.append({"angles": angles, "feature": name, "session": session})
    return rows


def test_a_known_distance_between_two_states_is_a_bar_with_a_session_for_each_place(
    tmp_path,
):
    between = {"between": ["A", "B"], "distance_m": 0.3, "std_m": 1e-6}
    document = {
        "measured": "point",
        "frame": "unknown",
        "features": {"A": {}, "B": {}},
        "distances": [between],
        "noise": {"position_m": 5e-5},
    }
    check_recovery(tmp_path / "cell", document, measure_bar(1, 60, 0.3))
