"""The kind `sphere`: its derivatives, and parameters that come back from a simulation."""

import numpy as np
from checked_kinds import check_derivatives
from contact_campaigns import check_recovery, open_workshop, spread_places

from elastocal.measuring.sphere import SPHERE
from elastocal_proof.plant.contacts import touch_sphere


def measure(seed):
    """Rows of a tip on two spheres."""
    workshop = open_workshop(seed)
    places = spread_places(workshop, 2)
    return [
        {
            "angles": touch_sphere(workshop, places[row % 2], 0.03, 3e-5),
            "feature": f"ball{row % 2}",
        }
        for row in range(70)
    ]


DOCUMENT = {
    "measured": "sphere",
    "features": {
        f"ball{number}": {"radius_m": 0.03, "radius_std_m": 1e-5} for number in range(2)
    },
    "noise": {"position_m": 3e-5},
}


def test_derivatives_are_those_of_the_residual():
    check_derivatives(SPHERE, np.array([0.1, 0.2, 3.0, 0.05]), np.zeros((4, 1)))


def test_joint_offsets_and_tool_come_back_within_their_standard_errors(tmp_path):
    check_recovery(tmp_path / "cell", DOCUMENT, measure(2))
