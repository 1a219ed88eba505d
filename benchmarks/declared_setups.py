"""How often a diagnosis is wrong if a load or a tracker sits elsewhere than declared.

Both parts give the same measurements to a diagnosis that knows how well they are
declared, and to one that takes them for exact. `python benchmarks/declared_setups.py
point COUNT SEED --newtons 800 --off-mm 5` draws robots without any effect whose load
acts beside its declared point, and prints how many get an effect other than that point,
and how many identified compliances are within their intervals of 95 %. `python
benchmarks/declared_setups.py sessions COUNT SEED --off-mm 0.2` draws robots with errors
in their geometry that are measured in four sessions, each after a new registration of
the tracker; it prints how many get an effect, and compares the true tool of the
corrected robot with the bounds; the base itself is no false effect. Rates have
Clopper-Pearson intervals of 95 %.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from declared_values import (
    ARMS,
    CAMPAIGN,
    HELD_OUT,
    Specimen,
    calibrate,
    draw_specimen,
    measure_true_errors,
    read_compliant,
    write_and_read,
)
from rates import format_count_rate
from scipy.spatial.transform import Rotation

from elastocal.application.accuracy import predict_errors, select_campaign_commands
from elastocal.application.frames import root_mean_square
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.model import Case
from elastocal_proof.plant.arm import build_arm
from elastocal_proof.plant.campaigns import (
    Design,
    draw_schedule,
    get_typical_force_N,
    simulate_measurements,
)
from elastocal_proof.plant.simulated_robot import LoadCell, SimulatedRobot, Tracker

HEAVY_ROBOTS = ("kuka", "fanuc")
SESSIONS = 4
POSES = 60
NOISE_M = 2e-5
COVERAGE_FACTOR = 1.96


@dataclass(frozen=True)
class Outcome:
    """What became of one robot: names of its effects, and how many of so many stated
    intervals or bounds hold; errors of the corrected robot and its bounds, m."""

    names: list[str]
    hits: int
    total: int
    true_rms_m: float = 0.0
    bound_m: float = 0.0


def draw_direction(draws: np.random.Generator) -> np.ndarray:
    """Draw a unit vector."""
    direction = draws.standard_normal(3)
    return direction / np.linalg.norm(direction)


def draw_loaded_case(
    seed: int, force_N: float, off_m: float, std_m: float
) -> tuple[Case, np.ndarray]:
    """Measure a robot whose load acts `off_m` beside its declared point; return its case
    and its true compliances."""
    name = HEAVY_ROBOTS[seed % len(HEAVY_ROBOTS)]
    document = read_compliant(name)
    arm = build_arm(document | {"masses": []})
    shift = off_m * draw_direction(np.random.default_rng([seed, 66]))
    robot = SimulatedRobot(
        arm,
        arm.compliance,
        tracker=Tracker(sigma_m=NOISE_M),
        cell=LoadCell(errors={"shift": shift}, in_flange=("shift",)),
    )
    design = Design(
        poses=POSES,
        held_out=HELD_OUT,
        force_times=force_N / get_typical_force_N(arm),
        ladder=(0.0, 1.0, -1.0),
        repeated_poses=0,
        points=arm.points[-1:],
        covariates=(),
        measured="position",
    )
    campaign = CAMPAIGN | {
        "frame": "base",
        "compliance": "identify",
        "targets": {arm.points[-1]: {"point": arm.points[-1], "offset_m": "unknown"}},
        "declared": ["joint_offset"],
        "noise": {"position_m": NOISE_M},
        "application_point_std_m": std_m,
        "holdout": {"poses": list(range(POSES - HELD_OUT, POSES))},
    }
    table = simulate_measurements(robot, design, draw_schedule(arm, design, seed))
    case = write_and_read(campaign, table, document, arm.joints)[0]
    return case, arm.compliance


def identify_compliances(
    seed: int, force_N: float, off_m: float, std_m: float
) -> Outcome:
    """Diagnose a robot whose load acts beside its declared point."""
    case, true_compliance = draw_loaded_case(seed, force_N, off_m, std_m)
    diagnosis = diagnose(case, Settings(), seed)
    fitted = diagnosis.final
    indices = fitted.parameter_indices("joint_compliance")
    std_error = np.sqrt(np.diag(fitted.covariance)[indices])
    deviation = fitted.effect_values("joint_compliance")[0] - true_compliance
    within = np.abs(deviation) <= COVERAGE_FACTOR * std_error
    names = [
        effect.name
        for effect in diagnosis.verdict.effects
        if effect.name != "application_point"
    ]
    return Outcome(names, int(within.sum()), len(within))


def measure_in_sessions(specimen: Specimen, seed: int, off_m: float) -> dict:
    """Measure a robot in sessions, each with a registration that is off by `off_m` in
    each coordinate and as much in rad; return the columns of the table."""
    draws = np.random.default_rng([seed, 67])
    low, high = np.deg2rad(np.array(specimen.document["joint_limits_deg"])).T
    angles = draws.uniform(low, high, (POSES, len(low)))
    position, rotation = specimen.measure(angles, seed)
    measured = position[:, None] + np.einsum("sij,tj->sti", rotation, specimen.true_m)
    session = np.arange(POSES) % SESSIONS
    turn = Rotation.from_rotvec(draws.normal(0.0, off_m, (SESSIONS, 3))).as_matrix()
    measured = np.einsum("sij,stj->sti", turn[session], measured)
    measured += draws.normal(0.0, off_m, (SESSIONS, 1, 3))[session]
    measured += draws.normal(0.0, NOISE_M, measured.shape)
    targets = len(specimen.true_m)
    row = np.repeat(np.arange(POSES), targets)
    zeros = np.zeros(len(row))
    table = {"session": session[row], "pose": row}
    table |= {"load": zeros.astype(int), "repeat": zeros.astype(int)}
    table |= {f"q{joint}": column[row] for joint, column in enumerate(angles.T, 1)}
    table |= dict.fromkeys(("fx", "fy", "fz", "mx", "my", "mz"), zeros)
    table["target"] = np.tile([f"T{index}" for index in range(targets)], POSES)
    return table | dict(zip("xyz", measured.reshape(-1, 3).T, strict=True))


def draw_sessions(
    specimen: Specimen, seed: int, off_m: float, std_m: float
) -> tuple[Case, Case]:
    """Read training and held-out cases of a robot that was measured in sessions."""
    table = measure_in_sessions(specimen, seed, off_m)
    held_out = np.random.default_rng([seed, 68]).permutation(POSES)[:HELD_OUT]
    targets = {
        f"T{index}": {
            "point": specimen.point,
            "offset_m": offset.tolist(),
            "offset_std_m": 0,
        }
        for index, offset in enumerate(specimen.true_m)
    }
    document = CAMPAIGN | {
        "frame": "base",
        "base_std_m": std_m,
        "targets": targets,
        "declared": ["joint_offset", "link_geometry"],
        "noise": {"position_m": NOISE_M},
        "holdout": {"poses": [[pose % SESSIONS, pose] for pose in held_out.tolist()]},
    }
    joints = len(specimen.document["joint_limits_deg"])
    return write_and_read(document, table, specimen.document, joints)


def correct_after_sessions(seed: int, off_m: float, std_m: float) -> Outcome:
    """Diagnose and correct a robot that was measured in sessions, and compare its true
    tool with the bounds."""
    specimen = draw_specimen(ARMS[seed % len(ARMS)], seed, 0.0, 0.0)
    case, held_out = draw_sessions(specimen, seed, off_m, std_m)
    judgement, calibrated = calibrate(case, held_out, seed)
    error_m, reached = measure_true_errors(specimen, calibrated, seed)
    prediction = predict_errors(calibrated, *select_campaign_commands(calibrated))
    within = error_m <= prediction.bound_m[reached]
    # The robot itself stands elsewhere than declared by the errors of its first link.
    names = [
        effect.name
        for effect in judgement.verdict.effects
        if effect.name != "base_placement"
    ]
    return Outcome(
        names,
        int(within.sum()),
        len(within),
        root_mean_square(error_m),
        float(np.median(prediction.bound_m)),
    )


def summarize(title: str, outcomes: Iterable[Outcome]) -> None:
    """Print the rates of a way to declare."""
    outcomes = list(outcomes)
    false_count = sum(bool(outcome.names) for outcome in outcomes)
    shares = np.array([outcome.hits / outcome.total for outcome in outcomes])
    std_error = shares.std(ddof=1) / np.sqrt(len(shares))
    print(f"{title}: robots with a false effect,", end=" ")
    print(format_count_rate(false_count, len(outcomes)))
    print(f"  within intervals or bounds {100 * shares.mean():.1f}", end=" ")
    print(f"± {196 * std_error:.1f} %")
    if outcomes[0].bound_m:
        error = np.mean([outcome.true_rms_m for outcome in outcomes])
        bound = np.mean([outcome.bound_m for outcome in outcomes])
        print(f"  mean true error {1e3 * error:.3f} mm, bound {1e3 * bound:.3f} mm")
    print("  names:", [outcome.names for outcome in outcomes if outcome.names])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("point", "sessions"))
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--newtons", type=float, default=800.0)
    parser.add_argument("--off-mm", type=float, default=5.0)
    parser.add_argument("--std-mm", type=float, nargs="*", default=[])
    arguments = parser.parse_args()
    off_m = 1e-3 * arguments.off_mm
    seeds = range(arguments.seed, arguments.seed + arguments.count)
    measure = correct_after_sessions
    if arguments.what == "point":
        measure = partial(identify_compliances, force_N=arguments.newtons)
    for std_mm in arguments.std_mm or (arguments.off_mm, 0.0):
        outcomes = [measure(seed, off_m=off_m, std_m=1e-3 * std_mm) for seed in seeds]
        summarize(f"declared to {std_mm} mm", outcomes)


if __name__ == "__main__":
    main()
