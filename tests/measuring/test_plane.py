"""The kind `plane`: its derivatives, and parameters that come back from a simulation."""

import numpy as np
from checked_kinds import check_derivatives
from contact_campaigns import check_recovery, open_workshop, spread_places
from support import refused

from elastocal.measuring.plane import PLANE
from elastocal.measuring.protocol import Feature
from elastocal_proof.plant.contacts import touch_plane

NORMALS = np.array([[0.0, 0.0, 1.0], [0.8, 0.6, 0.0], [0.0, 0.8, 0.6]])


def measure(seed):
    """Rows of a tip on three planes."""
    workshop = open_workshop(seed)
    (place,) = spread_places(workshop, 1)
    return [
        {
            "angles": touch_plane(workshop, normal, normal @ place, 3e-5),
            "feature": f"plane{number}",
        }
        for number, normal in enumerate(NORMALS)
        for _ in range(25)
    ]


DOCUMENT = {
    "measured": "plane",
    "features": {f"plane{number}": {"kind": "plane"} for number in range(3)},
    "noise": {"position_m": 3e-5},
}


def test_derivatives_are_those_of_the_residual():
    check_derivatives(PLANE, np.array([0.6, 0.0, 0.8, 0.3]), np.zeros((4, 1)))


def test_joint_offsets_and_tool_come_back_within_their_standard_errors(tmp_path):
    check_recovery(tmp_path / "cell", DOCUMENT, measure(2))


def test_a_stated_normal_holds_the_tilts_to_its_standard_deviation():
    stated = {"normal": [0.0, 0.0, 2.0], "normal_std_rad": 0.01}
    patch = Feature("patch", "plane", stated)
    assert [unknown.prior_std for unknown in PLANE.unknowns(patch)] == [
        0.01,
        0.01,
        None,
    ]
    start = PLANE.start(patch, np.zeros((3, 3)), np.zeros((3, 1)))
    tilted = PLANE.move(start, np.array([2e-4, -3e-4, 0.1]))
    np.testing.assert_allclose(
        PLANE.deviate(patch, tilted), [2e-4, -3e-4, 0.0], atol=1e-9
    )


def test_a_rough_normal_has_no_prior():
    rough = Feature("table", "plane", {"normal": [0, 0, 1]})
    assert all(unknown.prior_std is None for unknown in PLANE.unknowns(rough))


def test_a_standard_deviation_without_a_normal_is_refused():
    lacking = Feature("table", "plane", {"normal_std_rad": 0.01})
    with refused("campaign.yaml", "normal_std_rad", "normal beside it"):
        PLANE.unknowns(lacking)
