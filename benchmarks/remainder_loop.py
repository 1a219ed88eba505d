"""Close the loop on a robot with a smooth error that the catalogue lacks.

The correction is compared with the noise floor.

A simulated KUKA: joint offsets; a deviation of joint 2 or 3 by two joints' angles at
once; a tracker of 50 µm; 20 µrad of error in each joint at each approach. It is
measured, diagnosed, commanded to other poses by physics alone and as delivered, and
measured again. `python benchmarks/remainder_loop.py POSES CAMPAIGNS SIZE` (rad) prints
a row for each campaign, and fails where the RMS of all as delivered is more than `GOAL`
times what chance leaves of a robot whose error is known.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass

import numpy as np
from common import ROBOTS
from remainder_rates import (
    HELD_OUT,
    JOINT_RAD,
    NOISE_M,
    OFFSET_RAD,
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
from elastocal.loop.whole import build_calibrated_robot, remove_regression
from elastocal.mechanics.robot import Robot

GOAL = 1.3


@dataclass(frozen=True)
class DeviatingRobot:
    """A simulated KUKA with joint offsets and a deviation that no effect describes.

    Attributes
    ----------
    robot : Robot
    seed : int
        Seed of the campaigns.
    draws : numpy Generator
        Draws errors of approach and of the tracker.
    offsets : (6,) array, rad
    deviating_joint : int
    two_joints : (2,) array
        Joints whose angles the deviation depends on.
    phases : (2,) array, rad
    size_rad : float
    """

    robot: Robot
    seed: int
    draws: np.random.Generator
    offsets: np.ndarray
    deviating_joint: int
    two_joints: np.ndarray
    phases: np.ndarray
    size_rad: float

    @classmethod
    def draw(cls, seed: int, size_rad: float) -> DeviatingRobot:
        draws = np.random.default_rng(seed)
        offsets = draws.normal(0.0, OFFSET_RAD, 6)
        two_joints = draws.choice(5, 2, replace=False)
        return cls(
            read_robot(ROBOTS / "kuka.yaml"),
            seed,
            draws,
            offsets,
            deviating_joint=draws.choice([1, 2]),
            two_joints=two_joints,
            phases=draws.uniform(0.0, 2.0 * np.pi, 2),
            size_rad=size_rad,
        )

    def joint_errors(
        self, angles: np.ndarray, approach_rad: float = JOINT_RAD
    ) -> np.ndarray:
        """Draw how far the joints are from their reported angles, rad."""
        errors = self.offsets + self.draws.normal(0.0, approach_rad, angles.shape)
        waves = np.sin(angles[:, self.two_joints] + self.phases)
        errors[:, self.deviating_joint] += 2.0 * self.size_rad * waves.prod(axis=1)
        return errors

    def draw_campaign(
        self, poses: int, number: int
    ) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Draw measurements of random poses, and their joint angles."""
        plan = Plan(
            ("6DoF",), poses, 100.0, (0,), (0.0, 0.0, 0.0), 1, 0, NOISE_M, NOISE_M
        )
        stream = 1000 * self.seed + number
        table = draw_measurements(self.robot, plan, stream, "loop")
        return table, np.column_stack([table[f"q{joint}"] for joint in range(1, 7)])

    def commands_without_error(self, wanted: np.ndarray) -> np.ndarray:
        """Compute the joint targets of somebody who knows the errors of the joints."""
        angles = self.robot.model_angles(wanted)
        for _ in range(4):
            angles = self.robot.model_angles(wanted) - self.joint_errors(angles, 0.0)
        return self.robot.reported_angles(angles)

    def measure(self, commands: np.ndarray) -> np.ndarray:
        """Draw the measured positions (N, 3) after some joint commands."""
        angles = self.robot.model_angles(commands)
        true_angles = angles + self.joint_errors(angles)
        reached, _ = compute_nominal_poses(
            self.robot, self.robot.reported_angles(true_angles)
        )
        return reached + self.draws.normal(0.0, NOISE_M, reached.shape)


def close_loop(poses: int, size: float, seed: int) -> dict[str, float]:
    """Diagnose, correct and measure one robot again.

    Returns
    -------
    dict
        RMS errors, m: uncorrected (before), as a robot with known errors (chance), by
        physics alone (physics), and with the regression (delivered).
    """
    deviating = DeviatingRobot.draw(seed, size)
    table, angles = deviating.draw_campaign(poses + HELD_OUT, 0)
    reported = angles - deviating.joint_errors(angles)
    table |= {f"q{joint}": column for joint, column in enumerate(reported.T, 1)}
    case, held_out = measured_cases("loop", table, poses)
    diagnosis = diagnose(case, Settings(), seed)
    judgement = judge(diagnosis, held_out, seed)
    delivered = build_calibrated_robot(
        diagnosis, judgement.held_out, judgement.delivered
    )
    physics = remove_regression(delivered, diagnosis, judgement.held_out)
    return measure_corrections(deviating, {"physics": physics, "delivered": delivered})


def measure_corrections(
    deviating: DeviatingRobot, corrected: dict[str, CalibratedRobot]
) -> dict[str, float]:
    """Command new poses by each correction, and measure them; see `close_loop`."""
    robot = deviating.robot
    wanted = robot.reported_angles(deviating.draw_campaign(HELD_OUT, 1)[1])
    position, rotation = compute_nominal_poses(robot, wanted)
    unloaded = np.zeros((len(wanted), 6))
    corrections = {
        name: find_joint_targets(calibrated, position, rotation, unloaded, wanted)
        for name, calibrated in corrected.items()
    }
    reached = np.all(
        [correction.status == OK for correction in corrections.values()], axis=0
    )
    commands = {
        name: correction.joint_angles[reached]
        for name, correction in corrections.items()
    }
    commands |= {
        "before": wanted[reached],
        "chance": deviating.commands_without_error(wanted[reached]),
    }
    errors = {}
    for name in ("physics", "delivered", "before", "chance"):
        calibrated = corrected.get(name, corrected["delivered"])
        error = deviating.measure(commands[name]) - position[reached]
        field = np.concatenate([error[..., None], 0 * error[..., None]], axis=1)
        # Errors are those in the frame of the correction.
        placed = subtract_placement(
            calibrated.scope, position[reached], rotation[reached], field
        )
        errors[name] = root_mean_square(placed[:, :3, 0])
    return {name: errors[name] for name in ("before", "chance", "physics", "delivered")}


def describe(errors_m: dict[str, float]) -> str:
    return ", ".join(f"{name} {1e6 * error:.0f} µm" for name, error in errors_m.items())


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("poses", type=int)
    parser.add_argument("campaigns", type=int)
    parser.add_argument("size", type=float)
    arguments = parser.parse_args()
    rows = []
    for seed in range(arguments.campaigns):
        start = time.process_time()
        rows.append(close_loop(arguments.poses, arguments.size, seed))
        seconds = time.process_time() - start
        print(describe(rows[-1]), f"{seconds:.1f} s CPU", flush=True)
    total = {}
    for name in rows[0]:
        total[name] = float(np.sqrt(np.mean([row[name] ** 2 for row in rows])))
    ratio = total["delivered"] / total["chance"]
    print("all:", describe(total), f"delivered {ratio:.2f} times chance")
    sys.exit(ratio > GOAL)
