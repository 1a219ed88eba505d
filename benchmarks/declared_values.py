"""How often a diagnosis is wrong about what is declared, and about errors of poses.

Robots of the independent simulation with errors in their geometry, without weight and
without any effect that the catalogue could name beyond that geometry. `python
benchmarks/declared_values.py poses COUNT SEED --micrometres 20` draws robots with an
error that all measurements of a pose share, 50 to 300 µrad in each joint, at 20 poses
with five loads, and prints how many get an effect that they do not have. `python
benchmarks/declared_values.py offsets COUNT SEED --off-mm 0.3` draws robots with two
reflectors that sit elsewhere than declared, corrects the robot, and compares its true
tool with the bounds and the certificate; `--off-mm 0` is the same without such errors.
Robots with six and with seven axes take turns. A row for each robot, then the rates
with their Clopper-Pearson intervals of 95 %.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml
from common import ROBOTS, read_robot_document
from rates import format_count_rate

from elastocal.application.accuracy import predict_errors, select_campaign_commands
from elastocal.application.calibrated import CalibratedRobot, compute_nominal_poses
from elastocal.application.compensation import find_joint_targets
from elastocal.application.frames import root_mean_square, subtract_placement
from elastocal.campaigns.writing import write_campaign
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import Judgement
from elastocal.diagnosis.settings import Settings
from elastocal.exchange.target_path import OK
from elastocal.fitting.model import Case
from elastocal.loop.whole import (
    build_calibrated_robot,
    judge_and_predict,
    read_cases,
)
from elastocal.validation.conformity import PASS, decide_conformity
from elastocal_proof.plant.arm import build_arm, to_rotation_vector
from elastocal_proof.plant.campaigns import (
    Design,
    draw_schedule,
    simulate_measurements,
)
from elastocal_proof.plant.multibody import Structure
from elastocal_proof.plant.simulated_robot import (
    SimulatedRobot,
    Tracker,
    simulate_poses,
)

ARMS = ("kuka", "iiwa14", "ur5", "gen3")
LIMITED_TURN_DEG = 170.0
HELD_OUT = 20
# Geometry errors of each link, of an ordinary robot.
SHIFT_M = 2e-4
TURN_RAD = 2e-4
OFFSET_RAD = 3e-4
REPEATABILITY_RAD = 1e-5
# Declared places of two reflectors on a bracket.
REFLECTORS_M = np.array([[0.08, 0.03, 0.05], [0.02, -0.09, 0.06]])
TOLERANCES_M = (2e-4, 3e-4, 5e-4)
ACCEPTED_RISK = 0.05
CAMPAIGN = {
    "campaign": "declared",
    "robot": "robot.yaml",
    "measured": "position",
    "compliance": "nominal",
    "remainder": "none",
}


@dataclass(frozen=True)
class Specimen:
    """A simulated robot, its document, and where its reflectors sit (T, 3), m."""

    document: dict
    robot: SimulatedRobot
    declared_m: np.ndarray
    true_m: np.ndarray
    point: str

    def measure(self, angles: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Return true positions (S, 3), m, and rotations (S, 3, 3) of the tool."""
        design = Design(poses=len(angles), held_out=1, ladder=(0.0,), repeated_poses=0)
        schedule = draw_schedule(self.robot.arm, design, seed)
        position, rotation = simulate_poses(self.robot, replace(schedule, angle=angles))
        index = self.robot.arm.points.index(self.point)
        return position[:, index], rotation[:, index]


def read_weightless(name: str) -> dict:
    """Read a robot file without masses and compliances, its joints within half a turn
    to either side."""
    document = read_robot_document(name)
    document = {
        key: value
        for key, value in document.items()
        if key in ("name", "chain", "lengths_m", "joint_limits_deg", "payload_kg")
    }
    limits = np.array(document["joint_limits_deg"], float)
    document["joint_limits_deg"] = limits.clip(
        -LIMITED_TURN_DEG, LIMITED_TURN_DEG
    ).tolist()
    return document


def read_compliant(name: str) -> dict:
    """Read a robot file as `read_weightless`, but with its compliances."""
    key = "compliance_urad_per_Nm"
    return read_weightless(name) | {key: read_robot_document(name)[key]}


def draw_specimen(name: str, seed: int, off_m: float, pose_rad: float) -> Specimen:
    """Draw a robot without weight; `off_m` is how far each reflector sits off."""
    document = read_weightless(name)
    joints = len(document["joint_limits_deg"])
    arm = build_arm(document | {"compliance_urad_per_Nm": [1.0] * joints, "masses": []})
    draws = np.random.default_rng([seed, 63])
    errors = {
        link: (draws.normal(0.0, SHIFT_M, 3), draws.normal(0.0, TURN_RAD, 3))
        for link in range(arm.joints + 1)
    }
    offsets = draws.normal(0.0, OFFSET_RAD, arm.joints)
    robot = SimulatedRobot(
        arm,
        np.zeros(arm.joints),
        Structure(geometry_errors=errors),
        drives=tuple(
            (joint, lambda _, size=size: size) for joint, size in enumerate(offsets)
        ),
        repeatability_rad=(REPEATABILITY_RAD,) * arm.joints,
        pose_rad=(pose_rad,) * arm.joints,
    )
    direction = draws.standard_normal(REFLECTORS_M.shape)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return Specimen(
        document, robot, REFLECTORS_M, REFLECTORS_M + off_m * direction, arm.points[-1]
    )


