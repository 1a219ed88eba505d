"""Geometry alone, by the declared fit and by two simple fits, on the same folds.

`python benchmarks/simple_fits.py FOLDER...` cross-validates each campaign by five folds
of whole poses, and prints held-out RMS errors of the declared model as the diagnosis
first fits it; of the same fit under the noise that it leaves, shared out between sensor,
joints and poses, and all of it from the sensor; of the one of these two that left-out
poses choose, which is kept if no effect is adopted; of
least squares on a minimal set of parameters, by QR with column pivoting; and of ridge
regression whose penalty inner folds choose. Ratios to the better of the two simple fits
have 95 % intervals, from a bootstrap over poses. `--seed` draws other folds.
`--held-out` judges our fits by the held-out poses of the campaigns instead, which may
be another campaign.
"""

import argparse
from pathlib import Path

import numpy as np
from common import ROBOTS
from scipy.linalg import qr

from elastocal.diagnosis.adoption import choose_kept_fit
from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.refit import estimate_residual_noise, estimate_sensor_noise
from elastocal.diagnosis.search import screen_terms
from elastocal.diagnosis.settings import Settings
from elastocal.effects.protocol import Candidate
from elastocal.fitting.least_squares import Fit, fit_model
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    Case,
    evaluate_conditions,
    find_placement_parameters,
    get_parameter_values,
)
from elastocal.fitting.noise import Noise, estimate_noise, fit_declared_model
from elastocal.fitting.observations import Observations, index_poses, select_states
from elastocal.loop.whole import read_cases
from elastocal.validation.held_out import compute_position_residuals
from elastocal.validation.transfer import place_unseen_sessions, transfer_fit

FOLDS = 5
REPLICATES = 2000
# Diagonal of R over the first one, below which a column is not identifiable.
PIVOT_TOLERANCE = 1e-2
PENALTIES = np.geomspace(1e-9, 1.0, 19)
OURS = (
    "declared fit",
    "under the noise that it leaves",
    "all of it from the sensor",
    "chosen by left-out poses",
)
SIMPLE = ("minimal least squares", "ridge")


def find_noise_left(
    declared: Fit, observations: Observations, candidates: list[Candidate]
) -> Noise:
    """Noise of measurements and poses that a declared model leaves."""
    design = build_candidate_design(declared, observations, candidates, Settings())
    empty_model, _ = screen_terms(design.problem)
    return estimate_residual_noise(
        design.problem, empty_model, declared.noise, declared.noise
    )


def linearize_positions(
    fitted: Fit, observations: Observations
) -> tuple[np.ndarray, np.ndarray]:
    """Columns (3 M, P) and values (3 M,) of the linear problem about a fit."""
    estimate = fitted.estimate
    conditions = evaluate_conditions(fitted.model, estimate, observations.states)
    linear = linearize(fitted.model, estimate, observations, conditions)
    columns = linear.sensitivities[:, :3].reshape(3 * len(observations), -1)
    values = linear.residual[:, :3].ravel()
    return columns, values + columns @ get_parameter_values(fitted.model, estimate)


