"""From a fit to the problem that is searched: columns of everything that its model
might lack, whitened, and their products."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import chdtri

from elastocal.diagnosis.evidence import TermBlock
from elastocal.diagnosis.hypotheses import (
    Discrepancy,
    ModelTerm,
    build_discrepancies,
    build_terms,
)
from elastocal.diagnosis.search import SearchProblem, select_pose_errors
from elastocal.diagnosis.statistics import (
    CrossProducts,
    SufficientStatistics,
    WhitenedRows,
    compute_cross_products,
    compute_statistics,
)
from elastocal.errors import InputError
from elastocal.fitting.linearization import FactoredSensitivities, linearize
from elastocal.fitting.model import find_nonlinear_parameters, get_parameter_values
from elastocal.fitting.normal_equations import compute_whitening
from elastocal.fitting.observations import Observations, select_spread_poses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.settings import Settings
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit

    Shapes = tuple[float, ...]

# Values of a shape that are tried: neighbours differ by less than measurements show at
# the sizes that matter.
_SHAPES_TRIED = 3
# Of one pose about the joints, 1/rad^2: below it the targets move by rounding only.
_LEAST_INFORMATION = 1e-6
# Values that a closer look tries to either side of the best, short of its neighbours.
# Where the fit has the candidate already, a step is looked for within a quarter of the
# spacing to either side.
_SHAPES_CLOSER = 3
_CLOSER_STILL = 0.25
# A candidate is looked at more closely whose log odds come so near to those of the best
# and whose log Bayes factor is so large: below, its shape hardly matters.
_NEAR_THE_BEST = 10.0
_WORTH_A_LOOK = 5.0
# Declared parameters without a prior of their own get one this many times their
# plausible size: it decides nothing, and keeps well posed what the measurements do not
# determine.
_WIDE = 10.0
# Beyond so many rows a sample tells which sizes of the pose error are out of question:
# several for each parameter.
_MANY_ROWS = 8000
_SAMPLE_ROWS = 1500


@dataclass(frozen=True)
class CandidateDesign:
    """A model about a fit, and everything that it might lack; what asks for more work
    is done when it is first asked for.

    Coefficients count from zero, not from the fit: what candidates and declared
    geometry contribute to the prediction is given back to the residual, so that their
    priors mean what they say. `around`: of the states looked at. `tried`: candidates
    that can be tested at all, each with values of its shape; `lacking`: why not others.
    `candidates`: keys of all: parameters of the fit that they own are coefficients of
    units here. `against`: laws of the competitor.
    """

    reference_fit: Fit
    observations: Observations
    settings: Settings
    around: Conditions
    tried: dict[str, tuple[Candidate, list[Shapes]]]
    lacking: dict[str, str]
    candidates: frozenset[str]
    against: list[Discrepancy]
    max_pose_error_rad: float

    def alike(self, **changes: Any) -> CandidateDesign:
        """The same but for what does not change the whitened rows of the fit, which are
        not made again."""
        found = replace(self, **changes)
        vars(found).update({"_fitted": self._fitted})
        return found

    @property
    def without_rows(self) -> CandidateDesign:
        """The same where nothing but the statistics and what goes with them is needed
        any more."""
        found = replace(self)
        kept = {name: value for name, value in vars(self).items() if name != "_fitted"}
        vars(found).update(kept | {"products": self.products.without_rows})
        return found

    @cached_property
    def terms(self) -> tuple[ModelTerm, ...]:
        """Of candidates and competitors, in the order of their columns."""
        return build_terms(self.tried.values(), self.against, self.settings)

    @property
    def priors(self) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviation of the prior of each declared parameter, wide where it has
        none, and its present value, (P,)."""
        pairs = zip(self.reference_fit.parameters, self._values, strict=True)
        kept = [
            (p, value) for (owner, p), value in pairs if owner not in self.candidates
        ]
        deviation = np.array(
            [
                _WIDE * p.plausible if p.prior_std is None else p.prior_std
                for p, _ in kept
            ]
        )
        return deviation, np.array(
            [value if p.prior_std is not None else 0.0 for p, value in kept]
        )

    @property
    def _values(self) -> np.ndarray:
        """Of all parameters of the fit in which the prediction is linear; zero for
        shapes, (P,)."""
        model = self.reference_fit.model
        estimate = self.reference_fit.estimate
        return np.where(
            find_nonlinear_parameters(model, estimate),
            0.0,
            get_parameter_values(model, estimate),
        )

    @cached_property
    def _fitted(self) -> tuple[WhitenedRows, Conditions]:
        """Whitened rows without candidates, but for the Jacobian of the coordinates,
        and where the robot has yielded to.

        What errs together is of one state, and a candidate displaces states: the
        Jacobian is whitened, not every column.
        """
        fitted = self.reference_fit
        some = self.observations
        line = linearize(fitted.model, fitted.estimate, some, self.around)
        jacobian = line.joint_jacobian
        root = np.sqrt(fitted.weights)
        whitener = compute_whitening(some, jacobian, fitted.noise.without_pose_error)

        def white(values: np.ndarray) -> np.ndarray:
            return whitener.apply(values * root.reshape(-1, *[1] * (values.ndim - 1)))

        found = np.isin(
            [owner for owner, _ in fitted.parameters], list(self.candidates)
        )
        residual = (
            line.residual
            + line.columns.select_columns(found).dense() @ self._values[found]
        )
        nothing = FactoredSensitivities.of(
            [], white(line.coordinate_jacobian), some.state, len(some.states)
        )
        rows = WhitenedRows(
            white(line.columns.select_columns(~found).dense()),
            nothing,
            white(residual),
            white(jacobian),
            some.cluster,
        )
        return rows, line.conditions

    @property
    def rows(self) -> WhitenedRows:
        """Whitened rows, candidates in the order of the units."""
        rows, conditions = self._fitted
        tried = [
            (candidate, each)
            for candidate, shapes in self.tried.values()
            for each in shapes
        ]
        laws = [
            law
            for candidate, shapes in tried
            for law in candidate.displacement(conditions, *shapes)
        ]
        laws += [
            law for against in self.against for law in against.displacement(conditions)
        ]
        sizes = np.concatenate([unit.sizes for unit in self.terms])
        jacobian = rows.candidates.jacobian
        state = rows.candidates.state
        return replace(
            rows,
            candidates=FactoredSensitivities.of(
                laws, jacobian, state, len(self.observations.states), sizes
            ),
        )

    @cached_property
    def products(self) -> CrossProducts:
        """Of the rows."""
        return compute_cross_products(self.rows, *self.priors)

    @cached_property
    def pose_std_error_rad(self) -> float:
        """Standard error with which the measurements of one pose tell a joint angle."""
        rows, _ = self._fitted
        shown = float(
            np.median(
                np.bincount(
                    rows.pose,
                    (rows.jacobian**2).sum(axis=(1, 2)) / rows.jacobian.shape[-1],
                )
            )
        )
        if shown < _LEAST_INFORMATION:
            found = "measurements that no joint moves"
            allowed = "targets on what moves, off a lone axis"
            raise InputError("campaign", "targets", found, allowed)
        return 1.0 / np.sqrt(shown)

    @property
    def candidate_pose_errors_rad(self) -> np.ndarray:
        """Sizes of the pose error that are thought of, zero first."""
        return np.unique(
            np.minimum(
                self.pose_std_error_rad * np.array(self.settings.pose_steps),
                self.max_pose_error_rad,
            )
        )

    @cached_property
    def problem(self) -> SearchProblem:
        """What is searched. Columns of units that could not be seen stay in the
        statistics, where nothing refers to them."""
        grid = self.candidate_pose_errors_rad
        products = self.products
        settings = self.settings
        grid = grid[
            select_pose_errors(
                compute_statistics(products.without_candidates, grid), settings
            )
        ]
        if products.rows.residual.size > _MANY_ROWS:
            some = select_spread_poses(
                self.observations, _SAMPLE_ROWS // self.observations.rows
            )[self.observations.state]
            sample = compute_cross_products(products.rows.at(some), *self.priors)
            # Zero, to which Gram matrices refer, always.
            grid = np.union1d(
                0.0,
                SearchProblem(
                    compute_statistics(sample, grid), self.terms, settings
                ).started.statistics.pose_error_rad,
            )
        statistics = compute_statistics(products, grid)
        smallest = find_smallest_detectable_sizes(statistics, self.terms, settings)
        pairs = zip(self.terms, smallest.tolist(), strict=True)
        shown = tuple(
            replace(unit, smallest=number)
            for unit, number in pairs
            if number <= unit.largest
        )
        return SearchProblem(statistics, shown, settings)

    @property
    def untestable(self) -> dict[str, str]:
        """Why a candidate is not tested."""
        small = set(self.tried) - {
            unit.candidate.key for unit in self.problem.terms if unit.candidate
        }
        return self.lacking | dict.fromkeys(
            sorted(small), "too small to be seen at any size that such an effect has"
        )


