"""The rows of a case that are fitted: all but those that stand out, at first beside everything that the model might lack."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.gross_errors import gross_errors, improbable
from elastocal.diagnosis.linearize import linearized
from elastocal.fitting.least_squares import evaluated, fit
from elastocal.fitting.noise_estimation import estimated_noise
from elastocal.fitting.observations import measured_in, sample_of, select_states, spread_poses, without_outlying_repeats
from elastocal.fitting.tolerances import fit_declared

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Measurements
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.case import Case
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations


@dataclass(frozen=True)
class Kept:
    """The part of a case that is fitted, ``kept`` of all its measurements (N,), with its noise and declared model.

    `searched`: observations that a search looks at, no more than so many; `declared` is the fit to these.
    """

    case: Case
    kept: np.ndarray
    noise: Noise
    warnings: list[str]
    declared: Fit
    searched: Observations

    def declared_to_all(self) -> Fit:
        """The declared model fitted to all that is kept."""
        if self.searched is self.case.observations:
            return self.declared
        found = self.declared
        return fit(found.model, self.case.observations, self.noise, found.estimate, reweighted=True)


def fitted_to(case: Case, kept: np.ndarray, settings: Settings, last: Kept | None = None) -> Kept:
    """The part of a case that is kept, or the last one where that is the same."""
    if last is not None and (kept == last.kept).all():
        return last
    part = case.select(kept)
    noise, warnings = estimated_noise(part)
    searched = sample_of(part.observations, settings.searched_observations)
    return Kept(part, kept, noise, warnings, fit_declared(part.model, searched, noise), searched)


def first_kept(case: Case, settings: Settings) -> Kept:
    """The part of a case that its declared model, or all candidates together, might explain.

    Rows under far larger loads than most are judged by the others alone: they would pull any fit to themselves (bad leverage
    points; Rousseeuw and Leroy, Robust Regression and Outlier Detection, 1987).
    """
    measurements, candidates = case.campaign.measurements, list(case.candidates.values())
    pulling = extreme_loads(measurements, settings)
    whole = part = fitted_to(case, ~pulling, settings)
    for _ in range(settings.gross_error_rounds):
        errors = gross_errors(part.declared, part.noise, measurements, part.kept, settings)
        last, part = part, fitted_to(case, ~errors.gross, settings, part)
        if part is last:
            break
    observations, most = case.observations, settings.gross_start_numbers // case.model.rows
    few = spread_poses(observations, most)
    if part is whole and not few.all():
        # Nothing stands apart, and there are too many to look more closely.
        return whole
    apart = np.unique(observations.state[measured_in(observations, measurements, ~part.kept)])
    few[apart[np.linspace(0, len(apart) - 1, min(len(apart), most)).astype(int)]] = True
    few[observations.state[measured_in(observations, measurements, pulling)]] = False
    some = select_states(observations, few)
    about = evaluated(part.declared.model, some, part.noise, part.declared.estimate)
    taken = improbable(linearized(about, some, candidates, settings))
    # A repeat far from its others is in no average, and stays what the declared model says of it.
    looked_at = measured_in(measurements, some, np.ones(len(some), bool))
    looked_at &= np.isin(measurements.row, without_outlying_repeats(measurements).row)
    return fitted_to(case, ~np.where(looked_at, measured_in(measurements, some, taken), ~part.kept), settings, whole)


def extreme_loads(measurements: Measurements, settings: Settings) -> np.ndarray:
    """Which rows are under a force far beyond that of most loaded ones, if these are few, ndarray of bool (N,)."""
    force = np.linalg.norm(measurements.wrench[:, :3], axis=1)
    if not force.any():
        return np.zeros(len(force), bool)
    far = force > settings.extreme_load * np.quantile(force[force > 0], 0.75)
    return far if far.mean() <= settings.gross_error_share else np.zeros(len(far), bool)
