"""Every defect keeps its effect on a campaign.

Other libraries agreed with these numbers before they were recorded. If a law is meant
to change, record them again:
`GOLDEN=write python -m pytest --slow all tests/plant/test_laws.py`.
"""

import os
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS

from elastocal_proof.plant.arm import read_arm, to_rotation_vector
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.kinds import KINDS, apply_defects, draw_defect
from elastocal_proof.plant.simulated_robot import draw_specimen, simulate_poses

GOLDEN = ROBOTS.parents[1] / "tests/golden/plant_defects.csv"
DESIGN = Design(
    poses=5, held_out=1, repeats=2, repeated_poses=2, approach_each_load=False
)


def compute_digest(array):
    """A sum in which each number has a weight of its own, so that it depends on all
    signs and on the order."""
    return float(array.ravel() @ np.cos(1.0 + np.arange(array.size)))


def make_row(name, kind, seed):
    """Digests of what a defect does to a robot."""
    arm = read_arm(ROBOTS / f"{name}.yaml")
    schedule = draw_schedule(arm, DESIGN, seed)
    # The campaign takes as long as a usual one, so that a knock of the stand falls
    # between two of its poses.
    schedule = replace(schedule, time_s=5.0 * schedule.time_s)
    robot = draw_specimen(arm, seed)
    defect = draw_defect(kind, arm, seed)
    position, rotation = simulate_poses(robot, schedule)
    defective_position, defective_rotation = simulate_poses(
        apply_defects(robot, [defect]), schedule
    )
    turn = to_rotation_vector(defective_rotation @ np.swapaxes(rotation, -1, -2))
    parameters = np.array([*defect.on(robot)[1].values()], float)
    return {
        "arm": name,
        "kind": kind,
        "seed": seed,
        "size": defect.size,
        "shift_m": compute_digest(defective_position - position),
        "turn_rad": compute_digest(turn),
        "parameters": compute_digest(parameters),
    }


def make_table(seeds):
    """Digests of each kind of defect on some robots, by the names of the robots with
    the seeds of their specimens."""
    arms = {name: read_arm(ROBOTS / f"{name}.yaml") for name in seeds}
    return pd.DataFrame(
        [
            make_row(name, kind, seed)
            for name, arm in arms.items()
            for kind in sorted(KINDS)
            for seed in seeds[name]
            if KINDS[kind].locations(arm)
        ]
    )


@pytest.mark.slow
def test_every_defect_has_its_recorded_effect_on_two_specimens():
    table = make_table({"fanuc": (3, 4), "iiwa14": (3, 4)})
    if os.environ.get("GOLDEN") == "write":
        table.to_csv(GOLDEN, index=False)
    pd.testing.assert_frame_equal(table, pd.read_csv(GOLDEN), rtol=1e-6, atol=1e-13)


def test_every_defect_has_its_recorded_effect():
    table = make_table({"fanuc": (3,), "iiwa14": (4,)})
    recorded = pd.read_csv(GOLDEN)
    is_compared = (recorded["arm"] == "fanuc") == (recorded["seed"] == 3)
    recorded = recorded[is_compared].reset_index(drop=True)
    pd.testing.assert_frame_equal(table, recorded, rtol=1e-6, atol=1e-13)
