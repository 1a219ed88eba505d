"""What each defect does to a campaign stays what it was: other libraries agreed with
these numbers before they were kept.

Where a law is meant to change, write them anew: `GOLDEN=write python -m pytest
tests/plant/test_laws.py`.
"""

import os
from dataclasses import replace

import numpy as np
import pandas as pd
from analysed_robots import ROBOTS

from elastocal_proof.plant.arm import read_arm, to_rotation_vector
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.kinds import KINDS, apply_defects, draw_defect
from elastocal_proof.plant.simulated_robot import draw_specimen, simulate_poses

GOLDEN = ROBOTS.parents[1] / "tests/golden/plant_defects.csv"
DESIGN = Design(
    poses=5, held_out=1, repeats=2, repeated_poses=2, approach_each_load=False
)
KEY = ["arm", "kind", "seed"]


def digest(array):
    """A sum in which each number has a weight of its own, so that no sign and no order
    is lost."""
    return float(array.ravel() @ np.cos(1.0 + np.arange(array.size)))


def row_of(name, kind, seed):
    arm = read_arm(ROBOTS / f"{name}.yaml")
    schedule = draw_schedule(arm, DESIGN, seed)
    # As slow as a campaign of usual length, in which a stand that is knocked is so
    # between two of its poses.
    schedule = replace(schedule, time_s=5.0 * schedule.time_s)
    robot = draw_specimen(arm, seed)
    defect = draw_defect(kind, arm, seed)
    good, bad = (
        simulate_poses(one, schedule) for one in (robot, apply_defects(robot, [defect]))
    )
    turn = to_rotation_vector(bad[1] @ np.swapaxes(good[1], -1, -2))
    known = np.array([*defect.on(robot)[1].values()], float)
    found = {
        "shift_m": digest(bad[0] - good[0]),
        "turn_rad": digest(turn),
        "parameters": digest(known),
    }
    return (
        dict(zip(KEY, (name, kind, seed), strict=True)) | {"size": defect.size} | found
    )


def test_every_defect_does_what_it_did():
    arms = {name: read_arm(ROBOTS / f"{name}.yaml") for name in ("fanuc", "iiwa14")}
    rows = [
        (name, kind, seed)
        for name, arm in arms.items()
        for kind in sorted(KINDS)
        for seed in (3, 4)
        if KINDS[kind].locations(arm)
    ]
    table = pd.DataFrame([row_of(*row) for row in rows])
    if os.environ.get("GOLDEN") == "write":
        table.to_csv(GOLDEN, index=False)
    pd.testing.assert_frame_equal(table, pd.read_csv(GOLDEN), rtol=1e-6, atol=1e-13)
