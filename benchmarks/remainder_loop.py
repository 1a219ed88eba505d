"""The loop closed on a robot whose smooth error no catalogue has: how near the
correction comes to chance alone.

A simulated KUKA: joint offsets; a deviation of joint 2 or 3 by two joints' angles at
once; a tracker of 50 µm; 20 µrad of error in each joint at each approach. It is
measured, diagnosed, commanded to other poses by physics alone and as delivered, and
measured again. `python benchmarks/remainder_loop.py POSES CAMPAIGNS SIZE` (rad) prints
a row for each campaign, and fails where the RMS of all as delivered is more than `GOAL`
times what chance leaves of a robot whose error is known.
"""

import argparse
import sys
import time

import numpy as np
from remainder_rates import (
    HELD_OUT,
    JOINT_RAD,
    NOISE_M,
    OFFSET_RAD,
    ROBOTS,
    measured_cases,
)

from elastocal.application.calibrated import CalibratedRobot, compute_nominal_poses
from elastocal.application.compensation import find_joint_targets
from elastocal.application.frames import root_mean_square, subtract_placement
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.settings import Settings
from elastocal.exchange.target_path import OK
from elastocal.loop.whole import build_calibrated_robot

GOAL = 1.3


def closed(poses: int, size: float, seed: int) -> dict[str, float]:
    """RMS errors of one robot, m: uncorrected, by physics, as delivered, and by chance
    alone."""
    robot = read_robot(ROBOTS / "kuka.yaml")
    draws = np.random.default_rng(seed)
    offsets = draws.normal(0.0, OFFSET_RAD, 6)
    two = draws.choice(5, 2, replace=False)
    moved = draws.choice([1, 2])
    phases = draws.uniform(0.0, 2.0 * np.pi, 2)

    def off(angles: np.ndarray, chance_rad: float = JOINT_RAD) -> np.ndarray:
        """By how much joints stand beyond what is reported, rad."""
        found = offsets + draws.normal(0.0, chance_rad, angles.shape)
        found[:, moved] += 2.0 * size * np.sin(angles[:, two] + phases).prod(axis=1)
        return found

    def surveyed(count: int, part: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
        plan = Plan(
            ("6DoF",), count, 100.0, (0,), (0.0, 0.0, 0.0), 1, 0, NOISE_M, NOISE_M
        )
        table = draw_measurements(robot, plan, 1000 * seed + part, "loop")
        return table, np.column_stack([table[f"q{joint}"] for joint in range(1, 7)])

    table, angles = surveyed(poses + HELD_OUT, 0)
    table |= {
        f"q{joint}": column for joint, column in enumerate((angles - off(angles)).T, 1)
    }
    case, held_out = measured_cases("loop", table, poses)
    found = diagnose(case, Settings(), seed)
    verdict = judge(found, held_out, seed)
    wanted = robot.reported_angles(surveyed(HELD_OUT, 1)[1])
    position, rotation = compute_nominal_poses(robot, wanted)

    def missed(calibrated: CalibratedRobot, commands: np.ndarray) -> float:
        """In the frame of the correction, of poses that are measured at some
        commands."""
        true = robot.model_angles(commands)
        reached, _ = compute_nominal_poses(
            robot, robot.reported_angles(true + off(true))
        )
        field = (reached + draws.normal(0.0, NOISE_M, reached.shape) - position)[
            ..., None
        ]
        left = subtract_placement(
            calibrated.scope,
            position,
            rotation,
            np.concatenate([field, 0 * field], axis=1),
        )
        return root_mean_square(left[:, :3, 0])

    corrected = {
        name: build_calibrated_robot(
            found, verdict.held_out, verdict.delivered, physics_only=name == "physics"
        )
        for name in ("physics", "delivered")
    }
    unloaded = np.zeros((len(wanted), 6))
    targets = {
        name: find_joint_targets(each, position, rotation, unloaded, wanted)
        for name, each in corrected.items()
    }
    good = np.all([each.status == OK for each in targets.values()], axis=0)
    position = position[good]
    rotation = rotation[good]
    wanted = wanted[good]
    known = robot.model_angles(wanted)
    for _ in range(4):
        known = robot.model_angles(wanted) - off(known, 0.0)
    errors = {
        name: missed(corrected[name], each.joint_angles[good])
        for name, each in targets.items()
    }
    ends = {
        name: missed(corrected["delivered"], each)
        for name, each in (("before", wanted), ("chance", robot.reported_angles(known)))
    }
    return ends | errors


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("poses", type=int)
    parser.add_argument("campaigns", type=int)
    parser.add_argument("size", type=float)
    asked = parser.parse_args()
    rows = []

    def words(row: dict[str, float]) -> str:
        return ", ".join(f"{name} {1e6 * value:.0f} µm" for name, value in row.items())

    for seed in range(asked.campaigns):
        start = time.process_time()
        rows.append(closed(asked.poses, asked.size, seed))
        print(words(rows[-1]), f"{time.process_time() - start:.1f} s CPU", flush=True)
    whole = {
        name: float(np.sqrt(np.mean([row[name] ** 2 for row in rows])))
        for name in rows[0]
    }
    ratio = whole["delivered"] / whole["chance"]
    print("all:", words(whole), f"delivered {ratio:.2f} times chance")
    sys.exit(ratio > GOAL)
