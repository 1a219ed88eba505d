"""From a fit of the declared model to the problem that is searched: columns of every unit, whitened, and their products."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from elastocal.diagnosis import other
from elastocal.diagnosis.hypotheses import prior_of, units_of
from elastocal.diagnosis.search import Problem, likely_pose_errors, pose_errors_within_reach
from elastocal.diagnosis.statistics import products_of, statistics_of
from elastocal.diagnosis.summed import (
    MOST_HELD,
    OBSERVATIONS_AT_ONCE,
    SAMPLE_ROWS,
    WhiteRows,
    rows_at_once,
    summed,
    triangle_of,
)
from elastocal.effects.conditions import at_states
from elastocal.errors import InputError
from elastocal.fitting.factored import Displacements, Factored
from elastocal.fitting.linearization import linearize
from elastocal.fitting.observations import part_at, parts_of, select_states, spread_poses
from elastocal.fitting.parameters import nonlinear_parameters as shape_parameters
from elastocal.fitting.parameters import parameter_values
from elastocal.fitting.whitening import whitening

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from elastocal.diagnosis.hypotheses import Unit
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.statistics import Products, Statistics
    from elastocal.diagnosis.summed import Sums
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate, Displacing, Parameter
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.linearization import Linearization
    from elastocal.fitting.model import Model as FittedModel
    from elastocal.fitting.observations import Observations, States
    from elastocal.fitting.whitening import Scaling, Whitening

# Values of a shape that are tried: neighbours differ by less than measurements show at the sizes that matter.
_SHAPES_TRIED = 3
# Of one pose about the joints, 1/rad^2: below it the targets move by rounding only.
_LEAST_INFORMATION = 1e-6
# Values that a closer look tries to either side of the best, short of its neighbours. Where the fit has the candidate already,
# a step is looked for within a quarter of the spacing to either side.
_SHAPES_CLOSER, _CLOSER_STILL = 3, 0.25
# A candidate is looked at more closely whose log odds come so near to those of the best and whose log Bayes factor is so large:
# below, its shape hardly matters.
_NEAR_THE_BEST, _WORTH_A_LOOK = 10.0, 5.0
# Declared parameters without a prior of their own get one this many times their plausible size: it decides nothing, and keeps
# well posed what the measurements do not determine.
_WIDE = 10.0


@dataclass(frozen=True)
class Linearized:
    """A model about a fit, and everything that it might lack.

    `products`: of one pass over the measurements. `untestable`: why a candidate is not tested. `around`: of the states looked
    at. `candidates`: keys of all candidates: parameters of the fit that they own are coefficients of units here.
    `pose_std_error_rad`: with which the measurements of one pose tell a joint angle. `laws`: of the competitors.
    """

    problem: Problem
    products: Products | Sums
    untestable: dict[str, str]
    about: Fit
    around: Conditions
    candidates: frozenset[str]
    pose_std_error_rad: float
    laws: list[other.Law]


def linearized(
    fitted: Fit,
    observations: Observations,
    candidates: Sequence[Candidate],
    settings: Settings,
    shapes: dict[str, list[tuple[float, ...]]] | None = None,
    before: Linearized | None = None,
) -> Linearized:
    """Gather what the measurements say of a fit and of all candidates.

    Coefficients count from zero, not from the fit: what candidates and declared geometry contribute to the prediction is
    given back to the residual, so that their priors mean what they say.

    `fitted`: of the declared model, or with effects found already, about which the problem is then linear. `shapes`: values of
    the shape of some candidates, by their keys, instead of `shapes_tried`. `before`: of the same fit and observations.
    """
    around, sites = before.around if before else fitted.conditions_of(observations.states), fitted.model.sites
    untestable = {c.key: reason for c in candidates if (reason := lacking(c, fitted.model, observations.states))}
    tried = {c.key: shapes_tried(c, fitted) for c in candidates if c.key not in untestable} | (shapes or {})
    tested = [(c, values) for c in candidates if c.key in tried for values in tried[c.key]]
    against = other.competitors(around)
    laws = before.laws if before else [other.law_of(each, around, settings.other_features) for each in against]
    units = units_of(tested, [(each, law.features) for each, law in zip(against, laws, strict=True)], settings)
    owners = np.array([owner for owner, _ in fitted.parameters])
    keys = frozenset(candidate.key for candidate in candidates)
    found = np.isin(owners, list(keys))
    values = np.where(shape_parameters(fitted.model, fitted.estimate), 0.0, parameter_values(fitted.model, fitted.estimate))
    parameters = [parameter for (_, parameter), left in zip(fitted.parameters, found, strict=True) if not left]
    deviation = prior_deviations(parameters)
    present = np.where([parameter.prior_std is not None for parameter in parameters], values[~found], 0.0)
    source = _Source(fitted, observations, around, tested, laws, units, found, values)
    width = int((~found).sum()) + sum(len(unit.columns) for unit in units)
    held = len(observations) * observations.rows * width <= MOST_HELD
    parts = parts_of(observations, len(observations) if held else OBSERVATIONS_AT_ONCE)
    # Held, one linearisation serves the declared part and the candidates; else the declared part alone takes larger parts.
    larger_parts = parts if held else parts_of(observations, rows_at_once(len(owners) + 60) // observations.rows)
    lines = [*source.lines(parts)] if held else source.lines(larger_parts)
    triangle, unit_rad = source.declared_part(lines)
    still = np.zeros(sites.joints)
    grid = unit_rad * np.array(settings.pose_steps)
    if held:
        (block,) = source.blocks(lines)
        whole = products_of(block, deviation, present, still)
        grid = grid[pose_errors_within_reach(statistics_of(whole.without_candidates, grid), settings)]
        products: Products | Sums = whole
    else:
        some = source.sample()
        sample = summed([some], triangle_of([_flat(some.declared)]), deviation, present, grid)
        grid = grid[likely_pose_errors(statistics_of(sample, grid), units, settings)]
        products = summed(source.blocks(source.lines(parts)), triangle[:-1, :-1], deviation, present, grid)
    statistics = statistics_of(products, grid)
    smallest = smallest_shown(statistics, units, settings)
    shown = tuple(replace(unit, smallest=int(n)) for unit, n in zip(units, smallest, strict=True) if n <= unit.largest)
    small = {unit.candidate.key for unit in units if unit.candidate} - {u.candidate.key for u in shown if u.candidate}
    untestable |= dict.fromkeys(sorted(small), "too small to be seen at any size that such an effect has")
    # Columns of units that are left out stay in the statistics, where nothing refers to them.
    problem = Problem(statistics, shown, prior_of(shown, settings), settings)
    return Linearized(problem, products, untestable, fitted, around, keys, unit_rad, laws)


def prior_deviations(parameters: Sequence[Parameter]) -> np.ndarray:
    """Standard deviations of the priors of declared parameters about zero, wide ones where there is none, ndarray (P,)."""
    return np.array([_WIDE * p.plausible if p.prior_std is None else p.prior_std for p in parameters])


def smallest_shown(statistics: Statistics, units: Sequence[Unit], settings: Settings) -> np.ndarray:
    """The smallest size at which each unit would be found with a power of one half, were it the only candidate.

    A test for one direction, with a Bonferroni correction for all units, reaches that where the non-centrality is the critical
    value. A smaller effect is there or not, and the measurements are the same: it counts as not there.

    Returns (number of units,) of int: place among the sizes; their number where even the largest is too small to be seen.
    """
    critical = chdtri(1, settings.alarm_level / max(len(units), 1))
    grams = (statistics.gram[0][np.ix_(unit.columns, unit.columns)] for unit in units)
    largest = np.array([np.linalg.eigvalsh(gram)[-1] for gram in grams])
    return np.searchsorted(np.array(settings.scales) ** 2, critical / np.maximum(largest, 1e-9 * critical))


@dataclass(frozen=True)
class _Source:
    """Whitened rows of a fit, made for some whole poses at a time.

    `around`: of their states. `tested` (Candidate, tuple). `units`: of both. `found` (P,) of bool: which parameters of the fit
    are those of candidates. `values` (P,): of the parameters, in which the prediction is linear; zero for shapes.
    """

    fitted: Fit
    observations: Observations
    around: Conditions
    tested: list[tuple[Candidate, tuple[float, ...]]]
    against: list[other.Law]
    units: tuple[Unit, ...]
    found: np.ndarray
    values: np.ndarray

    def lines(self, parts: Iterable[tuple[slice, slice]]) -> Iterator[_Line]:
        """Each part about the fit."""
        fitted = self.fitted
        for states, seen in parts:
            some = part_at(self.observations, states, seen)
            line = linearize(fitted.model, fitted.estimate, some, at_states(self.around, states))
            jacobian, root = fitted.jacobian_at(line, seen), np.sqrt(fitted.weights[seen])
            yield _Line(line, some, jacobian, whitening(some, jacobian, fitted.noise.of_measurements), root)

    def declared_part(self, lines: Iterable[_Line]) -> tuple[np.ndarray, float]:
        """Triangular factor of declared sensitivities and residual; standard error with which one pose tells a joint."""
        information: list[np.ndarray] = []

        def rows() -> Iterator[np.ndarray]:
            for part in lines:
                line, some = part.line, part.observations
                squares = (part.white(part.jacobian) ** 2).sum(axis=(1, 2)) / part.jacobian.shape[-1]
                information.append(np.bincount(some.cluster, squares))
                yield _flat(
                    part.white(np.concatenate([line.sensitivities[..., ~self.found], line.residual[..., None]], axis=2))
                )

        triangle = triangle_of(rows())
        shown = float(np.median(np.concatenate(information)))
        if shown < _LEAST_INFORMATION:
            raise InputError(
                "campaign", "targets", "measurements that no joint moves", "targets on what moves, off a lone axis"
            )
        return triangle, 1.0 / np.sqrt(shown)

    def blocks(self, lines: Iterable[_Line]) -> Iterator[WhiteRows]:
        """`WhiteRows` of each part.

        What errs together is of one state, and a candidate displaces states: the Jacobian is whitened, not every column.
        """
        sizes = np.concatenate([unit.sizes for unit in self.units])
        laws: list[tuple[Displacing, tuple[float, ...]]] = [*self.tested, *((law, ()) for law in self.against)]
        for part in lines:
            line, some = part.line, part.observations
            displaced = [law for effect, shapes in laws for law in effect.displacement(line.conditions, *shapes)]
            displacements = Displacements.of(displaced, sizes, len(some.states))
            residual = line.residual + line.sensitivities[..., self.found] @ self.values[self.found]
            yield WhiteRows(
                part.white(line.sensitivities[..., ~self.found]),
                Factored(displacements, part.white(line.coordinate_jacobian), some.state),
                part.white(residual),
                part.white(part.jacobian),
                some.cluster,
            )

    def sample(self) -> WhiteRows:
        """Rows of some poses all over the campaign."""
        chosen = spread_poses(self.observations, SAMPLE_ROWS // self.observations.rows)
        some, seen = selected(self.fitted, self.observations, chosen)
        few = replace(self, fitted=some, observations=seen, around=some.conditions_of(seen.states))
        (block,) = few.blocks(few.lines(parts_of(seen, len(seen))))
        return block


@dataclass(frozen=True)
class _Line:
    """A part of the measurements about a fit.

    `jacobian` (M, rows, n): with respect to the joints. `root` (M,): square roots of the weights.
    """

    line: Linearization
    observations: Observations
    jacobian: np.ndarray
    whitening: Whitening | Scaling
    root: np.ndarray

    def white(self, values: np.ndarray) -> np.ndarray:
        """Weighted and whitened values (M, rows, ...)."""
        return self.whitening.apply(values * self.root.reshape(-1, *[1] * (values.ndim - 1)))


def _flat(values: np.ndarray) -> np.ndarray:
    """Values (M, rows, k) as rows (rows * M, k): those of one component after those of another, as effects make them."""
    return values.swapaxes(0, 1).reshape(values.shape[0] * values.shape[1], values.shape[2])


def selected(fitted: Fit, observations: Observations, chosen: np.ndarray) -> tuple[Fit, Observations]:
    """A fit and its observations in some of the states.

    `chosen` (S,) of bool.
    """
    if chosen.all():
        return fitted, observations
    some, seen = select_states(observations, chosen), chosen[observations.state]
    around = fitted.conditions_of(some.states, chosen)
    jacobian = None if fitted.joint_jacobian is None else fitted.joint_jacobian[seen]
    kept = replace(
        fitted, conditions=around, weights=fitted.weights[seen], residual=fitted.residual[seen], joint_jacobian=jacobian
    )
    return kept, some


def shapes_tried(candidate: Candidate, fitted: Fit) -> list[tuple[float, ...]]:
    """Values of the shape of a candidate over its range, list of tuple.

    Where the fit has the candidate, its value alone; or, where a search must try many lest it step over the law, which is a law
    that no fit can follow, values close to that of the fit.
    """
    if not candidate.shapes:
        return [()]
    (shape,) = candidate.shapes
    values = shape.values(_SHAPES_TRIED)
    if candidate.key in {effect.key for effect in fitted.model.effects}:
        (value,) = fitted.values_of(candidate.key)[1].tolist()
        reach = _CLOSER_STILL * np.diff(values[:2]).sum()
        values = np.array([value])
        if shape.tried > 1:
            about = shape.between(value - reach, value + reach, 2 * _SHAPES_CLOSER + 1)
            values = np.unique(np.clip(about, shape.lowest, shape.highest))
    return [(float(value),) for value in values]


def shapes_looked_at_closely(problem: Problem, alone: np.ndarray) -> dict[str, list[tuple[float, ...]]]:
    """Values of the shapes of the best candidates, closer to each other about the best value of each.

    `alone` (number of units,): log Bayes factor of each unit alone. Returns by the keys of candidates; empty where no shape
    matters.
    """
    units = problem.units
    odds = alone + [problem.prior.log_odds_of([unit]) for unit in units]
    found: dict[str, list[tuple[float, ...]]] = {}
    for number in np.argsort(-odds):
        unit = units[number]
        near = odds[number] > odds.max() - _NEAR_THE_BEST and alone[number] > _WORTH_A_LOOK
        if near and unit.shapes and unit.candidate and unit.candidate.key not in found:
            (shape,), (best,) = unit.candidate.shapes, unit.shapes
            tried = sorted(other.shapes[0] for other in units if other.candidate and other.candidate.key == unit.candidate.key)
            place = tried.index(best)
            below, above = [shape.lowest, *tried][place], [*tried, shape.highest][place + 1]
            # The best may lie at an end of the range.
            sides = [edges for edges in ((below, best), (best, above)) if edges[0] < edges[1]]
            closer = [value for edges in sides for value in shape.between(*edges, _SHAPES_CLOSER)]
            found[unit.candidate.key] = [(float(value),) for value in sorted({*tried, *closer})]
    return found


def lacking(candidate: Candidate, model: FittedModel, states: States) -> str:
    """Why the measurements cannot test a candidate at all; empty where they might."""
    missing = sorted(candidate.needs - model.offered(states))
    if missing:
        return f"no {' and no '.join(missing)} in the data"
    for joint in (candidate.joints or candidate.turning) if candidate.distinct_angles else ():
        angles = len(np.unique(np.round(np.mod(states.joint_angles[:, joint - 1], 2 * np.pi), 3)))
        if angles < candidate.distinct_angles:
            return f"joint {joint} stood still" if angles == 1 else "too few different angles of a joint"
    return ""
