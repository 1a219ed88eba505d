"""Which configurations (RQ3): random against chosen ones.

Candidates are random configurations with their loads; a design is some of them. Its
worth is the error that simulated data sets of it leave.
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
from elastocal.io.storage import Column
from elastocal.random_streams import open_stream
from elastocal.study.in_memory import define_study_step
from elastocal.study.jobs import (
    MICRO,
    concatenate_robots,
    define_table_step,
    make_integer_column,
    make_real_column,
    make_schema,
)
from elastocal.study.metrics import evaluate_quadratic_form, make_validation_set

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.study.in_memory import StudyInMemory

RANDOM = "random"
SIMULATED_DESIGNS = make_schema(
    "simulated_designs",
    Column(
        "load",
        "text",
        "",
        "kind of load: random directions, or one direction in every configuration",
    ),
    Column(
        "design",
        "text",
        "",
        "criterion by which the configurations are chosen, or random",
    ),
    make_integer_column("configurations", "configurations of the design", 1),
    Column(
        "unobservable",
        "text",
        "",
        "joints that the loads do not move, from 1, with commas between them",
    ),
    make_real_column(
        "rms",
        "m",
        "RMS end-effector error over simulated data sets on test configurations",
    ),
    make_real_column("std_error", "m", "Monte Carlo standard error of the same"),
)
# Random designs of each size; each has as many noisy data sets as all have together
# over this.
_SIMULATED = 200
# A joint whose columns are smaller than this share of the largest is not moved by the
# loads.
_MOVED = 1e-9


@dataclass(frozen=True)
class Candidates:
    """Configurations under loads of one kind, among which is chosen.

    `rows` (N, rows, n): regressors, m per rad/(N m). `deflections` (N, rows): without
    noise. `observable` (n,): joints that the loads move. `form`: mean squared error
    over the test configurations as a quadratic form.
    """

    rows: np.ndarray
    deflections: np.ndarray
    observable: np.ndarray
    form: np.ndarray


def evaluate_designs(
    study: StudyInMemory,
    candidates: int,
    sizes: Sequence[int],
    loads: Mapping[str, Sequence[float] | None],
) -> Iterator[dict[str, np.ndarray]]:
    """Errors that designs leave in simulated data sets of their configurations, kind of
    load by kind.

    `candidates`: how many. `loads`: direction of the force by the name of its kind,
    base axes; None for one that is random in each configuration. Where the loads do not
    move a joint, it is left out, and the test configurations have the loads of the
    candidates.
    """
    for load, direction in loads.items():
        made = _candidates(study, candidates, direction)
        of = made.observable
        scale = study.robot.compliance[of]
        rows = made.rows[..., of] * scale / study.size.noise
        # The form is of the squared error in all compliances and 1.
        rules = {"I": Criterion(made.form[np.ix_(of, of)] * np.outer(scale, scale))}
        rules |= {
            kind: build_criterion(kind, rows[:, :3]) for kind in CRITERIA if kind != "I"
        }
        found: list[tuple[str, int, Sequence[np.ndarray] | np.ndarray | list[int]]] = []
        for kind, rule in rules.items():
            # A greedy choice of fewer is the beginning of that of more.
            longest = choose_greedily(rows, max(sizes), rule)
            found += [
                (kind, size, exchange_candidates(rows, longest[:size], rule))
                for size in sizes
            ]
        draws = open_stream(study.seed, study.key, f"random designs/{load}", 0)
        found += [
            (
                RANDOM,
                size,
                [draws.choice(candidates, size, False) for _ in range(_SIMULATED)],
            )
            for size in sizes
        ]
        errors = np.array(
            [_simulate(study, made, np.atleast_2d(chosen)) for _, _, chosen in found]
        )
        hidden = ", ".join(str(joint + 1) for joint in np.flatnonzero(~of))
        yield {
            "load": np.full(len(found), load, object),
            "design": np.array([kind for kind, _, _ in found], object),
            "configurations": np.array([size for _, size, _ in found]),
            "unobservable": np.full(len(found), hidden, object),
            **dict(zip(("rms", "std_error"), errors.T, strict=True)),
        }


def _candidates(
    study: StudyInMemory, count: int, direction: Sequence[float] | None
) -> Candidates:
    read = study.interpretation
    within = study if direction is None else study.under(direction=tuple(direction))
    drawn = within.experiments([0], count, "candidates of designs")
    rows = within.regressor(drawn)[0, :, : read.rows]
    size = np.abs(rows).max(axis=(0, 1))
    observable = size > _MOVED * size.max()
    tests = study.tests() if observable.all() else within.tests()
    form = make_validation_set(
        study.robot, tests, within.deflections(tests), read.wrench_at
    ).form
    return Candidates(
        rows, within.deflections(drawn)[0, :, : read.rows], observable, form
    )


def _simulate(
    study: StudyInMemory, candidates: Candidates, designs: np.ndarray
) -> tuple[float, float]:
    """RMS error with its standard error of noisy data sets by designs (D, size)."""
    repeats = -(-study.size.data_sets // len(designs))
    draws = open_stream(
        study.seed, study.key, f"noise of designs/{designs.shape[1]}", 0
    )
    of = candidates.observable
    rows = candidates.rows[designs][..., of].reshape(len(designs), -1, of.sum())
    ideal = candidates.deflections[designs].reshape(len(designs), -1, 1)
    measured = ideal + study.size.noise * draws.standard_normal(
        (*ideal.shape[:2], repeats)
    )
    across = rows.swapaxes(1, 2)
    error = np.zeros((len(of), len(designs) * repeats))
    estimates = np.linalg.solve(across @ rows, across @ measured)
    error[of] = (
        np.moveaxis(estimates, 1, 0).reshape(of.sum(), -1)
        - study.robot.compliance[of][:, None]
    )
    squares = evaluate_quadratic_form(candidates.form, error)
    rms = np.sqrt(squares.mean())
    # Data sets of one design go together.
    each = squares.reshape(len(designs), repeats)
    groups = each.mean(axis=1) if len(designs) > 1 else each[0]
    return float(rms), float(groups.std(ddof=1) / np.sqrt(len(groups)) / (2 * rms))


def build_designs_table(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Simulated errors of random and chosen configurations by the kind of load.

    gain: the error of random designs of the size over that of the design.
    """
    frame = concatenate_robots(found)
    names = {"rms": "rms_um", "std_error": "rms_um_std_error"}
    errors = MICRO * frame[[*names]].rename(columns=names)
    part = frame[["robot", "load", "design", "configurations", "unobservable"]].join(
        errors
    )
    size = ["robot", "load", "configurations"]
    random = part[part.design == RANDOM].set_index(size).rms_um.rename("random")
    return part.assign(gain=part.join(random, on=size).random / part.rms_um)


simulate_designs = define_study_step(SIMULATED_DESIGNS, evaluate_designs)
tabulate_simulated_designs = define_table_step(SIMULATED_DESIGNS, build_designs_table)