def solve_minimal(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Least squares on the columns that pivoting keeps; 0 for the others."""
    lengths = np.linalg.norm(columns, axis=0)
    usable = np.flatnonzero(lengths > 1e-12)
    _, triangle, order = qr(
        columns[:, usable] / lengths[usable], mode="economic", pivoting=True
    )
    count = int((np.abs(np.diag(triangle)) > PIVOT_TOLERANCE).sum())
    kept = usable[order[:count]]
    solution = np.zeros(columns.shape[1])
    solution[kept] = np.linalg.lstsq(columns[:, kept], values, rcond=None)[0]
    return solution


def solve_ridge(
    columns: np.ndarray, values: np.ndarray, is_free: np.ndarray, penalty: float
) -> np.ndarray:
    """Ridge regression of scaled columns, with next to no penalty on the free ones."""
    penalties = np.where(is_free, PENALTIES[0], penalty)
    mean_square = (columns[:, ~is_free] ** 2).sum(axis=0).mean()
    gram = columns.T @ columns + np.diag(penalties) * mean_square
    return np.linalg.lstsq(gram, columns.T @ values, rcond=None)[0]


def choose_penalty(
    columns: np.ndarray, values: np.ndarray, is_free: np.ndarray, fold: np.ndarray
) -> float:
    """Choose the penalty that predicts the rows of each fold (3 M,) best."""
    losses = []
    for penalty in PENALTIES:
        loss = 0.0
        for number in range(FOLDS):
            test = fold == number
            solution = solve_ridge(columns[~test], values[~test], is_free, penalty)
            loss += ((values[test] - columns[test] @ solution) ** 2).sum()
        losses.append(loss)
    return float(PENALTIES[int(np.argmin(losses))])


def fit_ours(case: Case, noise: Noise, training: Observations) -> dict[str, Fit]:
    """Fits of the declared model that a diagnosis makes."""
    declared = fit_declared_model(case.model, training, noise)
    noises = (
        find_noise_left(declared, training, [*case.candidates.values()]),
        estimate_sensor_noise(declared, training),
    )
    refits = [
        fit_model(declared.model, training, left, declared.estimate) for left in noises
    ]
    chosen = choose_kept_fit(refits, training, Settings())
    return dict(zip(OURS, (declared, *refits, chosen), strict=True))


def predict_simple(
    case: Case, declared: Fit, training: Observations, test: Observations
) -> dict[str, np.ndarray]:
    """Residuals (M, 3) of the observations of a fold by the simple fits, m."""
    columns, values = linearize_positions(declared, training)
    test_columns, test_values = linearize_positions(declared, test)
    is_free = find_placement_parameters([owner for owner, _ in declared.parameters])
    sizes = np.array([parameter.plausible for _, parameter in declared.parameters])
    pose = index_poses(training.states)[training.state]
    fold = np.repeat(pose % FOLDS, 3)
    penalty = choose_penalty(columns * sizes, values, is_free, fold)
    solutions = (
        solve_minimal(columns, values),
        sizes * solve_ridge(columns * sizes, values, is_free, penalty),
    )
    return {
        name: (test_values - test_columns @ solution).reshape(-1, 3)
        for name, solution in zip(SIMPLE, solutions, strict=True)
    }


def cross_validate(case: Case, seed: int) -> dict[str, np.ndarray]:
    """Mean squared errors (poses,) of each fit at poses that it was not fitted to."""
    observations = case.observations
    noise = estimate_noise(case)[0]
    pose = index_poses(observations.states)
    count = int(pose.max()) + 1
    fold = np.random.default_rng(seed).permutation(count)[pose] % FOLDS
    squares: dict[str, np.ndarray] = {
        name: np.zeros(count) for name in (*OURS, *SIMPLE)
    }
    for number in range(FOLDS):
        training = select_states(observations, fold != number)
        test = select_states(observations, fold == number)
        test_pose = pose[fold == number][test.state]
        measured = np.bincount(test_pose, minlength=count)
        fits = fit_ours(case, noise, training)
        residuals = predict_simple(case, fits[OURS[0]], training, test)
        for name, fitted in fits.items():
            estimate = place_unseen_sessions(fitted, test)
            residuals[name] = compute_position_residuals(fitted.model, estimate, test)
        for name, residual in residuals.items():
            sums = np.bincount(test_pose, (residual**2).sum(axis=1), minlength=count)
            squares[name] += sums / np.maximum(measured, 1)
    return squares


def judge_transfer(training: Case, held_out: Case) -> dict[str, np.ndarray]:
    """Mean squared errors (poses,) of our fits at the held-out poses."""
    test = held_out.observations
    pose = index_poses(test.states)[test.state]
    squares = {}
    fits = fit_ours(training, estimate_noise(training)[0], training.observations)
    for name, fitted in fits.items():
        model, estimate = transfer_fit(fitted, training, held_out)
        residual = compute_position_residuals(model, estimate, test)
        sums = np.bincount(pose, (residual**2).sum(axis=1))
        squares[name] = sums / np.bincount(pose)
    return squares


def print_comparison(name: str, squares: dict[str, np.ndarray]) -> None:
    """Print RMS errors, and ratios to the better simple fit, or else to the first
    fit."""
    rms_mm = {fit: 1e3 * np.sqrt(values.mean()) for fit, values in squares.items()}
    simple = [fit for fit in SIMPLE if fit in rms_mm]
    best = min(simple or OURS[:1], key=rms_mm.__getitem__)
    count = len(squares[best])
    weights = np.random.default_rng(1).multinomial(
        count, np.full(count, 1.0 / count), REPLICATES
    )
    errors = ", ".join(f"{fit} {rms:.4f} mm" for fit, rms in rms_mm.items())
    print(f"{name}, {count} poses: {errors}")
    for fit in OURS:
        ratios = np.sqrt((weights @ squares[fit]) / (weights @ squares[best]))
        low, high = np.quantile(ratios, (0.025, 0.975))
        ratio = rms_mm[fit] / rms_mm[best]
        print(f"  {fit} / {best}: {ratio:.3f} ({low:.3f} to {high:.3f})", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--held-out", action="store_true")
    arguments = parser.parse_args()
    for folder in arguments.folders:
        training_case, held_out_case = read_cases(folder, ROBOTS)
        squares = (
            judge_transfer(training_case, held_out_case)
            if arguments.held_out
            else cross_validate(training_case, arguments.seed)
        )
        print_comparison(folder.name, squares)
