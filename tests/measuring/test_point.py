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
