"""Which configurations (RQ3), simulated: random and chosen ones under loads of one kind, a thousand noisy data sets of each.

Beside D, A and I the test-pose criterion: the accuracy at one pose under the load of its task [1], [2].

[1] Klimchik, A., Wu, Y., Pashkevich, A., Caro, S. and Furet, B., Optimal selection of measurement configurations for stiffness
    model calibration of anthropomorphic manipulators, Applied Mechanics and Materials 162, 2012.
[2] Wu, Y., Klimchik, A., Caro, S., Furet, B. and Pashkevich, A., Geometric calibration of industrial robots using enhanced
    partial pose measurements and design of experiments, Robotics and Computer-Integrated Manufacturing 35, 2015.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.planning.designs import CRITERIA, Criterion, choose_greedily, criterion, exchange_candidates
from elastocal.random_streams import stream
from elastocal.study.designs import RANDOM
from elastocal.study.metrics import make_judge, mean_form, mean_square_errors
from elastocal.study.uses import iso_9283

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import Any

    from elastocal.study.steps.in_memory import StudyInMemory

TEST_POSE = "test pose"
# Random designs of one size; each has as many noisy data sets as all have together over this.
_RANDOM_DESIGNS = 200
# A joint whose columns are smaller than this share of the largest is not moved by the loads.
_MOVED = 1e-9


@dataclass(frozen=True)
class Candidates:
    """Configurations under loads of one kind, among which is chosen.

    `rows` (N, rows, n): regressors, m per rad/(N m). `deflections` (N, rows): without noise. `observable` (n,): joints that the
    loads move. `forms`: mean squared error over the test configurations, and at the test pose, as quadratic forms.
    """

    rows: np.ndarray
    deflections: np.ndarray
    observable: np.ndarray
    forms: tuple[np.ndarray, np.ndarray]


def simulated_design_blocks(
    study: StudyInMemory, count: int, sizes: Sequence[int], loads: Mapping[str, Sequence[float] | None], uses: Mapping[str, Any]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Errors that designs leave in simulated data sets of their configurations.

    `count`: candidates. `loads`: direction of the force by the name of its kind, base axes; None for one that is random in each
    configuration. `uses`: of which the cube and its weight give the test pose. Where the loads do not move a joint, it is left
    out, and the test configurations have the loads of the candidates. Yields columns of one block: one kind of load.
    """
    for load, direction in loads.items():
        candidates = _candidates(study, count, direction, uses)
        of = candidates.observable
        scale = study.robot.compliance[of]
        rows = candidates.rows[..., of] * scale / study.size.noise
        # Both forms are of the squared error in all compliances and 1.
        weights = {"I": candidates.forms[0], TEST_POSE: candidates.forms[1]}
        rules = {kind: Criterion(weights[kind][np.ix_(of, of)] * np.outer(scale, scale)) for kind in weights}
        rules |= {kind: criterion(kind, rows[:, :3]) for kind in CRITERIA if kind != "I"}
        found: list[tuple[str, int, Sequence[np.ndarray] | np.ndarray | list[int]]] = []
        for kind, rule in rules.items():
            # A greedy choice of fewer is the beginning of that of more.
            longest = choose_greedily(rows, max(sizes), rule)
            found += [(kind, size, exchange_candidates(rows, longest[:size], rule)) for size in sizes]
        draws = stream(study.seed, study.key, f"random designs/{load}", 0)
        found += [(RANDOM, size, [draws.choice(count, size, False) for _ in range(_RANDOM_DESIGNS)]) for size in sizes]
        errors = [_simulate(study, candidates, np.atleast_2d(chosen)) for _, _, chosen in found]
        hidden = ", ".join(str(joint + 1) for joint in np.flatnonzero(~of))
        yield {
            "load": np.full(len(found), load, object),
            "design": np.array([kind for kind, _, _ in found], object),
            "configurations": np.array([size for _, size, _ in found]),
            "unobservable": np.full(len(found), hidden, object),
            **{name: np.array([error[place] for error in errors]) for place, name in enumerate(("rms", "std_error", "there"))},
        }


def _candidates(study: StudyInMemory, count: int, direction: Sequence[float] | None, uses: Mapping[str, Any]) -> Candidates:
    robot, read = study.robot, study.interpretation
    within = study if direction is None else study.under(direction=tuple(direction))
    drawn = within.experiments([0], count, "candidates of designs")
    rows = within.regressor(drawn)[0, :, : read.rows]
    size = np.abs(rows).max(axis=(0, 1))
    observable = size > _MOVED * size.max()
    tests = study.tests() if observable.all() else within.tests()
    pose = iso_9283(robot, uses["centre_m"], uses["edge_m"], uses["weight_N"])
    # The first of the five poses is the centre of the cube; a robot that does not reach it has its first test configuration.
    centre = (pose or tests).first(1)
    forms = [mean_form(make_judge(robot, each, within.deflections(each), read.wrench_at)) for each in (tests, centre)]
    return Candidates(rows, within.deflections(drawn)[0, :, : read.rows], observable, (forms[0], forms[1]))


def _simulate(study: StudyInMemory, candidates: Candidates, designs: np.ndarray) -> tuple[float, float, float]:
    """RMS error with its standard error, and RMS error at the test pose, of noisy data sets by designs (D, size)."""
    repeats = -(-study.size.data_sets // len(designs))
    draws = stream(study.seed, study.key, f"noise of designs/{designs.shape[1]}", 0)
    of = candidates.observable
    rows = candidates.rows[designs][..., of].reshape(len(designs), -1, of.sum())
    ideal = candidates.deflections[designs].reshape(len(designs), -1, 1)
    measured = ideal + study.size.noise * draws.standard_normal((*ideal.shape[:2], repeats))
    across = rows.swapaxes(1, 2)
    error = np.zeros((len(of), len(designs) * repeats))
    estimates = np.linalg.solve(across @ rows, across @ measured)
    error[of] = np.moveaxis(estimates, 1, 0).reshape(of.sum(), -1) - study.robot.compliance[of][:, None]
    squares, there = (mean_square_errors(form, error) for form in candidates.forms)
    rms = np.sqrt(squares.mean())
    # Data sets of one design go together.
    each = squares.reshape(len(designs), repeats)
    groups = each.mean(axis=1) if len(designs) > 1 else each[0]
    return float(rms), float(groups.std(ddof=1) / np.sqrt(len(groups)) / (2 * rms)), float(np.sqrt(there.mean()))
