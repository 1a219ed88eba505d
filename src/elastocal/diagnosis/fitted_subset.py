"""The part of a case that is fitted: all rows but the gross errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.contamination import weigh_gross_errors
from elastocal.diagnosis.gross_errors import find_extreme_loads, find_gross_errors
from elastocal.diagnosis.initial_outliers import find_unexplained_observations
from elastocal.fitting.least_squares import (
    CONVERGENCE_TOLERANCE,
    INTERMEDIATE_TOLERANCE,
    LARGE_FIT_SIZE,
    evaluate_as_fit,
    fit_model,
)
from elastocal.fitting.noise import estimate_noise, fit_declared_model
from elastocal.fitting.observations import (
    match_states_and_targets,
    remove_outlying_repeats,
    sample_observations,
    select_spread_poses,
    select_states,
)

if TYPE_CHECKING:
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

# Tolerance of the last fit to a long campaign, in standard errors of its first step.
# That step leaves a tenth of itself, or less.
_LONG_FIT_TOLERANCE = 1.0


@dataclass(frozen=True)
class FittedSubset:
    """The part of a case that is fitted, and the fit of its declared model.

    Attributes
    ----------
    case
        The case without the rows that are left out.
    kept
        (N,) of bool, which of all measurements it has.
    noise
        Noise of its measurements.
    warnings
        What is suspicious about the noise.
    declared
        Fit of the declared model to the search sample.
    search_sample
        Observations that a search uses: all, or a sample of a long campaign.
    wrong_probability
        (N,), that a measurement is wrong, by the test that left rows out.
    """

    case: Case
    kept: np.ndarray
    noise: Noise
    warnings: list[str]
    declared: Fit
    search_sample: Observations
    wrong_probability: np.ndarray

    @property
    def search_tolerance(self) -> float:
        """Tolerance of a fit to the search sample, which is intermediate if a fit to
        all observations follows."""
        if self.search_sample is self.case.observations:
            return CONVERGENCE_TOLERANCE
        return INTERMEDIATE_TOLERANCE

    def fit_to_all(self, fitted: Fit) -> Fit:
        """Fit a model that was fitted to the search sample to all observations.

        An estimate from a sample is so close that one or two steps by all observations
        are as good as a converged fit: a one-step M-estimator [1]_.

        References
        ----------
        .. [1] Bickel, One-step Huber estimates in the linear model, JASA 70, 1975.
        """
        observations = self.case.observations
        tolerance = self.search_tolerance
        if self.search_sample is observations:
            if fitted is self.declared:
                return fitted
        elif len(observations) > LARGE_FIT_SIZE:
            tolerance = _LONG_FIT_TOLERANCE
        return fit_model(
            fitted.model,
            observations,
            fitted.noise,
            fitted.estimate,
            reweight_first_step=True,
            tolerance=tolerance,
        )


def fit_subset(
    case: Case,
    kept: np.ndarray,
    settings: Settings,
    previous: FittedSubset | None = None,
) -> FittedSubset:
    """Fit the declared model to some rows of a case.

    Parameters
    ----------
    case
        The whole case, of N measurements.
    kept
        (N,) of bool, rows to fit.
    settings
        Settings of the diagnosis.
    previous
        A subset that is returned if it has the same rows.
    """
    if previous is not None and (kept == previous.kept).all():
        return previous
    subset = case if kept.all() else case.select(kept)
    noise, warnings = estimate_noise(subset)
    sample = sample_for_search(case, subset, settings)
    declared = fit_declared_model(subset.model, sample, noise)
    left_out = (~kept).astype(float)
    return FittedSubset(subset, kept, noise, warnings, declared, sample, left_out)


def sample_for_search(case: Case, subset: Case, settings: Settings) -> Observations:
    """Choose the observations of a subset that a search uses.

    They are at the same poses whichever rows of the case the subset has, so that two
    fits to subsets differ by nothing but the gross errors.
    """
    size = settings.searched_observations
    return sample_observations(
        subset.observations, size, sample_observations(case.observations, size)
    )


def select_initial_subset(case: Case, settings: Settings) -> FittedSubset:
    """Leave out the rows that neither the declared model nor all candidates together
    explain, if they are more probably wrong than changed by an effect.

    Rows under extreme loads are bad leverage points [1]_: they would pull any fit
    towards themselves. They are left out at first and judged by fits to the other rows.

    References
    ----------
    .. [1] Rousseeuw and Leroy, Robust Regression and Outlier Detection, 1987.
    """
    measurements = case.campaign.measurements
    extreme = find_extreme_loads(measurements, settings)
    start = fit_subset(case, ~extreme, settings)
    subset = _leave_out_unpredicted(case, start, settings)
    limit = settings.gross_start_numbers // case.model.rows
    examined = select_spread_poses(case.observations, limit)
    if subset is start and not examined.all():
        # No row stands out against the declared model, and the campaign is too long to
        # test every observation against all candidates.
        return start
    left_out = _find_states(case, ~subset.kept)
    count = min(len(left_out), limit)
    examined[left_out[np.linspace(0, len(left_out) - 1, count).astype(int)]] = True
    examined[_find_states(case, extreme)] = False
    sample = select_states(case.observations, examined)
    gross = _find_unexplained_rows(case, subset, sample, settings)
    subset = fit_subset(case, ~gross, settings, start)
    # Rows under extreme loads are judged by a model that was found without them.
    weighed = weigh_gross_errors(
        subset.declared, subset.noise, case, gross & ~extreme, settings
    )
    left_out = weighed.gross | (gross & extreme)
    return replace(
        fit_subset(case, ~left_out, settings, subset),
        wrong_probability=np.where(extreme, left_out, weighed.probability),
    )


def _find_unexplained_rows(
    case: Case, subset: FittedSubset, sample: Observations, settings: Settings
) -> np.ndarray:
    """Find the rows, (N,) of bool, that all candidates together do not explain, in a
    sample, and that the declared model does not explain elsewhere."""
    measurements = case.campaign.measurements
    reference = evaluate_as_fit(
        subset.declared.model, sample, subset.noise, subset.declared.estimate
    )
    unexplained = find_unexplained_observations(
        build_candidate_design(
            reference, sample, list(case.candidates.values()), settings
        )
    )
    # A repeat far from the others is in no average. The declared model alone has judged
    # it.
    in_sample = match_states_and_targets(
        measurements, sample, np.ones(len(sample), bool)
    )
    inliers = remove_outlying_repeats(measurements)
    tested = in_sample & np.isin(measurements.row, inliers.row)
    return np.where(
        tested,
        match_states_and_targets(measurements, sample, unexplained),
        ~subset.kept,
    )


def _find_states(case: Case, rows: np.ndarray) -> np.ndarray:
    """States in which some rows, (N,) of bool, were measured, rising, (k,) of int."""
    observations = case.observations
    measured = match_states_and_targets(observations, case.campaign.measurements, rows)
    return np.unique(observations.state[measured])


def _leave_out_unpredicted(
    case: Case, subset: FittedSubset, settings: Settings
) -> FittedSubset:
    """Leave out the gross errors of the declared model's fit, and fit it again, until
    they stay the same."""
    measurements = case.campaign.measurements
    for _ in range(settings.gross_error_rounds):
        outcome = find_gross_errors(
            subset.declared, subset.noise, measurements, subset.kept, settings
        )
        previous = subset
        subset = fit_subset(case, ~outcome.gross, settings, previous)
        if subset is previous:
            break
    return subset
