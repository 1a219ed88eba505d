"""The part of a case that is fitted: all rows but the gross errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.gross_errors import find_gross_errors
from elastocal.diagnosis.initial_outliers import find_unexplained_observations
from elastocal.fitting.least_squares import (
    INTERMEDIATE_TOLERANCE,
    LARGE_FIT_SIZE,
    evaluate_as_fit,
    fit_model,
)
from elastocal.fitting.noise import Noise, estimate_noise, fit_declared_model
from elastocal.fitting.observations import (
    Observations,
    match_states_and_targets,
    remove_outlying_repeats,
    sample_observations,
    select_spread_poses,
    select_states,
)

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Measurements
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case

# Standard errors of the last step by all measurements of a long campaign: what it
# leaves is a tenth of it, or less.
_LAST_STEP = 1.0


@dataclass(frozen=True)
class FittedSubset:
    """The part of a case that is fitted, ``kept`` of all its measurements (N,), with
    its noise, and its declared model fitted to what is `searched`: observations that a
    search looks at, no more than so many."""

    case: Case
    kept: np.ndarray
    noise: Noise
    warnings: list[str]
    declared: Fit
    search_sample: Observations

    def fit_to_all(self, found: Fit) -> Fit:
        """A model that is fitted to what is searched, fitted to all that is kept.

        From an estimate that some measurements lead to, a step or two by all of them
        are as good as the fit's end (one-step M-estimators; Bickel, One-step Huber
        estimates in the linear model, JASA 1975).
        """
        every = self.case.observations
        if self.search_sample is not every:
            settled = (
                INTERMEDIATE_TOLERANCE if len(every) <= LARGE_FIT_SIZE else _LAST_STEP
            )
            return fit_model(
                found.model,
                every,
                found.noise,
                found.estimate,
                reweight_first_step=True,
                tolerance=settled,
            )
        return (
            found
            if found is self.declared
            else fit_model(
                found.model,
                every,
                found.noise,
                found.estimate,
                reweight_first_step=True,
            )
        )


def fit_subset(
    case: Case, kept: np.ndarray, settings: Settings, last: FittedSubset | None = None
) -> FittedSubset:
    """The part of a case that is kept, or the last one where that is the same."""
    if last is not None and (kept == last.kept).all():
        return last
    part = case if kept.all() else case.select(kept)
    noise, warnings = estimate_noise(part)
    searched = sample_for_search(case, part, settings)
    return FittedSubset(
        part,
        kept,
        noise,
        warnings,
        fit_declared_model(part.model, searched, noise),
        searched,
    )


def sample_for_search(case: Case, part: Case, settings: Settings) -> Observations:
    """What a search looks at of a part of a case: at the same poses whatever is kept,
    so that only gross errors move a fit."""
    most = settings.searched_observations
    return sample_observations(
        part.observations, most, sample_observations(case.observations, most)
    )


def select_initial_subset(case: Case, settings: Settings) -> FittedSubset:
    """The part of a case that its declared model, or all candidates together, might
    explain.

    Rows under far larger loads than most are judged by the others alone: they would
    pull any fit to themselves (bad leverage points; Rousseeuw and Leroy, Robust
    Regression and Outlier Detection, 1987).
    """
    measurements = case.campaign.measurements
    candidates = list(case.candidates.values())
    pulling = find_extreme_loads(measurements, settings)
    whole = part = fit_subset(case, ~pulling, settings)
    for _ in range(settings.gross_error_rounds):
        errors = find_gross_errors(
            part.declared, part.noise, measurements, part.kept, settings
        )
        last = part
        part = fit_subset(case, ~errors.gross, settings, part)
        if part is last:
            break
    observations = case.observations
    most = settings.gross_start_numbers // case.model.rows
    few = select_spread_poses(observations, most)
    if part is whole and not few.all():
        # Nothing stands apart, and there are too many to look more closely.
        return whole
    apart = np.unique(
        observations.state[
            match_states_and_targets(observations, measurements, ~part.kept)
        ]
    )
    few[apart[np.linspace(0, len(apart) - 1, min(len(apart), most)).astype(int)]] = True
    few[
        observations.state[
            match_states_and_targets(observations, measurements, pulling)
        ]
    ] = False
    some = select_states(observations, few)
    about = evaluate_as_fit(
        part.declared.model, some, part.noise, part.declared.estimate
    )
    taken = find_unexplained_observations(
        build_candidate_design(about, some, candidates, settings)
    )
    # A repeat far from its others is in no average, and stays what the declared model
    # says of it.
    looked_at = match_states_and_targets(measurements, some, np.ones(len(some), bool))
    looked_at &= np.isin(measurements.row, remove_outlying_repeats(measurements).row)
    return fit_subset(
        case,
        ~np.where(
            looked_at, match_states_and_targets(measurements, some, taken), ~part.kept
        ),
        settings,
        whole,
    )


def find_extreme_loads(measurements: Measurements, settings: Settings) -> np.ndarray:
    """Which rows are under a force far beyond that of most loaded ones, if these are
    few, ndarray of bool (N,)."""
    force = np.linalg.norm(measurements.wrench[:, :3], axis=1)
    usual = np.quantile(force[force > 0], 0.75) if force.any() else np.inf
    far = force > settings.extreme_load * usual
    return far & (far.mean() <= settings.gross_error_share)
