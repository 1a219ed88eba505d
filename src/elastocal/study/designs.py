"""Which configurations to measure (RQ3): random ones against optimal designs.

Candidates are random configurations within the joint limits, with their loads; a design
is a selection of them. Its worth is the error that it leaves in simulated data sets, at
test configurations within the limits. Criterion I uses configurations of its own, so
that no design is chosen on the configurations that judge it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.planning.designs import (
    CRITERIA,
    Criterion,
    build_criterion,
    choose_greedily,
    exchange_candidates,
)
from elastocal.random_streams import open_stream
from elastocal.study.in_memory import define_study_step
from elastocal.study.jobs import MICRO, concatenate_robots, define_table_step
from elastocal.study.metrics import evaluate_quadratic_form
from elastocal.study.schemas import SIMULATED_DESIGNS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.io.data_frames import Frames
    from elastocal.study.in_memory import StudyInMemory

RANDOM = "random"
# Number of random designs of each size. All of them together get the data sets of the
# study.
_RANDOM_DESIGNS = 200
# A joint counts as not moved by the loads if its columns are smaller than this share of
# the largest column.
_SMALLEST_OBSERVABLE_SHARE = 1e-9


@dataclass(frozen=True)
class Candidates:
    """Configurations under loads of one kind, from which designs are chosen.

    Attributes
    ----------
    regressors : (N, rows, n) array, m per rad/(N m)
    deflections : (N, rows) array, m and rad
        Without noise.
    observable : (n,) array of bool
        Joints that the loads move.
    criterion_form, mean_form : (n + 1, n + 1) arrays
        Mean squared error over the configurations of the criterion, and over the test
        configurations, as quadratic forms; see `metrics.ValidationSet`.
    """

    regressors: np.ndarray
    deflections: np.ndarray
    observable: np.ndarray
    criterion_form: np.ndarray
    mean_form: np.ndarray


# Kind of designs of one size, and their candidates: (D, size) array of indices.
_Designs = tuple[str, np.ndarray]


def evaluate_designs(
    study: StudyInMemory,
    candidates: int,
    sizes: Sequence[int],
    loads: Mapping[str, Sequence[float] | None],
) -> Iterator[dict[str, np.ndarray]]:
    """Evaluate the errors that designs leave in simulated data sets, for each kind of
    load.

    All configurations are within the joint limits. Joints that the loads do not move are
    left out, and then the test configurations have the loads of the candidates.

    Parameters
    ----------
    study
    candidates : int
        Number of candidates.
    sizes
        Numbers of configurations of the designs.
    loads
        Direction of the force by the name of its kind, base axes; None if it is random
        in each configuration.

    Yields
    ------
    dict
        Columns of the table of simulated designs.
    """
    within_limits = study.with_loading(joint_range="limits")
    for load, direction in loads.items():
        pool = _draw_candidates(within_limits, candidates, direction)
        designs = [
            *_choose_optimal_designs(study, pool, sizes),
            *_draw_random_designs(study, candidates, sizes, load),
        ]
        errors = [
            _simulate_errors(study, pool, selections) for _, selections in designs
        ]
        unobservable = np.flatnonzero(~pool.observable)
        hidden = ", ".join(str(joint + 1) for joint in unobservable)
        yield {
            "load": np.full(len(designs), load, object),
            "design": np.array([kind for kind, _ in designs], object),
            "configurations": np.array(
                [selections.shape[1] for _, selections in designs]
            ),
            "unobservable": np.full(len(designs), hidden, object),
            "rms": np.array([rms for rms, _ in errors]),
            "std_error": np.array([std_error for _, std_error in errors]),
        }


def _draw_candidates(
    study: StudyInMemory, count: int, direction: Sequence[float] | None
) -> Candidates:
    """Draw candidates under loads in one direction, or in random ones."""
    loaded = study
    if direction is not None:
        loaded = study.with_loading(direction=tuple(direction))
    rows = study.interpretation.rows
    experiments = loaded.draw_experiments([0], count, "candidates of designs")
    regressors = loaded.compute_regressor(experiments)[0, :, :rows]
    size = np.abs(regressors).max(axis=(0, 1))
    observable = size > _SMALLEST_OBSERVABLE_SHARE * size.max()
    judged = study if observable.all() else loaded
    criterion = judged.draw_experiments([0], study.size.tests, "criterion of designs")
    return Candidates(
        regressors,
        loaded.compute_deflections(experiments)[0, :, :rows],
        observable,
        judged.validate_on(criterion).mean_form,
        judged.validate_on(judged.draw_tests()).mean_form,
    )


def _choose_optimal_designs(
    study: StudyInMemory, pool: Candidates, sizes: Sequence[int]
) -> list[_Designs]:
    """Choose one design of each size by each criterion."""
    observable = pool.observable
    scale = study.robot.compliance[observable]
    regressors = pool.regressors[..., observable] * scale / study.size.noise
    # Without its last row and column the form is that of the compliances alone.
    form = pool.criterion_form[np.ix_(observable, observable)]
    criteria = {"I": Criterion(form * np.outer(scale, scale))}
    for kind in CRITERIA:
        if kind != "I":
            criteria[kind] = build_criterion(kind, regressors[:, :3])
    designs = []
    for kind, rule in criteria.items():
        # The beginning of a greedy selection is the greedy selection of fewer.
        longest = choose_greedily(regressors, max(sizes), rule)
        for size in sizes:
            selection = exchange_candidates(regressors, longest[:size], rule)
            designs.append((kind, np.atleast_2d(selection)))
    return designs


def _draw_random_designs(
    study: StudyInMemory, candidates: int, sizes: Sequence[int], load: str
) -> list[_Designs]:
    """Draw random designs of each size."""
    draws = open_stream(study.seed, study.key, f"random designs/{load}", 0)
    designs = []
    for size in sizes:
        selections = [
            draws.choice(candidates, size, replace=False)
            for _ in range(_RANDOM_DESIGNS)
        ]
        designs.append((RANDOM, np.array(selections)))
    return designs


def _simulate_errors(
    study: StudyInMemory, pool: Candidates, selections: np.ndarray
) -> tuple[float, float]:
    """RMS error, with its standard error, of noisy data sets by designs (D, size)."""
    count = len(selections)
    repeats = -(-study.size.data_sets // count)
    error = np.zeros((len(pool.observable), count * repeats))
    estimates = _simulate_estimates(study, pool, selections, repeats)
    true = study.robot.compliance[pool.observable]
    error[pool.observable] = estimates - true[:, None]
    squares = evaluate_quadratic_form(pool.mean_form, error)
    rms = np.sqrt(squares.mean())
    # Data sets of one design are not independent of each other, so designs are the
    # sample if there are several.
    by_design = squares.reshape(count, repeats)
    sample = by_design.mean(axis=1) if count > 1 else by_design[0]
    std_error = sample.std(ddof=1) / np.sqrt(len(sample)) / (2 * rms)
    return float(rms), float(std_error)


def _simulate_estimates(
    study: StudyInMemory, pool: Candidates, selections: np.ndarray, repeats: int
) -> np.ndarray:
    """Observable compliances (observable, D repeats) that least squares estimate from
    noisy data sets of each design."""
    count, size = selections.shape
    joints = pool.observable.sum()
    regressors = pool.regressors[selections][..., pool.observable]
    matrix = regressors.reshape(count, -1, joints)
    ideal = pool.deflections[selections].reshape(count, -1, 1)
    draws = open_stream(study.seed, study.key, f"noise of designs/{size}", 0)
    noise = draws.standard_normal((*ideal.shape[:2], repeats))
    measured = ideal + study.size.noise * noise
    transposed = matrix.swapaxes(1, 2)
    estimates = np.linalg.solve(transposed @ matrix, transposed @ measured)
    return np.moveaxis(estimates, 1, 0).reshape(joints, -1)


def build_designs_table(designs: Frames) -> pd.DataFrame:
    """Simulated errors of random and chosen configurations by the kind of load.

    Parameters
    ----------
    designs
        The table of simulated designs of each robot.

    Returns
    -------
    DataFrame
        ``gain`` is the error of random designs of the same size, over that of the
        design.
    """
    frame = concatenate_robots(designs)
    names = {"rms": "rms_um", "std_error": "rms_um_std_error"}
    errors = MICRO * frame[[*names]].rename(columns=names)
    heads = ["robot", "load", "design", "configurations", "unobservable"]
    table = frame[heads].join(errors)
    keys = ["robot", "load", "configurations"]
    random = table[table.design == RANDOM].set_index(keys).rms_um.rename("random")
    return table.assign(gain=table.join(random, on=keys).random / table.rms_um)


simulate_designs = define_study_step(SIMULATED_DESIGNS, evaluate_designs)
tabulate_simulated_designs = define_table_step(SIMULATED_DESIGNS, build_designs_table)