def draw_cases(
    specimen: Specimen, poses: int, noise_m: float, seed: int, frame: str
) -> tuple[Case, Case]:
    """Measure a robot at random poses, and read its campaign."""
    draws = np.random.default_rng([seed, 64])
    low, high = np.deg2rad(np.array(specimen.document["joint_limits_deg"])).T
    angles = draws.uniform(low, high, (poses + HELD_OUT, len(low)))
    position, rotation = specimen.measure(angles, seed)
    targets = len(specimen.true_m)
    measured = position[:, None] + np.einsum("sij,tj->sti", rotation, specimen.true_m)
    measured += draws.normal(0.0, noise_m, measured.shape)
    number = np.repeat(np.arange(len(angles)), targets)
    zeros = np.zeros(len(number))
    table = {"pose": number, "load": zeros.astype(int), "repeat": zeros.astype(int)}
    table |= {f"q{joint}": column[number] for joint, column in enumerate(angles.T, 1)}
    table |= dict.fromkeys(("fx", "fy", "fz", "mx", "my", "mz"), zeros)
    table["target"] = np.tile([f"T{index}" for index in range(targets)], len(angles))
    table |= dict(zip("xyz", measured.reshape(-1, 3).T, strict=True))
    document = CAMPAIGN | {
        "frame": frame,
        "targets": {
            f"T{index}": {"point": specimen.point, "offset_m": offset.tolist()}
            for index, offset in enumerate(specimen.declared_m)
        },
        "declared": ["joint_offset", "link_geometry"],
        "noise": {"position_m": noise_m},
        "holdout": {"poses": list(range(poses, poses + HELD_OUT))},
    }
    return write_and_read(document, table, specimen.document, len(low))


def write_and_read(
    document: dict, table: dict, robot: dict, joints: int
) -> tuple[Case, Case]:
    """Write a campaign and its robot file, and read its cases."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "declared"
        write_campaign(path, document, table, joints, "csv")
        (path / "robot.yaml").write_text(yaml.safe_dump(robot))
        return read_cases(path, ROBOTS)


def draw_pose_error_case(name: str, seed: int, pose_rad: float, noise_m: float) -> Case:
    """Measure a robot with a pose error, and no other error, under five loads at 20
    poses."""
    document = read_compliant(name)
    arm = build_arm(document | {"masses": []})
    design = Design(
        poses=20 + HELD_OUT,
        held_out=HELD_OUT,
        repeated_poses=0,
        points=arm.points[-2:],
        covariates=(),
        measured="position",
    )
    robot = SimulatedRobot(
        arm,
        arm.compliance,
        tracker=Tracker(sigma_m=noise_m),
        repeatability_rad=(REPEATABILITY_RAD / 10,) * arm.joints,
        pose_rad=(pose_rad,) * arm.joints,
    )
    campaign = CAMPAIGN | {
        "frame": "base",
        "targets": {
            point: {"point": point, "offset_m": "unknown"} for point in design.points
        },
        "declared": ["joint_offset"],
        "noise": {"position_m": noise_m},
        "holdout": {"poses": list(range(20, 20 + HELD_OUT))},
    }
    table = simulate_measurements(robot, design, draw_schedule(arm, design, seed))
    return write_and_read(campaign, table, document, arm.joints)[0]


def measure_false_effects(seed: int, noise_m: float) -> bool:
    """Diagnose a robot with a pose error; return whether it gets an effect that it does
    not have."""
    name = ARMS[seed % len(ARMS)]
    pose_rad = np.random.default_rng([seed, 65]).uniform(5e-5, 3e-4)
    case = draw_pose_error_case(name, seed, pose_rad, noise_m)
    diagnosis = diagnose(case, Settings(), seed)
    verdict = diagnosis.verdict
    names = [effect.name for effect in verdict.effects]
    print(
        f"{seed} {name} {1e6 * pose_rad:.0f} µrad: {verdict.verdict} {names}",
        f"estimated {1e6 * diagnosis.final.noise.pose_rad:.0f} µrad",
        [warning for warning in verdict.warnings if "end of" in warning],
        flush=True,
    )
    return bool(names)


@dataclass(frozen=True)
class Outcome:
    """What became of a corrected robot: `passes` by tolerance, whether true errors deny
    them, share of targets within their bounds, and errors, m."""

    passes: np.ndarray
    denied: np.ndarray
    within: float
    true_rms_m: float
    bound_m: float
    held_out_rms_m: float

    @property
    def text(self) -> str:
        """The outcome in a line."""
        return (
            f"true {1e3 * self.true_rms_m:.3f} mm, bound {1e3 * self.bound_m:.3f},"
            f" within {100 * self.within:.0f} %, passes {self.passes.astype(int)},"
            f" denied {self.denied.astype(int)},"
            f" held out {1e3 * self.held_out_rms_m:.3f} mm"
        )


def measure_true_errors(
    specimen: Specimen, calibrated: CalibratedRobot, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Command the poses of a campaign by a calibrated robot, and measure the true tool.

    Returns (R,) position errors, m, in the frame of the correction, of the poses that it
    reaches, and (S,) of bool which these are.
    """
    commands, wrench = select_campaign_commands(calibrated)
    position, rotation = compute_nominal_poses(calibrated.robot, commands)
    correction = find_joint_targets(calibrated, position, rotation, wrench, commands)
    reached = correction.status == OK
    angles = calibrated.robot.model_angles(correction.joint_angles[reached])
    true_position, true_rotation = specimen.measure(angles, seed)
    position, rotation = position[reached], rotation[reached]
    turn = to_rotation_vector(true_rotation @ rotation.transpose(0, 2, 1))
    field = np.concatenate([true_position - position, turn], axis=1)
    placed = subtract_placement(calibrated.scope, position, rotation, field[..., None])
    return np.linalg.norm(placed[:, :3, 0], axis=1), reached


