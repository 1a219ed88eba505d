"""From a fit to the problem that is searched: the whitened columns of everything that
the fitted model might lack, and their products."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from elastocal.diagnosis.discrepancy import Discrepancy, build_discrepancies
from elastocal.diagnosis.evidence import TermBlock, list_pose_errors
from elastocal.diagnosis.hypotheses import (
    ModelTerm,
    build_terms,
    list_mass_evaluations,
)
from elastocal.diagnosis.search import SearchProblem, select_pose_errors
from elastocal.diagnosis.statistics import (
    CrossProducts,
    SufficientStatistics,
    WhitenedRows,
    compute_cross_products,
    compute_statistics,
)
from elastocal.effects.conditions import replace_springs
from elastocal.errors import InputError
from elastocal.fitting.linearization import FactoredSensitivities, linearize
from elastocal.fitting.model import find_nonlinear_parameters, get_parameter_values
from elastocal.fitting.normal_equations import compute_whitening
from elastocal.fitting.observations import Observations, select_spread_poses
from elastocal.fitting.sensor_noise import compute_sensor_roots

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.gross_error_terms import GrossErrorBasis
    from elastocal.diagnosis.settings import Settings
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate, Shape
    from elastocal.fitting.least_squares import Fit

    ShapeValues = list[tuple[float, ...]]

# Number of values of a shape that are tried: neighbours differ by less than the
# measurements show at the sizes that matter.
_SHAPES_TRIED = 3
# Least information of one pose on the joint angles, 1/rad^2: below it only rounding
# moves the targets.
_LEAST_INFORMATION = 1e-6
# Number of values that a refinement tries to either side of the best value, within its
# neighbours. If the fit has the candidate already, the values lie within this share of
# the spacing to either side.
_SHAPES_CLOSER = 3
_CLOSER_STILL = 0.25
# The shapes of a term are refined if its log odds are this close to the best ones and
# its log Bayes factor is at least this large; below, its shape hardly matters.
_NEAR_THE_BEST = 10.0
_WORTH_A_LOOK = 5.0
# Declared parameters without a prior get one of this many times their plausible size.
# It decides nothing, but keeps well posed what the measurements do not determine.
_WIDE = 10.0
# Above this number of rows, a sample decides which sizes of the pose error can matter.
# The sample has several rows for each parameter.
_MANY_ROWS = 8000
_SAMPLE_ROWS = 1500


@dataclass(frozen=True)
class WhitenedFit:
    """A fit linearised about its estimate for some observations, and whitened.

    The prediction of candidates that the fit has already is given back to the residual,
    so that their coefficients count from zero, unless their effects stay as they were
    fitted. The rows are computed when they are first asked for.

    Attributes
    ----------
    fitted : the fit, whose weights and noise whiten the rows
    observations : M observations
    conditions : conditions of their states, loads at the undeflected robot
    candidate_keys : keys of all candidates
    fixed_keys : keys of candidates whose effects stay as they were fitted; their
        coefficients count from there
    """

    fitted: Fit
    observations: Observations
    conditions: Conditions
    candidate_keys: frozenset[str]
    fixed_keys: frozenset[str] = frozenset()

    @cached_property
    def is_candidate(self) -> np.ndarray:
        """Which parameters of the fit belong to candidates, bool."""
        return self._is_owned_by(self.candidate_keys)

    def _is_owned_by(self, keys: frozenset[str]) -> np.ndarray:
        owners = [owner for owner, _ in self.fitted.parameters]
        return np.isin(owners, list(keys))

    @cached_property
    def linear_values(self) -> np.ndarray:
        """Values of all parameters of the fit; zero if the prediction is not linear in
        them (shapes)."""
        model = self.fitted.model
        estimate = self.fitted.estimate
        is_nonlinear = find_nonlinear_parameters(model, estimate)
        return np.where(is_nonlinear, 0.0, get_parameter_values(model, estimate))

    @property
    def rows(self) -> WhitenedRows:
        """Whitened rows whose candidates hold only the Jacobian of the coordinates."""
        return self.rows_and_conditions[0]

    @cached_property
    def rows_and_conditions(self) -> tuple[WhitenedRows, Conditions]:
        """The rows, and the conditions at the deflected robot.

        A candidate displaces the coordinates of a state, and correlated errors are of
        one state. So it is the Jacobian that is whitened, not every column.
        """
        fitted = self.fitted
        observations = self.observations
        linearization = linearize(
            fitted.model, fitted.estimate, observations, self.conditions
        )
        root_weights = np.sqrt(fitted.weights)
        noise = fitted.noise.without_pose_error
        roots = compute_sensor_roots(fitted.model, fitted.estimate, observations, noise)
        whitener = compute_whitening(
            observations, linearization.joint_jacobian, noise, roots
        )

        def whiten(values: np.ndarray) -> np.ndarray:
            trailing_axes = [1] * (values.ndim - 1)
            return whitener.apply(values * root_weights.reshape(-1, *trailing_axes))

        columns = linearization.columns
        is_returned = self._is_owned_by(self.candidate_keys - self.fixed_keys)
        contribution = columns.combine(np.where(is_returned, self.linear_values, 0.0))
        no_candidates = FactoredSensitivities.of(
            [],
            whiten(linearization.coordinate_jacobian),
            observations.state,
            len(observations.states),
        )
        rows = WhitenedRows(
            whiten(columns.select_columns(~self.is_candidate).dense()),
            no_candidates,
            whiten(linearization.residual + contribution),
            whiten(linearization.joint_jacobian),
            observations.cluster,
        )
        return rows, linearization.conditions


@dataclass(frozen=True)
class _Precomputed:
    """Results of a design that remain after its rows were released."""

    products: CrossProducts
    problem: SearchProblem
    pose_std_error_rad: float


@dataclass(frozen=True)
class CandidateDesign:
    """A model about a fit, and everything that it might lack.

    Costly parts are computed when they are first asked for. Designs that share one
    `WhitenedFit` share its rows.

    Attributes
    ----------
    reference_fit : the fit, whose model has the priors of the declared parameters
    whitened : its whitened rows for the observations of the search
    settings : settings of the diagnosis
    tried : candidates that can be tested at all, by key, each with the values of its
        shape
    untestable_by_data : by key, why other candidates cannot be tested
    discrepancies : competitors of the candidates
    max_pose_error_rad : largest size of the pose error to be considered
    precomputed : results that are kept after the rows were released
    gross_errors : gross errors that compete with the candidates
    """

    reference_fit: Fit
    whitened: WhitenedFit
    settings: Settings
    tried: dict[str, tuple[Candidate, ShapeValues]]
    untestable_by_data: dict[str, str]
    discrepancies: list[Discrepancy]
    max_pose_error_rad: float
    precomputed: _Precomputed | None = None
    gross_errors: GrossErrorBasis | None = None

    @property
    def without_rows(self) -> CandidateDesign:
        """The same with the search problem, but without its first search and without the
        arrays that grow with the measurements."""
        results = _Precomputed(
            self.products.without_rows, replace(self.problem), self.pose_std_error_rad
        )
        return replace(self, whitened=replace(self.whitened), precomputed=results)

    @cached_property
    def terms(self) -> tuple[ModelTerm, ...]:
        """Terms of candidates, discrepancies and gross errors, in the order of their
        columns."""
        terms = build_terms(
            self.tried.values(),
            self.discrepancies,
            self.settings,
            has_masses=self._has_masses,
        )
        if self.gross_errors:
            first_column = sum(len(term.columns) for term in terms)
            scales = len(self.settings.scales)
            terms += self.gross_errors.build_terms(first_column, scales)
        return terms

    @property
    def _has_masses(self) -> bool:
        return bool(self.reference_fit.model.sites.masses)

    @property
    def priors(self) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviation (P,) of the prior of each declared parameter, wide if it
        has none, and its present value (P,), zero if it has none."""
        deviations = []
        present = []
        for (_, parameter), value, is_candidate in zip(
            self.reference_fit.parameters,
            self.whitened.linear_values,
            self.whitened.is_candidate,
            strict=True,
        ):
            if is_candidate:
                continue
            has_prior = parameter.prior_std is not None
            deviations.append(
                parameter.prior_std if has_prior else _WIDE * parameter.plausible
            )
            present.append(value if has_prior else 0.0)
        return np.array(deviations), np.array(present)

    @property
    def rows(self) -> WhitenedRows:
        """Whitened rows with the candidate columns in the order of the terms."""
        rows, conditions = self.whitened.rows_and_conditions
        by_masses = {False: conditions}
        if self._has_masses:
            no_corrections = np.zeros_like(conditions.mass_corrections)
            by_masses[True] = replace_springs(
                conditions, conditions.compliance, no_corrections
            )
        displacements = []
        for candidate, shape_values in self.tried.values():
            for at_declared_masses in list_mass_evaluations(
                candidate, has_masses=self._has_masses
            ):
                for shapes in shape_values:
                    displacements += candidate.displacement(
                        by_masses[at_declared_masses], *shapes
                    )
        for discrepancy in self.discrepancies:
            displacements += discrepancy.displacement(conditions)
        jacobian = rows.candidates.jacobian
        if self.gross_errors:
            displacements += self.gross_errors.displacement(jacobian.shape[2])
            jacobian = self.gross_errors.extend_jacobian(jacobian)
        candidates = FactoredSensitivities.of(
            displacements,
            jacobian,
            rows.candidates.state,
            len(self.whitened.observations.states),
            np.concatenate([term.sizes for term in self.terms]),
        )
        return replace(rows, candidates=candidates)

    @cached_property
    def products(self) -> CrossProducts:
        """Products of the rows."""
        if self.precomputed:
            return self.precomputed.products
        return compute_cross_products(self.rows, *self.priors)

    @cached_property
    def pose_std_error_rad(self) -> float:
        """Standard error with which the measurements of one pose determine a joint
        angle."""
        if self.precomputed:
            return self.precomputed.pose_std_error_rad
        rows = self.whitened.rows
        by_observation = (rows.jacobian**2).sum(axis=(1, 2)) / rows.jacobian.shape[-1]
        information = float(np.median(np.bincount(rows.pose, by_observation)))
        if information < _LEAST_INFORMATION:
            raise InputError(
                "campaign",
                "targets",
                "measurements that no joint moves",
                "targets on a moving link, away from the axis of a single joint",
            )
        return 1.0 / np.sqrt(information)

    @property
    def candidate_pose_errors_rad(self) -> np.ndarray:
        """Sizes of the pose error that are considered, zero first."""
        sizes = list_pose_errors(self.pose_std_error_rad, self.settings)
        return np.unique(np.minimum(sizes, self.max_pose_error_rad))

    @cached_property
    def problem(self) -> SearchProblem:
        """The problem that is searched.

        Columns of terms that the measurements cannot show stay in the statistics, where
        no term refers to them.
        """
        if self.precomputed:
            return self.precomputed.problem
        statistics = compute_statistics(self.products, self._select_pose_errors())
        smallest = find_smallest_detectable_sizes(statistics, self.terms, self.settings)
        detectable = tuple(
            replace(term, smallest=index)
            for term, index in zip(self.terms, smallest.tolist(), strict=True)
            if index <= term.largest
        )
        return SearchProblem(statistics, detectable, self.settings)

    def _select_pose_errors(self) -> np.ndarray:
        """Sizes of the pose error that can matter for any model, zero first."""
        products = self.products
        sizes = self.candidate_pose_errors_rad
        declared_only = compute_statistics(products.without_candidates, sizes)
        sizes = sizes[select_pose_errors(declared_only, self.settings)]
        if products.rows.residual.size <= _MANY_ROWS:
            return sizes
        observations = self.whitened.observations
        chosen = select_spread_poses(observations, _SAMPLE_ROWS // observations.rows)
        sample = compute_cross_products(
            products.rows.at(chosen[observations.state]), *self.priors
        )
        sample_problem = SearchProblem(
            compute_statistics(sample, sizes), self.terms, self.settings
        )
        likely = sample_problem.initial_search.statistics.pose_error_rad
        # The grid always contains zero, because the stored Gram matrices belong to a
        # pose error of zero.
        return np.union1d(0.0, likely)

    @property
    def untestable(self) -> dict[str, str]:
        """Why a candidate is not tested, by key."""
        tested = {term.candidate.key for term in self.problem.terms if term.candidate}
        too_small = sorted(set(self.tried) - tested)
        reason = "not detectable even at its largest plausible size"
        return self.untestable_by_data | dict.fromkeys(too_small, reason)


def build_candidate_design(
    fitted: Fit,
    observations: Observations,
    candidates: Sequence[Candidate],
    settings: Settings,
    max_pose_error_rad: float = np.inf,
    fixed_keys: frozenset[str] = frozenset(),
) -> CandidateDesign:
    """Gather everything that a fitted model might lack, for some observations.

    Parameters
    ----------
    fitted : the fit
    observations : observations of the search
    candidates : candidates of the catalogue
    settings : settings of the diagnosis
    max_pose_error_rad : largest size of the pose error to be considered
    fixed_keys : keys of candidates whose effects stay as they were fitted
    """
    conditions = fitted.get_conditions(observations.states)
    available = fitted.model.available_inputs(observations.states)
    tried = {}
    untestable = {}
    for candidate in candidates:
        reason = explain_untestable(
            candidate, available, observations.states.joint_angles
        )
        if reason:
            untestable[candidate.key] = reason
        else:
            tried[candidate.key] = candidate, choose_shape_values(candidate, fitted)
    # Without candidates there is nothing to compete with.
    discrepancies = (
        build_discrepancies(conditions, settings.other_features) if candidates else []
    )
    keys = frozenset(candidate.key for candidate in candidates)
    return CandidateDesign(
        fitted,
        WhitenedFit(fitted, observations, conditions, keys, fixed_keys),
        settings,
        tried,
        untestable,
        discrepancies,
        max_pose_error_rad,
    )


def find_smallest_detectable_sizes(
    statistics: SufficientStatistics, terms: Sequence[ModelTerm], settings: Settings
) -> np.ndarray:
    """Find the smallest scale at which each term would be found with a power of one
    half, were it the only candidate.

    A test in one direction, with a Bonferroni correction for all terms, reaches that
    power if the non-centrality is the critical value. A smaller effect counts as
    absent.

    Returns
    -------
    (number of terms,) int, index of the scale; the number of scales if even the largest
    one is too small to be detected
    """
    critical = chdtri(1, settings.detection_level / max(len(terms), 1))
    largest_eigenvalue = np.zeros(len(terms))
    for block in TermBlock.group(statistics.at(slice(1)), terms):
        largest_eigenvalue[block.numbers] = block.eigenvalues[0].max(axis=1)
    needed = critical / np.maximum(largest_eigenvalue, 1e-9 * critical)
    return np.searchsorted(np.array(settings.scales) ** 2, needed)


def choose_shape_values(candidate: Candidate, fitted: Fit) -> ShapeValues:
    """Choose values of the shape of a candidate over its range.

    If the fit has the candidate, its value alone is chosen. Some shapes change the
    prediction in steps, so that no fit can follow them and many values must be tried;
    for these, values close to that of the fit are chosen as well.
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
            near = shape.between(value - reach, value + reach, 2 * _SHAPES_CLOSER + 1)
            values = np.unique(np.clip(near, shape.lowest, shape.highest))
    return [(float(value),) for value in values]


def refine_shapes(
    design: CandidateDesign, log_bayes_factors: np.ndarray
) -> CandidateDesign:
    """Try more values of the shapes of the best candidates, close to the best value of
    each.

    Parameters
    ----------
    design : the present values
    log_bayes_factors : (number of terms,), of each single term

    Returns
    -------
    The refined design, or the same object if no shape matters
    """
    terms = design.problem.terms
    if not len(terms):
        return design
    log_odds = log_bayes_factors + design.problem.initial_search.single_term_log_prior
    matters = (log_odds > log_odds.max() - _NEAR_THE_BEST) & (
        log_bayes_factors > _WORTH_A_LOOK
    )
    refined: dict[str, tuple[Candidate, ShapeValues]] = {}
    for number in np.argsort(-log_odds).tolist():
        term = terms[number]
        candidate = term.candidate
        # The first term of a candidate has the best value of its shape.
        if (
            matters[number]
            and term.shapes
            and candidate
            and candidate.key not in refined
        ):
            values = sorted(
                {
                    variant.shapes[0]
                    for variant in terms
                    if variant.candidate and variant.candidate.key == candidate.key
                }
            )
            values = _refine_values(candidate.shapes[0], values, term.shapes[0])
            refined[candidate.key] = candidate, [(value,) for value in values]
    tried = design.tried | refined
    return design if tried == design.tried else replace(design, tried=tried)


def _refine_values(shape: Shape, values: list[float], best: float) -> list[float]:
    """Values of a shape, rising, and more of them between the best one and its
    neighbours; the best one may lie at an end of the range."""
    index = values.index(best)
    below = [shape.lowest, *values][index]
    above = [*values, shape.highest][index + 1]
    refined = set(values)
    for low, high in ((below, best), (best, above)):
        if low < high:
            refined.update(shape.between(low, high, _SHAPES_CLOSER))
    return [float(value) for value in sorted(refined)]


def explain_untestable(
    candidate: Candidate, available: frozenset[str], joint_angles: np.ndarray
) -> str:
    """Explain why measurements cannot test a candidate at all; empty if they might.

    Parameters
    ----------
    candidate : the candidate
    available : names of the data that a candidate may need, as of `Model.available_inputs`
    joint_angles : (S, n), at which was measured
    """
    missing = candidate.needs - available
    if "load" in missing:
        # Without any load there is none on the joints either.
        missing -= {"load on the joints"}
    if missing:
        return f"no {' and no '.join(sorted(missing))} in the data"
    if not candidate.distinct_angles:
        return ""
    for joint in candidate.joints or candidate.turning:
        angles = np.mod(joint_angles[:, joint - 1], 2 * np.pi)
        distinct = len(np.unique(np.round(angles, 3)))
        if distinct == 1 < candidate.distinct_angles:
            return f"joint {joint} stood still"
        if distinct < candidate.distinct_angles:
            return "too few different angles of a joint"
    return ""
