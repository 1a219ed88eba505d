"""How often the error bounds of single poses hold, on robots whose gears have play,
friction with a memory, or neither.

Simulated robots (`elastocal_proof.plant`, which shares no code with the fitted model)
are measured, diagnosed and commanded to poses that no model was fitted to, each
approached from sides that nobody states. `python benchmarks/pose_bounds.py ROBOTS
--seed SEED` prints, for each hidden effect, which share of the poses has an error within
the bound of 95 %, with an interval over robots, and how large bounds and errors are.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import ROBOTS

from elastocal.application.accuracy import predict_errors
from elastocal.application.calibrated import CalibratedRobot, predict_poses
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import apply_regression, remove_gross_errors
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import build_calibrated_robot, read_cases
from elastocal_proof.blind.folders import Experiment, write_blind_campaign
from elastocal_proof.blind.rehearsal import ERRORS_OF_GEOMETRY
from elastocal_proof.plant.arm import Arm, read_arm
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.kinds import KINDS, Defect, apply_defects
from elastocal_proof.plant.simulated_robot import (
    SimulatedRobot,
    draw_specimen,
    simulate_poses,
)

# Arms of six and seven joints.
ARMS = ("kuka", "fanuc", "iiwa14")
EFFECTS = ("hysteresis", "hysteresis twice", "lost_motion", "none")
# Sizes of a hidden effect, in plausible sizes.
SIZES = (1.0, 3.0)
REPEATABILITY_RAD = 5e-6
CAMPAIGN = Design(
    declared=ERRORS_OF_GEOMETRY, ladder=(0.0, 1.0, -1.0), covariates=("approach",)
)
# Poses that are commanded, without and with a load.
POSES = 60


def draw_robot(arm: Arm, effect: str, draws: np.random.Generator) -> SimulatedRobot:
    """Draw a robot with errors of geometry and a hidden effect at random joints."""
    seed = int(draws.integers(2**31))
    defects = []
    for name in ERRORS_OF_GEOMETRY:
        for joints in KINDS[name].locations(arm):
            size = KINDS[name].scale_plausible_size(arm) * draws.uniform()
            defects.append(Defect(name, joints, size, int(draws.integers(2**31))))
    name, *twice = effect.split()
    if name in KINDS:
        locations = KINDS[name].locations(arm)
        for index in draws.choice(len(locations), 1 + len(twice), replace=False):
            size = KINDS[name].scale_plausible_size(arm) * draws.uniform(*SIZES)
            defects.append(
                Defect(name, locations[index], size, int(draws.integers(2**31)))
            )
    specimen = replace(
        draw_specimen(arm, seed), repeatability_rad=(REPEATABILITY_RAD,) * arm.joints
    )
    return apply_defects(specimen, defects)


def calibrate(robot: SimulatedRobot, file: Path, seed: int) -> CalibratedRobot:
    """Measure, diagnose and calibrate a robot."""
    experiment = Experiment(robot, CAMPAIGN, draw_schedule(robot.arm, CAMPAIGN, seed))
    with TemporaryDirectory() as folder:
        write_blind_campaign(folder, "bounds", file, experiment, robot.arm.masses)
        training, held_out = read_cases(folder, ROBOTS)
    diagnosis = diagnose(training, Settings(), seed)
    kept = remove_gross_errors(diagnosis, held_out)[1]
    delivered = apply_regression(diagnosis, kept, seed)
    return build_calibrated_robot(diagnosis, kept, delivered)


def compare_bounds(
    calibrated: CalibratedRobot, robot: SimulatedRobot, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """True errors (N,) of a corrected robot at new poses, and their bounds, m."""
    design = replace(CAMPAIGN, poses=POSES, ladder=(0.0, 1.0), repeats=1)
    schedule = draw_schedule(robot.arm, design, seed)
    wrench = np.hstack([schedule.force, np.cross(schedule.lever, schedule.force)])
    predicted = predict_errors(calibrated, schedule.angle, wrench, draws=0)
    reached = simulate_poses(robot, schedule)[0][:, -1]
    expected = predict_poses(calibrated, schedule.angle, wrench)[0]
    return np.linalg.norm(reached - expected, axis=1), predicted.bound_m


def print_rates(
    effect: str, robots: Sequence[tuple[bool, float, float, float]]
) -> None:
    """Print a row for the robots in which an effect was named, and one for the others."""
    for named in (True, False):
        rows = np.array([row[1:] for row in robots if row[0] == named])
        if not len(rows):
            continue
        held, error_m, bound_m = rows.T
        half_width = (
            1.96 * held.std(ddof=1) / np.sqrt(len(held)) if len(held) > 1 else 1
        )
        print(
            f"{effect}, {'left out of the commands' if named else 'not left out'}:"
            f" {len(held)} robots, bounds hold in {100 * held.mean():.1f} %"
            f" ({100 * (held.mean() - half_width):.1f} to"
            f" {100 * min(held.mean() + half_width, 1):.1f}),"
            f" RMS error {1e6 * np.sqrt((error_m**2).mean()):.0f} um,"
            f" mean bound {1e6 * bound_m.mean():.0f} um",
            flush=True,
        )


def main() -> None:
    """Print the rates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", type=int, help="robots for each effect")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--effects", nargs="+", default=EFFECTS, choices=EFFECTS)
    arguments = parser.parse_args()
    for effect in arguments.effects:
        rows = []
        for number in range(arguments.robots):
            draws = np.random.default_rng(
                [arguments.seed, EFFECTS.index(effect), number]
            )
            file = ROBOTS / f"{ARMS[number % len(ARMS)]}.yaml"
            robot = draw_robot(read_arm(file), effect, draws)
            calibrated = calibrate(robot, file, int(draws.integers(2**31)))
            errors_m, bound_m = compare_bounds(
                calibrated, robot, int(draws.integers(2**31))
            )
            rows.append(
                (
                    bool(calibrated.scope.left_out),
                    float((errors_m <= bound_m).mean()),
                    float(np.sqrt((errors_m**2).mean())),
                    float(bound_m.mean()),
                )
            )
        print_rates(effect, rows)


if __name__ == "__main__":
    main()
