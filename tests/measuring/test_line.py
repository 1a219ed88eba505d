"""The kind `line`: its derivatives, and parameters that come back from a simulation."""

import numpy as np
from checked_kinds import check_derivatives
from contact_campaigns import check_recovery, open_workshop

from elastocal.measuring.line import LINE
from elastocal_proof.plant.contacts import read_gauge

AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8]])


def measure(seed):
    """Rows of two dial gauges."""
    workshop = open_workshop(seed)
    rows = []
    for row in range(80):
        angles = workshop.draw_angles()
        reading = read_gauge(workshop, angles, AXES[row % 2], 2e-5)
        rows.append({"angles": angles, "feature": f"gauge{row % 2}", "value": reading})
    return rows


DOCUMENT = {
    "measured": "line",
    "features": {"gauge0": {}, "gauge1": {}},
    "noise": {"position_m": 2e-5},
}


def test_derivatives_are_those_of_the_residual():
    check_derivatives(LINE, np.array([0.6, 0.0, 0.8, 0.3]), np.ones((4, 1)))


def test_joint_offsets_and_tool_come_back_within_their_standard_errors(tmp_path):
    check_recovery(tmp_path / "cell", DOCUMENT, measure(2))