def calibrate(
    case: Case, held_out: Case, seed: int
) -> tuple[Judgement, CalibratedRobot]:
    """Diagnose and judge a robot, and build it with what is delivered."""
    diagnosis = diagnose(case, Settings(), seed)
    judgement = judge_and_predict(diagnosis, held_out, seed)
    calibrated = build_calibrated_robot(
        diagnosis, judgement.held_out, judgement.delivered
    )
    return judgement, calibrated


def correct_specimen(seed: int, off_m: float, noise_m: float, poses: int) -> Outcome:
    """Diagnose and correct a robot, and compare its true tool with what is stated."""
    name = ARMS[seed % len(ARMS)]
    specimen = draw_specimen(name, seed, off_m, 0.0)
    frame = ("base", "tracker")[seed // len(ARMS) % 2]
    case, held_out = draw_cases(specimen, poses, noise_m, seed, frame)
    judgement, calibrated = calibrate(case, held_out, seed)
    error_m, reached = measure_true_errors(specimen, calibrated, seed)
    prediction = predict_errors(calibrated, *select_campaign_commands(calibrated))
    decisions = [
        decide_conformity(prediction.rms_m, tolerance, ACCEPTED_RISK).decision
        for tolerance in TOLERANCES_M
    ]
    passes = np.array(decisions) == PASS
    outcome = Outcome(
        passes,
        passes & (root_mean_square(error_m) > np.array(TOLERANCES_M)),
        float((error_m <= prediction.bound_m[reached]).mean()),
        root_mean_square(error_m),
        float(np.median(prediction.bound_m)),
        judgement.verdict.heldout.delivered.rms_m,
    )
    names = [effect.name for effect in judgement.verdict.effects]
    print(f"{seed} {name} {frame}: {judgement.verdict.verdict} {names}", outcome.text)
    return outcome


def summarize(outcomes: list[Outcome]) -> None:
    """Print the rates of corrected robots."""
    passes = sum(int(outcome.passes.sum()) for outcome in outcomes)
    denied = sum(int(outcome.denied.sum()) for outcome in outcomes)
    within = np.array([outcome.within for outcome in outcomes])
    std_error = within.std(ddof=1) / np.sqrt(len(within))
    error = np.mean([outcome.true_rms_m for outcome in outcomes])
    held_out = np.mean([outcome.held_out_rms_m for outcome in outcomes])
    bound = np.mean([outcome.bound_m for outcome in outcomes])
    robots_denied = sum(bool(outcome.denied.any()) for outcome in outcomes)
    print("certificates that the true errors deny,", format_count_rate(denied, passes))
    print("robots with one,", format_count_rate(robots_denied, len(outcomes)))
    print(f"within the bound: {100 * within.mean():.1f} ± {196 * std_error:.1f} %")
    print(f"mean true error {1e3 * error:.3f} mm, bound {1e3 * bound:.3f} mm,")
    print(f"held-out RMS {1e3 * held_out:.4f} mm")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("poses", "offsets"))
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--off-mm", type=float, default=0.3)
    parser.add_argument("--micrometres", type=float, default=20.0)
    parser.add_argument("--poses", type=int, default=60)
    arguments = parser.parse_args()
    noise_m = 1e-6 * arguments.micrometres
    seeds = range(arguments.seed, arguments.seed + arguments.count)
    if arguments.what == "poses":
        false = sum(measure_false_effects(seed, noise_m) for seed in seeds)
        print("robots with a false effect,", format_count_rate(false, len(seeds)))
        return
    off_m = 1e-3 * arguments.off_mm
    summarize(
        [correct_specimen(seed, off_m, noise_m, arguments.poses) for seed in seeds]
    )


if __name__ == "__main__":
    main()