def build_candidate_design(
    fitted: Fit,
    observations: Observations,
    candidates: Sequence[Candidate],
    settings: Settings,
    max_pose_error_rad: float = np.inf,
) -> CandidateDesign:
    """Gather what the measurements say of a fit to them and of all candidates."""
    around = fitted.get_conditions(observations.states)
    there = fitted.model.available_inputs(observations.states)
    why = {
        candidate.key: explain_untestable(
            candidate, there, observations.states.joint_angles
        )
        for candidate in candidates
    }
    tried = {
        c.key: (c, choose_shape_values(c, fitted)) for c in candidates if not why[c.key]
    }
    # Beside no candidate nothing competes.
    against = build_discrepancies(around, settings.other_features) if candidates else []
    missing = {key: reason for key, reason in why.items() if reason}
    return CandidateDesign(
        fitted,
        observations,
        settings,
        around,
        tried,
        missing,
        frozenset(why),
        against,
        max_pose_error_rad,
    )


def find_smallest_detectable_sizes(
    statistics: SufficientStatistics, units: Sequence[ModelTerm], settings: Settings
) -> np.ndarray:
    """The smallest size at which each unit would be found with a power of one half,
    were it the only candidate.

    A test for one direction, with a Bonferroni correction for all units, reaches that
    where the non-centrality is the critical value. A smaller effect counts as not
    there. Returns places among the sizes (number of units,); their number where even
    the largest is too small to be seen.
    """
    critical = chdtri(1, settings.alarm_level / max(len(units), 1))
    largest = np.zeros(len(units))
    for block in TermBlock.of(statistics.at(slice(1)), units):
        largest[block.numbers] = block.axes[0][0].max(axis=1)
    return np.searchsorted(
        np.array(settings.scales) ** 2, critical / np.maximum(largest, 1e-9 * critical)
    )


