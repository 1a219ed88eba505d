"""The five lines of the README, on the arrays of a measured robot, reach the errors that
pages state."""

import os
from pathlib import Path

import numpy as np
import pytest

import elastocal as ec

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("ELASTOCAL_DATA", ROOT.parent / "shared" / "data"))
GRID = DATA / "jacobi_ur5" / "3D_UR5_uncalibrated_grid_cleaned.csv"
# Goal for this robot, whose calibrated geometry leaves 0.115 mm.
GOAL_M = 6.0e-5


@pytest.mark.slow
@pytest.mark.skipif(not GRID.is_file(), reason="the arrays of the UR5 are not here")
def test_five_lines_on_the_whole_grid_of_a_ur5_reach_the_stated_errors():
    """The noise is what the maker of the tracker states."""
    table = np.loadtxt(GRID, delimiter=",", skiprows=1)
    x = 1e-3 * (table[:, 1:4] + table[:, 4:7])
    q = np.radians(table[:, 7:13])
    robot = ec.read_robot(
        ROOT / "benchmarks/peers/ur5.urdf", base="base_link", tip="tool0"
    )
    noise = {"position_m": 15e-6}
    campaign = ec.Campaign(robot, joint_angles=q, positions=x, noise=noise)
    result = ec.diagnose(campaign)
    assert result.after.rms_m <= GOAL_M
    assert result.verdict.heldout.poses == 300
    effects = result.errors.iloc[-1]
    delivered_mm = f"{1e3 * result.after.rms_m:.4f}"
    bounds_mm = [
        f"{1e3 * effects[name]:.4f}"
        for name in ("heldout_rms_m", "heldout_rms_m_low", "heldout_rms_m_high")
    ]
    physics_mm = "{} ({}–{})".format(*bounds_mm)
    tables = (ROOT / "docs" / "other_packages_tables.md").read_text("utf-8")
    assert f"| {delivered_mm} " in tables
    assert f"| {physics_mm} " in tables
    for page in ("README.md", "docs/other_packages.md"):
        text = " ".join((ROOT / page).read_text("utf-8").split())
        assert delivered_mm in text, page
        assert f"{physics_mm} mm" in text, page
