"""How often a regression on the remainder is used, what it gains, and how often
something repeatable is said to remain.

Simulated campaigns of the KUKA: all of its geometry declared, one target of unknown
place, a tracker of 50 µm, 20 µrad of pose error in each joint; and a deviation of joint
2 or 3 by two joints' angles at once, which no catalogue has. `python
benchmarks/remainder_rates.py POSES CAMPAIGNS SIZE...` prints a row for each size in
rad; `--check` of the test alone.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import ROBOTS

from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.simulation import Plan as Survey
from elastocal.campaigns.simulation import draw_measurements
from elastocal.campaigns.writing import write_campaign
from elastocal.fitting.model import Case
from elastocal.fitting.noise import Noise, fit_declared_model
from elastocal.loop.whole import read_cases
from elastocal.residual_model.repeatable import detect_repeatable_residual
from elastocal.residual_model.selection import (
    ResidualModelPlan,
    build_inputs,
    validate_residual_model,
)
from elastocal.validation.held_out import compute_position_residuals
from elastocal.validation.transfer import transfer_fit

NOISE_M = 5e-5
JOINT_RAD = 2e-5
OFFSET_RAD = 2e-4
HELD_OUT = 150
NOISE = Noise("declared", NOISE_M, NOISE_M, np.full(6, JOINT_RAD))
LEVELS = (0.01, 0.05)


def measured_cases(
    name: str, table: dict[str, np.ndarray], poses: int
) -> tuple[Case, Case]:
    """Cases to fit and to judge, of the measurements of a campaign; `poses`: to fit."""
    document = {
        "campaign": name,
        "robot": "kuka",
        "measured": "position",
        "frame": "tracker",
        "targets": {"6DoF": {"point": "6DoF", "offset_m": "unknown"}},
        "compliance": "nominal",
        "declared": ["joint_offset", "link_geometry"],
        "noise": {"position_m": NOISE_M},
        "holdout": {"fraction": HELD_OUT / (poses + HELD_OUT), "seed": 1},
    }
    with TemporaryDirectory() as folder:
        write_campaign(Path(folder) / name, document, table, 6, "csv")
        return read_cases(Path(folder) / name, ROBOTS)


def exact_cases(poses: int) -> tuple[Case, Case]:
    """Cases whose measurements are exact."""
    survey = Survey(
        ("6DoF",), poses + HELD_OUT, 100.0, (0,), (0.0, 0.0, 0.0), 1, 0, 1e-9, 1e-9
    )
    return measured_cases(
        "rates",
        draw_measurements(read_robot(ROBOTS / "kuka.yaml"), survey, 1, "rates"),
        poses,
    )


def drawn(case: Case, seed: int, number: int, size: float) -> tuple[Case, np.ndarray]:
    """A case with errors, and what no model could predict of it, (M, 3), m. `part`: of
    one robot, that of the seed."""
    fitted = fit_declared_model(case.model, case.observations, NOISE)
    robot = np.random.default_rng(seed)
    inputs = build_inputs(fitted.model, fitted.estimate, case.observations)
    offsets = robot.normal(0.0, OFFSET_RAD, 6)
    joints = robot.choice(5, 2, replace=False)
    moved = robot.choice([1, 2])
    waves = np.sin(inputs.joint_angles[:, joints] + robot.uniform(0.0, 2.0 * np.pi, 2))
    deviation = 2.0 * size * waves.prod(axis=1)[:, None] * inputs.jacobian[:, :, moved]
    draws = np.random.default_rng([seed, number])
    along = inputs.jacobian[:, :, :6]
    chance = (
        draws.normal(0.0, NOISE_M, deviation.shape)
        + (along @ draws.normal(0.0, JOINT_RAD, (len(along), 6, 1)))[..., 0]
    )
    observations = case.observations
    return replace(
        case,
        observations=replace(
            observations,
            position=observations.position + deviation + along @ offsets + chance,
        ),
    ), chance


def rms(squares: list[np.ndarray]) -> float:
    return 1e6 * float(np.sqrt(np.mean(squares)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("poses", type=int)
    parser.add_argument("campaigns", type=int)
    parser.add_argument("sizes", type=float, nargs="+")
    parser.add_argument("--check", action="store_true")
    asked = parser.parse_args()
    exact = exact_cases(asked.poses)
    for size in asked.sizes:
        start = time.process_time()
        p_values = []
        used = 0
        worse = 0
        errors = []
        for seed in range(asked.campaigns):
            (case, _), (held_out, chance) = (
                drawn(exact_case, seed, number, size)
                for number, exact_case in enumerate(exact)
            )
            fitted = fit_declared_model(case.model, case.observations, NOISE)
            p_values.append(
                detect_repeatable_residual(fitted, case.observations, seed).p_value
            )
            if asked.check:
                continue
            alone = compute_position_residuals(
                *transfer_fit(fitted, case, held_out), held_out.observations
            )
            plan = ResidualModelPlan("auto", blocks=False, within_range=True, seed=seed)
            validated = validate_residual_model(fitted, case, held_out, plan)
            squares = [
                (residual**2).sum(axis=1)
                for residual in (alone, validated.residual, chance)
            ]
            change = squares[1] - squares[0]
            used += validated.predictor is not None
            worse += change.mean() > change.std(ddof=1) / np.sqrt(len(change)) > 0.0
            errors.append([squared_errors.mean() for squared_errors in squares])
        rates = ", ".join(
            f"p <= {level}: {np.mean(np.array(p_values) <= level):.3f}"
            for level in LEVELS
        )
        row = (
            f"{asked.poses} poses, {1e3 * size:g} mrad, {asked.campaigns} campaigns;"
            f" something remains, {rates}"
        )
        if errors:
            physics, with_it, floor = (
                rms(column) for column in zip(*errors, strict=True)
            )
            row += (
                f"; used {used}, worse by more than a standard error {worse};"
                f" held-out RMS of physics {physics:.0f} µm,"
                f" with the regression {with_it:.0f}, of chance alone {floor:.0f}"
            )
        print(
            f"{row}; {(time.process_time() - start) / asked.campaigns:.2f} s CPU each",
            flush=True,
        )