def choose_shape_values(candidate: Candidate, fitted: Fit) -> list[Shapes]:
    """Values of the shape of a candidate over its range, list of tuple.

    Where the fit has the candidate, its value alone; or, where a search must try many
    lest it step over the law, which is a law that no fit can follow, values close to
    that of the fit.
    """
    if not candidate.shapes:
        return [()]
    (shape,) = candidate.shapes
    values = shape.values(_SHAPES_TRIED)
    if candidate.key in {effect.key for effect in fitted.model.effects}:
        (value,) = fitted.effect_values(candidate.key)[1].tolist()
        reach = _CLOSER_STILL * np.diff(values[:2]).sum()
        values = np.array([value])
        if shape.tried > 1:
            about = shape.between(value - reach, value + reach, 2 * _SHAPES_CLOSER + 1)
            values = np.unique(np.clip(about, shape.lowest, shape.highest))
    return [(float(value),) for value in values]


def refine_shapes(line: CandidateDesign, alone: np.ndarray) -> CandidateDesign:
    """The same with more shapes of the best candidates, closer to each other about the
    best value of each.

    `alone` (number of units,): log Bayes factor of each unit alone. Returns itself
    where no shape matters.
    """
    units = line.problem.terms
    tried = dict(line.tried)
    odds = alone + line.problem.started.first
    near = (
        (odds > odds.max() - _NEAR_THE_BEST) & (alone > _WORTH_A_LOOK)
        if len(units)
        else []
    )
    for unit in (units[number] for number in np.argsort(-odds) if near[number]):
        if (
            unit.shapes
            and unit.candidate
            and tried[unit.candidate.key] is line.tried[unit.candidate.key]
        ):
            (shape,), (best,), key = (
                unit.candidate.shapes,
                unit.shapes,
                unit.candidate.key,
            )
            known = sorted(
                each.shapes[0]
                for each in units
                if each.candidate and each.candidate.key == key
            )
            place = known.index(best)
            below = [shape.lowest, *known][place]
            above = [*known, shape.highest][place + 1]
            # The best may lie at an end of the range.
            sides = [
                edges for edges in ((below, best), (best, above)) if edges[0] < edges[1]
            ]
            closer = [
                value
                for edges in sides
                for value in shape.between(*edges, _SHAPES_CLOSER)
            ]
            tried[key] = (
                unit.candidate,
                [(float(value),) for value in sorted({*known, *closer})],
            )
    return line if tried == line.tried else line.alike(tried=tried)


def explain_untestable(
    candidate: Candidate, there: frozenset[str], joint_angles: np.ndarray
) -> str:
    """Why measurements at some joint angles (S, n) cannot test a candidate at all;
    empty where they might.

    `there`: of what it may need, as of `Model.offered`.
    """
    if missing := sorted(candidate.needs - there):
        return f"no {' and no '.join(missing)} in the data"
    for joint in (
        (candidate.joints or candidate.turning) if candidate.distinct_angles else ()
    ):
        angles = len(
            np.unique(np.round(np.mod(joint_angles[:, joint - 1], 2 * np.pi), 3))
        )
        if angles < candidate.distinct_angles:
            return (
                f"joint {joint} stood still"
                if angles == 1
                else "too few different angles of a joint"
            )
    return ""
