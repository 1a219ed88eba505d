"""Robust generalized least squares on the composite model, by Gauss-Newton steps on exact predictions."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.campaign import NOT_TURNED
from elastocal.fitting.displacement import kept_conditions
from elastocal.fitting.observations import sample_of
from elastocal.fitting.parameters import parameters
from elastocal.fitting.registration import registered
from elastocal.fitting.robust import SETTLED, robustly

if TYPE_CHECKING:
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

# Largest step that remains in a fit from which others start, in standard errors.
ON_THE_WAY = 0.1
# A fit to more observations that does not come of a fit starts from the fit to so many of them: they show the size of some
# fifty parameters as well as any number.
STARTED_FROM = 2_000


def fit(
    model: Model,
    observations: Observations,
    noise: Noise,
    start: Estimate | None = None,
    reweighted: bool = False,
    settled: float = SETTLED,
) -> Fit:
    """Fit a model by robust generalized least squares [1] and Gauss-Newton steps [2], see `robust.robustly`.

    `start`: of this model; by `registered` without. `reweighted`: whether the start comes of a fit: outliers lose weight from
    the first step on. `settled`: largest step that remains, in standard errors.

    [1] Aitken, A. C., On least squares and linear combination of observations, Proceedings of the Royal Society of Edinburgh
        55, 1935.
    [2] Björck, Å., Numerical Methods for Least Squares Problems, SIAM, 1996.
    """
    few = observations if reweighted else sample_of(observations, STARTED_FROM)
    if len(few) < len(observations):
        # Where all the measurements lead is close to where some of them do.
        start, reweighted = fit(model, few, noise, start, settled=ON_THE_WAY).estimate, True
    start = registered(model, observations) if start is None else start
    around = kept_conditions(model, start, observations)
    return robustly(model, observations, around, noise, start, reweighted=reweighted, settled=settled)


def evaluated(model: Model, observations: Observations, noise: Noise, estimate: Estimate) -> Fit:
    """An estimate as a fit to observations that it need not come of; they have weight one, whatever their distance."""
    around = kept_conditions(model, estimate, observations)
    return replace(robustly(model, observations, around, noise, estimate, frozen=True), weights=np.ones(len(observations)))


def fit_frames(fitted: Fit, model: Model, observations: Observations, own_targets: bool = True) -> Estimate:
    """Fit frames and targets of other observations; everything else stays as it was found.

    `model`: the same effects with the targets of these observations. `own_targets`: whether these observations have targets of
    their own; where not, those of the fit stay as they were found.
    """
    found = fitted.estimate
    if not own_targets:
        known = [
            replace(target, offset_m=tuple(at), rotation=NOT_TURNED)
            for target, at in zip(model.targets, found.target_offset, strict=True)
        ]
        model = replace(model, targets=tuple(known))
    start = registered(model, observations)
    start = replace(start, coefficients=found.coefficients, shapes=found.shapes)
    if not own_targets:
        # To the last bit, which a rotation vector does not keep.
        start = replace(start, target_rotation=found.target_rotation)
    frozen = np.array([not owner.startswith(("frame ", "target ")) for owner, _ in parameters(model, start)], bool)
    around = kept_conditions(model, start, observations)
    return robustly(model, observations, around, fitted.noise, start, frozen).estimate
