"""Weigh gross errors against everything that the declared model may lack.

A row that stands out beside one model may be explained by another. So suspect rows are
searched for effects and for gross errors at once, from several starts, and a row is
left out if it is more probably wrong than not (see `gross_error_terms`). What is still
wrong is tested as a group: accidents have nothing to do with the state of the robot.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.campaign import join_measurements
from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.evidence import SizeGrid
from elastocal.diagnosis.gross_error_terms import POSE, ROW, GrossErrorBasis
from elastocal.diagnosis.gross_errors import find_extreme_loads, find_gross_errors
from elastocal.diagnosis.hypotheses import GROSS_ERROR
from elastocal.diagnosis.local_effects import build_local_effects
from elastocal.diagnosis.search import search_from_starts
from elastocal.fitting.least_squares import evaluate_as_fit
from elastocal.fitting.observations import (
    select_spread_poses,
    select_states,
    separate_measurements,
)
from elastocal.fitting.sensor_noise import (
    compute_sensor_roots,
    standardize_residual,
)

if TYPE_CHECKING:
    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.diagnosis.gross_errors import OutlierTest
    from elastocal.diagnosis.search import Posterior, SearchProblem
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

# A row is left out if it is more probably wrong than not.
_MORE_PROBABLY_WRONG = 0.5
# Rows that are weighed at once; beyond it, the most distant ones keep the verdict of
# their distance. A model has at most as many terms.
_MOST_SUSPECTS = 60
# A pose is suspect as a whole if at least this many of its rows are, and this share.
_POSE_ROWS = 2
_POSE_SHARE = 0.5
# Ridge that keeps the joint error of a pose well posed, relative to its information.
_RIDGE = 1e-3
# Random signs of the test of a group, and the fewest poses whose signs can show
# anything at a level of one percent.
_SIGN_DRAWS = 999
_LEAST_POSES = 8
# Lower bound on the spread of a joint's angles, for joints that stand still.
_LEAST_SPREAD_RAD = 1e-9


@dataclass(frozen=True)
class Contamination:
    """What is wrong among N rows.

    Attributes
    ----------
    probability
        (N,), that a row is wrong.
    gross
        (N,) of bool, rows that are left out.
    group_p_value
        Probability that accidents agree as well with each other as the rows that are
        most probably wrong; None if there are too few.
    """

    probability: np.ndarray
    gross: np.ndarray
    group_p_value: float | None = None


@dataclass(frozen=True)
class JudgedRows:
    """What former tests say of N rows.

    Attributes
    ----------
    kept
        (N,) of bool, rows that are fitted.
    readmitted
        (N,) of bool, rows that stay whatever the next test says.
    probability
        (N,), that a row is wrong.
    """

    kept: np.ndarray
    readmitted: np.ndarray
    probability: np.ndarray


def find_wrong_rows(
    fitted: Fit,
    noise: Noise,
    case: Case,
    judged: JudgedRows,
    settings: Settings,
) -> OutlierTest:
    """Test all rows of a case against a fit, and weigh those that newly stand out.

    Parameters
    ----------
    fitted
        A fit to the rows that are kept.
    noise
        Noise of one row.
    case
        The whole case, of N measurements.
    judged
        What former tests say of the rows. If no further row stands out, the
        probabilities of rows that are left out stay.
    settings
        Settings of the diagnosis.
    """
    kept = judged.kept
    readmitted = judged.readmitted
    measurements = case.campaign.measurements
    outliers = find_gross_errors(fitted, noise, measurements, kept, settings)
    if not (outliers.gross & kept & ~readmitted).any():
        probability = np.where(kept, outliers.probability, judged.probability)
        gross = outliers.gross & ~readmitted
        return replace(outliers, gross=gross, probability=probability)
    # Rows under extreme loads are judged by a model that was found without them.
    weighable = ~find_extreme_loads(measurements, settings) & ~readmitted
    weighed = weigh_gross_errors(
        fitted, noise, case, outliers.gross & weighable, settings
    )
    probability = np.where(weighable, weighed.probability, outliers.probability)
    gross = np.where(weighable, weighed.gross, outliers.gross) & ~readmitted
    return replace(outliers, gross=gross, probability=probability)


def weigh_held_out_rows(
    fitted: Fit,
    noise: Noise,
    training: Case,
    held_out: Case,
    outliers: OutlierTest,
    settings: Settings,
) -> OutlierTest:
    """Weigh held-out rows that stand out, beside the training rows of their campaign.

    Parameters
    ----------
    fitted
        A fit to the training rows, transferred to all rows.
    noise
        Noise of one row.
    training, held_out
        Cases of one campaign.
    outliers
        Test of the held-out rows by their distance.
    settings
        Settings of the diagnosis.
    """
    measurements = training.campaign.measurements
    joined = join_measurements(measurements, held_out.campaign.measurements)
    campaign = replace(training.campaign, measurements=joined)
    suspects = np.append(np.zeros(len(measurements), bool), outliers.gross)
    weighed = weigh_gross_errors(
        fitted, noise, replace(training, campaign=campaign), suspects, settings
    )
    count = len(measurements)
    return replace(
        outliers, gross=weighed.gross[count:], probability=weighed.probability[count:]
    )


def weigh_gross_errors(
    fitted: Fit,
    noise: Noise,
    case: Case,
    suspects: np.ndarray,
    settings: Settings,
) -> Contamination:
    """Decide which suspect rows are wrong.

    Parameters
    ----------
    fitted
        A fit to the other rows, about which the problem is linearised.
    noise
        Noise of one row.
    case
        The whole case, of N measurements.
    suspects
        (N,) of bool, rows that stand out.
    settings
        Settings of the diagnosis.
    """
    certain = Contamination(suspects.astype(float), suspects)
    if not suspects.any():
        return certain
    sampled, observations = _sample_rows(case, suspects, settings)
    fixed_keys = _choose_fixed_effects(case, sampled, suspects, settings)
    problem = _Linearization.about(
        fitted, noise, case, observations, settings, fixed_keys
    )
    is_suspect = suspects[sampled]
    hopeless = problem.distance > settings.gross_error_reach * problem.compute_reach()
    weighed = np.flatnonzero(is_suspect & ~hopeless)
    weighed = weighed[np.argsort(problem.distance[weighed])][:_MOST_SUSPECTS]
    if not len(weighed):
        return certain
    # Rows that are certainly wrong take no part.
    kept = ~is_suspect
    kept[weighed] = True
    if not kept.all():
        observations = select_states(observations, kept)
        problem = _Linearization.about(
            fitted, noise, case, observations, settings, fixed_keys
        )
    basis = problem.build_gross_errors(np.flatnonzero(is_suspect[kept]))
    probability = suspects.astype(float)
    probability[sampled[kept]] = _search_with_gross_errors(problem.design, basis)
    gross = probability > _MORE_PROBABLY_WRONG
    wrong = gross[sampled[kept]]
    p_value = problem.test_group(wrong)
    if p_value is not None and p_value <= settings.gross_group_level:
        gross[sampled[kept]] = False
    return Contamination(probability, gross, p_value)


def _choose_fixed_effects(
    case: Case, sampled: np.ndarray, suspects: np.ndarray, settings: Settings
) -> frozenset[str]:
    """Choose the candidates whose effects stay as they were fitted.

    A few suspects among many other rows have not shaped the effects of a robust fit.
    Beside a sample of these rows the effects stay therefore, and the search looks for
    changes. Few are as many as are expected to be wrong in any campaign.
    """
    is_sample = len(sampled) < len(suspects)
    are_few = suspects.mean() <= settings.gross_error_probability
    return frozenset(case.candidates if is_sample and are_few else ())


@dataclass(frozen=True)
class _Linearization:
    """A problem of M rows, each of which has an observation of its own.

    Attributes
    ----------
    design
        Everything that the fit may lack.
    residual
        (M, c), in standard deviations of the sensor.
    """

    design: CandidateDesign
    residual: np.ndarray

    @classmethod
    def about(
        cls,
        fitted: Fit,
        noise: Noise,
        case: Case,
        observations: Observations,
        settings: Settings,
        fixed_keys: frozenset[str],
    ) -> _Linearization:
        """Linearise about a fit; `fixed_keys` as of `build_candidate_design`."""
        reference = evaluate_as_fit(fitted.model, observations, noise, fitted.estimate)
        design = build_candidate_design(
            reference,
            observations,
            list(case.candidates.values()),
            settings,
            fixed_keys=fixed_keys,
        )
        roots = compute_sensor_roots(fitted.model, fitted.estimate, observations, noise)
        return cls(design, standardize_residual(reference.residual, noise, roots))

    @property
    def distance(self) -> np.ndarray:
        """Lengths of the residuals, (M,)."""
        return np.linalg.norm(self.residual, axis=1)

    def compute_reach(self) -> np.ndarray:
        """Compute the standard deviation of the sum of everything that the catalogue may
        add to a row, (M,), in standard deviations of the noise; at least one."""
        grid = SizeGrid.from_settings(self.design.settings)
        variance = np.exp(grid.log_weights) @ grid.scales**2
        squares = (self.design.rows.candidates.dense() ** 2).sum(axis=(1, 2))
        return np.sqrt(1.0 + variance * squares)

    def build_gross_errors(self, suspects: np.ndarray) -> GrossErrorBasis:
        """Build the terms of suspect rows, (k,) of int, and of their poses.

        A pose with several rows may be wrong as a whole, by a joint error as large as
        its rows imply.
        """
        observations = self.design.whitened.observations
        pose = observations.cluster
        in_pose = np.bincount(pose)
        suspect_in_pose = np.bincount(pose[suspects], minlength=len(in_pose))
        is_common = suspect_in_pose >= np.maximum(_POSE_ROWS, _POSE_SHARE * in_pose)
        jacobian = self.design.whitened.rows.jacobian
        pose_sizes_rad = {}
        for number in np.flatnonzero(is_common).tolist():
            error = self._solve_joint_error(pose == number)
            pose_sizes_rad[number] = float(
                np.linalg.norm(error) / np.sqrt(jacobian.shape[2])
            )
        return GrossErrorBasis(
            observations,
            suspects,
            self.distance[suspects],
            pose_sizes_rad,
            jacobian.shape[2],
            build_local_effects(
                self.design.whitened.rows_and_conditions[1],
                observations,
                suspects,
                self.design.settings.largest_pose_error_rad,
            ),
        )

    def _solve_joint_error(self, chosen: np.ndarray) -> np.ndarray:
        """Solve for the joint error (n,) that the residuals of some rows have in
        common."""
        jacobian = self.design.whitened.rows.jacobian[chosen]
        jacobian = jacobian.reshape(-1, jacobian.shape[2])
        gram = jacobian.T @ jacobian
        ridge = _RIDGE * np.trace(gram) / len(gram)
        return np.linalg.solve(
            gram + ridge * np.eye(len(gram)),
            jacobian.T @ self.residual[chosen].ravel(),
        )

    def test_group(self, wrong: np.ndarray) -> float | None:
        """Test whether the joint errors of wrong poses agree with each other.

        Parameters
        ----------
        wrong
            (M,) of bool.
        """
        observations = self.design.whitened.observations
        errors = []
        states = []
        for pose in np.unique(observations.cluster[wrong]).tolist():
            chosen = wrong & (observations.cluster == pose)
            errors.append(self._solve_joint_error(chosen))
            states.append(observations.state[np.argmax(chosen)])
        if len(errors) < _LEAST_POSES:
            return None
        angles = observations.states.joint_angles
        spread = np.maximum(angles.std(axis=0), _LEAST_SPREAD_RAD)
        return compute_agreement_p_value(np.array(errors), angles[states] / spread)


def compute_agreement_p_value(errors: np.ndarray, states: np.ndarray) -> float:
    """Compute the probability that errors which are accidents agree as well.

    The statistic is the sum of the cosines between all errors, those of near states
    with more weight. Accidents have either sign with the same probability, and
    independently, so that random signs give its distribution exactly [1]_.

    Parameters
    ----------
    errors
        (k, n), joint error of each pose.
    states
        (k, d), in units of their spread over the campaign.

    References
    ----------
    .. [1] Good, Permutation, Parametric and Bootstrap Tests of Hypotheses, 2005.
    """
    directions = errors / np.linalg.norm(errors, axis=1, keepdims=True)
    squares = ((states[:, None] - states) ** 2).mean(axis=2)
    agreement = (directions @ directions.T) * (1.0 + np.exp(-0.5 * squares))
    np.fill_diagonal(agreement, 0.0)
    draws = np.random.default_rng(len(errors))
    signs = draws.choice([-1.0, 1.0], (_SIGN_DRAWS, len(errors)))
    drawn = ((signs @ agreement) * signs).sum(axis=1)
    return float((1 + (drawn >= agreement.sum()).sum()) / (1 + _SIGN_DRAWS))


def _sample_rows(
    case: Case, suspects: np.ndarray, settings: Settings
) -> tuple[np.ndarray, Observations]:
    """Choose the rows of all poses, or of suspect poses and a sample of the others.

    Returns
    -------
    ndarray, Observations
        Indices of the rows, and an observation of each.
    """
    measurements = case.campaign.measurements
    every_row = separate_measurements(measurements)
    limit = settings.gross_start_numbers // case.model.rows
    chosen = select_spread_poses(every_row, limit)
    if not chosen.all():
        suspect_rows = np.flatnonzero(suspects)
        count = min(len(suspect_rows), _MOST_SUSPECTS)
        spread = np.linspace(0, len(suspect_rows) - 1, count).astype(int)
        chosen |= np.isin(every_row.cluster, every_row.cluster[suspect_rows[spread]])
    return np.flatnonzero(chosen), select_states(every_row, chosen)


def _search_with_gross_errors(
    design: CandidateDesign, basis: GrossErrorBasis
) -> np.ndarray:
    """Search for effects and gross errors at once: the probability that a row is wrong,
    (M,).

    The search starts without any gross error, with all of them, and at the model that
    was fitted already; the best model then exchanges its gross errors for an effect.
    """
    problem = replace(design, gross_errors=basis).problem
    terms = problem.terms
    fitted_keys = {effect.key for effect in design.reference_fit.model.effects}
    fitted_keys -= design.whitened.fixed_keys
    fitted = problem.initial_search.choose_best_variants(
        number
        for number, term in enumerate(terms)
        if term.candidate and term.candidate.key in fitted_keys
    )
    search = problem.initial_search.duplicate()
    ranked = sorted(
        (
            tuple(sorted({*effects, *accidents}))
            for effects in ((), fitted)
            for accidents in _list_accidents(problem, basis)
        ),
        key=lambda start: search.evaluate(start).log_odds,
    )
    search = search_from_starts(problem, search, [(), *ranked[-1:]])
    best = search.find_best_model()
    effects = tuple(number for number in best if terms[number].mechanism != GROSS_ERROR)
    if effects and effects != best:
        search = search_from_starts(problem, search, [effects])
    return _compute_probabilities(problem, search.weigh(), basis)


def _list_accidents(
    problem: SearchProblem, basis: GrossErrorBasis
) -> list[tuple[int, ...]]:
    """Sets of gross errors that make all suspects wrong: row by row, and whole poses
    where there are such."""
    in_wrong_pose = np.isin(basis.poses, list(basis.pose_sizes_rad))
    rows = []
    poses = []
    for number, term in enumerate(problem.terms):
        if term.mechanism == GROSS_ERROR:
            kind, index = term.location
            if kind == ROW:
                rows.append(number)
            if kind == POSE or not in_wrong_pose[int(index)]:
                poses.append(number)
    return [tuple(rows), tuple(poses)]


def _compute_probabilities(
    problem: SearchProblem, posterior: Posterior, basis: GrossErrorBasis
) -> np.ndarray:
    """Probability of each observation, (M,), that it is wrong."""
    probability = np.zeros(len(basis.observations))
    for model, weight in zip(posterior.models, posterior.probabilities, strict=True):
        shifted = np.zeros(len(probability), bool)
        for number in model.term_indices:
            term = problem.terms[number]
            if term.mechanism == GROSS_ERROR:
                shifted |= basis.list_shifted(term)
        probability += weight * shifted
    # Rounding of the weights must not make more than certain of it.
    return np.minimum(probability, 1.0)
