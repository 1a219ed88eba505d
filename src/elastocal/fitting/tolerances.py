"""Tolerances of what a campaign declares: every fit of its geometry has one prior, whose size the measurements say.

A robot is off its drawing by so many times what is plausible; one number for all declared geometry, by type II maximum
likelihood (Good, The Estimation of Probabilities, 1965), together with how many times the noise taken the measurements
scatter. Both come of the declared model alone, so that all models of a campaign, with effects and without, have the same
geometry beforehand.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.least_squares import ON_THE_WAY, STARTED_FROM, fit, registered
from elastocal.fitting.model import parameter_values
from elastocal.fitting.noise import FINEST, Noise, chosen_noise
from elastocal.fitting.observations import sample_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Model
    from elastocal.fitting.observations import Observations

# Sizes of declared geometry, in plausible sizes: measured robots exceed data-sheet tolerances tenfold, and none is ten times
# better than these.
SIZES = np.geomspace(0.1, 10.0, 9)
# Noise that is there over the noise taken, in steps that change no verdict.
_FACTORS = np.geomspace(1.0, 1e4, 185)
# Shares of a prior's variance that measurements leave below this are rounding.
_ROUNDING = 1e-14
# Noise that is taken before anything is known of it, m and rad.
_ASSUMED = 1e-4


def estimated_noise(case: Case) -> tuple[Noise, list[str]]:
    """Noise from repeats or as declared, from the residual of the declared model where there is neither; and warnings."""
    start = registered(case.model, case.observations)
    noise, warnings = chosen_noise(case.campaign, case.model, start)
    if noise is None:
        assumed = Noise("residual", _ASSUMED, _ASSUMED, np.zeros(case.campaign.robot.joints))
        # The widest prior leaves nearly what none would leave, without parameters that nothing determines.
        model = with_size(case.model, SIZES[-1])
        left = fit(model, case.observations, assumed, start).residual
        typical = [max(float(np.sqrt((part**2).mean())), FINEST) for part in (left[:, :3], left[:, -3:])]
        noise = replace(assumed, position_m=typical[0], orientation_rad=typical[1])
        # What parameters have taken of it is given back.
        noise = noise.scaled(most_probable(fit(model, case.observations, noise, start, settled=ON_THE_WAY))[1])
    return noise, warnings


def fit_declared(model: Model, observations: Observations, noise: Noise) -> Fit:
    """Fit a declared model, its geometry under priors of the most probable size; without geometry as `least_squares.fit`."""
    if not declared_geometry(model):
        return fit(model, observations, noise)
    wide = fit(with_size(model, SIZES[-1]), sample_of(observations, STARTED_FROM), noise, settled=ON_THE_WAY)
    return fit(with_size(model, most_probable(wide)[0]), observations, noise, wide.estimate, reweighted=True)


def declared_geometry(model: Model) -> set[str]:
    """Names of declared effects whose size is estimated: those whose parameters have no prior of their own, but for springs."""
    return {
        effect.effect
        for effect in model.effects
        if effect.family != "declared" and all(p.prior_std is None or p.sized for p in effect.parameters)
    }


def with_size(model: Model, size: float) -> Model:
    """A declared model with priors of a size, in plausible sizes, on its geometry."""
    sized = declared_geometry(model)
    effects = [
        with_prior(effect, [size * p.plausible for p in effect.parameters]) if effect.effect in sized else effect
        for effect in model.effects
    ]
    return replace(model, effects=tuple(effects))


def with_prior(candidate: Candidate, deviations: Sequence[float] | np.ndarray) -> Candidate:
    """A candidate with normal priors about zero whose standard deviations were estimated."""
    pairs = zip(candidate.parameters, deviations, strict=True)
    return replace(candidate, parameters=tuple(replace(p, prior_std=float(std), sized=True) for p, std in pairs))


def most_probable(wide: Fit) -> tuple[float, float]:
    """Size of declared geometry, in plausible sizes, and noise over the noise taken that make the measurements most probable.

    In closed form from a fit under the widest prior: given frames and targets the geometry is linear, and the principal axes of
    its covariance in units of the prior are independent. The noise is no less than the noise taken.
    """
    mine = np.flatnonzero(np.array([parameter.sized for _, parameter in wide.parameters], bool) & ~wide.held)
    prior = wide.prior_std[mine]
    left, axes = np.linalg.eigh(wide.covariance[np.ix_(mine, mine)] / np.outer(prior, prior))
    left = np.clip(left, _ROUNDING, 1.0)
    shift, seen = axes.T @ (parameter_values(wide.model, wide.estimate)[mine] / prior), 1.0 / left - 1.0
    # Squares of the whitened residual were all of it zero, beside frames and targets.
    squares = (wide.whitened(wide.residual) ** 2).sum() + ((seen + 2.0) * shift**2).sum()
    freedom = max(wide.weights.sum() * wide.residual.shape[1] - (~wide.held).sum() + len(mine), 1.0)
    variance = _FACTORS[:, None, None] ** 2
    wider = ((SIZES / SIZES[-1]) ** 2)[:, None]
    explained = ((shift / left) ** 2 * wider / (variance + seen * wider)).sum(axis=2)
    volume = np.log1p(wider * seen / variance).sum(axis=2)
    variance = variance[..., 0]
    evidence = -0.5 * (freedom * np.log(variance) + (squares - explained) / variance + volume)
    factor, size = np.unravel_index(np.argmax(evidence), evidence.shape)
    return float(SIZES[size]), float(_FACTORS[factor])


def effective_parameters(fitted: Fit) -> float:
    """Free parameters, with a prior the share that it leaves open: trace of a ridge's hat matrix (Hastie et al., 3.4.1)."""
    free = ~fitted.held
    return float(free.sum() - (np.diag(fitted.covariance)[free] / fitted.prior_std[free] ** 2).sum())
