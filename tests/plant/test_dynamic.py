"""The tracker's dynamic mode: a smooth path within the limits, and deflections as at rest."""

from dataclasses import replace

import numpy as np

from elastocal_proof.plant.defects import Defect, with_defects
from elastocal_proof.plant.dynamic import _unloaded, dynamic_table, moving_angles
from elastocal_proof.plant.physical_robot import seen_poses
from elastocal_proof.plant.tracker import Tracker

SILENT = Tracker(sigma_m=0.0, sigma_rad=0.0)


def test_the_path_is_slow_within_the_limits_and_uses_most_of_them(arm):
    time = np.arange(0.0, 1000.0, 0.1)
    angle = moving_angles(arm, time, 1)
    low, high = arm.limits.T
    assert (angle >= low).all() and (angle <= high).all()
    assert (np.ptp(angle, axis=0) > 0.4 * (high - low)).all()
    # Rad/s^2: at two metres less than a sixteenth of what weight does.
    assert np.abs(np.diff(angle, 2, axis=0)).max() / 0.1**2 < 0.3


def test_measurements_are_those_of_the_arm_at_rest_at_each_angle(fanuc_specimen):
    """Of gears with play and errors of their teeth too, to far below a tracker's noise."""
    defects = [Defect("lost_motion", (3,), 1e-4, 1), Defect("transmission_harmonic", (2,), 1e-4, 1)]
    robot = replace(with_defects(fanuc_specimen, defects), tracker=SILENT)
    table = dynamic_table(robot, 3000, 4)
    angle = np.column_stack([table[f"q{joint}"] for joint in range(1, 7)])
    some = slice(None, None, 37)
    exact = seen_poses(robot, _unloaded(angle[some], table["time_s"][some], 4))[0][:, -1]
    found = np.column_stack([table[axis] for axis in "xyz"])[some]
    np.testing.assert_allclose(found, exact, atol=2e-7)
    weightless = replace(robot, structure=replace(robot.structure, masses=()))
    still = seen_poses(weightless, _unloaded(angle[some], table["time_s"][some], 4))[0][:, -1]
    assert np.abs(still - exact).max() > 1e-3
