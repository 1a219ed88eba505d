"""The kind `distance`: its derivatives, and parameters that come back from a simulation."""

import numpy as np
from checked_kinds import check_derivatives
from contact_campaigns import check_recovery, open_workshop

from elastocal.measuring.distance import DISTANCE
from elastocal_proof.plant.contacts import read_length

ANCHORS = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.5]])
ZEROS_M = (0.0, 0.2)


def measure(seed):
    """Rows of two draw wires, one of which does not start at zero."""
    workshop = open_workshop(seed)
    rows = []
    for row in range(80):
        wire = row % 2
        angles = workshop.draw_angles()
        length = read_length(workshop, angles, ANCHORS[wire], 5e-5) + ZEROS_M[wire]
        rows.append({"angles": angles, "feature": f"wire{wire}", "value": length})
    return rows


DOCUMENT = {
    "measured": "distance",
    "features": {"wire0": {}, "wire1": {"zero_m": "unknown"}},
    "noise": {"position_m": 5e-5},
}


def test_derivatives_are_those_of_the_residual():
    check_derivatives(DISTANCE, np.array([0.1, 0.2, 3.0, 0.05]), np.ones((4, 1)))


def test_joint_offsets_and_tool_come_back_within_their_standard_errors(tmp_path):
    check_recovery(tmp_path / "cell", DOCUMENT, measure(2))
