"""Decide which model predicts new poses, from its evidence and from left-out training
poses, without the held-out poses.

Evidence predicts how much a model lowers squared errors, but only if its laws and its
noise are true. Left-out poses measure the gain without such assumptions, but few of them
measure it poorly. A Bayesian decision weighs the two: the prediction is the prior of the
gain, what left-out poses gain is its likelihood, and the model is adopted if the
posterior mean of the gain is positive, because squared error is the loss. Few poses thus
leave the decision to strong evidence, and many poses decide by themselves.

The prior is robust [1]_: with the probability that the prediction is of no use it is
normal about zero, and as wide as a single group is uncertain (unit information [5]_). If
left-out poses contradict the prediction, the weight moves to this component, and they
alone decide.

Poses that are left out one at a time have neighbours among the fitted ones, and
whatever neighbours have in common passes for prediction. Of many poses, groups of
neighbours are therefore left out together [2]_; but groups that are far larger than the
distance of new poses from the fitted ones measure extrapolation [6]_. This choice is
made inside the training poses, and the held-out poses judge its result (nested
validation [3]_). The model without effects is the one that would be kept, under the
noise that it leaves. No estimate of the variance of cross-validated errors is unbiased
[4]_. Groups have less in common than poses, so that their spread is used, with
Student's t as the density of their mean.

References
----------
.. [1] Schmidli et al., Robust meta-analytic-predictive priors in clinical trials with
   historical control information, Biometrics 70, 2014.
.. [2] Roberts et al., Cross-validation strategies for data with temporal, spatial,
   hierarchical, or phylogenetic structure, Ecography 40, 2017.
.. [3] Varma and Simon, Bias in error estimation when using cross-validation for model
   selection, BMC Bioinformatics 7, 2006.
.. [4] Bengio and Grandvalet, No unbiased estimator of the variance of K-fold
   cross-validation, Journal of Machine Learning Research 5, 2004.
.. [5] Kass and Wasserman, A reference Bayesian test for nested hypotheses and its
   relationship to the Schwarz criterion, JASA 90, 1995.
.. [6] Mila, Mateu, Pebesma and Meyer, Nearest neighbour distance matching leave-one-out
   cross-validation for map validation, Methods in Ecology and Evolution 13, 2022.
.. [7] Breiman, Friedman, Olshen and Stone, Classification and Regression Trees, 3.4.3,
   1984.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.holdout import number_configurations, partition_poses
from elastocal.diagnosis.tempering import compute_power
from elastocal.fitting.noise import count_effective_parameters
from elastocal.fitting.observations import index_poses
from elastocal.validation.held_out import predict_left_out_residuals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.model_averaging import PredictedGain
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.observations import Observations

# Deviations from the mean of a prior, in its standard deviations, and their densities:
# finer or wider ones change no posterior mean by a thousandth.
_DEVIATIONS = np.linspace(-6.0, 6.0, 1201)
_DENSITIES = np.exp(-0.5 * _DEVIATIONS**2)
TOO_UNCERTAIN = (
    "the effects found are too uncertain to improve predictions:"
    " the model stays as declared"
)


def choose_kept_fit(
    fits: Sequence[Fit], observations: Observations, settings: Settings
) -> Fit:
    """Choose the fit of the model that is kept if no effect is adopted.

    A model that lacks something has no true noise: which weights suit its misfit is an
    empirical question. Of the fits whose left-out poses are predicted as well as by the
    best one, to one standard error, the one with the fewest effective parameters is
    chosen (the one-standard-error rule [7]_).

    Parameters
    ----------
    fits : sequence of Fit
        Of one model, under different noise.
    observations : Observations
        What all were fitted to.
    settings : Settings
        Number of groups of poses.
    """
    group = _group_neighbours(observations, settings.adoption_groups)
    squares = []
    for fitted in fits:
        left_out = predict_left_out_residuals(fitted, observations, group)
        squares.append(_average_squares(_select_positions(left_out), group))
    best = min(squares, key=np.mean)
    as_good = [
        fitted
        for fitted, of_fit in zip(fits, squares, strict=True)
        if _count_std_errors(of_fit, best) <= 1.0
    ]
    return min(as_good, key=count_effective_parameters)


def describe_missing_gain(
    models: tuple[Fit, Fit],
    observations: Observations,
    predicted: PredictedGain,
    settings: Settings,
) -> list[str]:
    """Describe why effects are not adopted that are not expected to help at new poses.

    They help if both the squared errors of the measurements, in units of the noise, and
    those of the positions are expected to fall.

    Parameters
    ----------
    models : Fit, Fit
        The model that is kept without the effects, and the one with them.
    observations : Observations
        What both were fitted to.
    predicted : PredictedGain
        Gain by the evidence.
    settings : Settings
        Number of groups, and how far the prediction is trusted.

    Returns
    -------
    list of str
        One sentence, or none if the effects help.
    """
    kept, full_model = models
    group = _group_neighbours(observations, settings.adoption_groups)
    left_out = [
        predict_left_out_residuals(fitted, observations, group) for fitted in models
    ]
    added = kept.residual - full_model.residual
    power = compute_power(
        predicted.squares, settings.law_tolerance, settings.confusable_share
    )
    # Evidence of laws that are only nearly true counts less, as between hypotheses.
    predicted = predicted._replace(std_error=predicted.std_error / np.sqrt(power))
    expected = []
    for measure in (full_model.whiten, _select_positions):
        before, after = (
            _average_squares(measure(values), group) for values in left_out
        )
        size = float(_average_squares(measure(added), group).mean())
        expected.append(_expect_gain(before - after, size, predicted, settings))
    if min(expected) > 0.0:
        return []
    before_mm, after_mm = (
        1e3 * np.sqrt(_average_squares(values[:, :3], group).mean())
        for values in left_out
    )
    return [
        "the effects found are not expected to improve predictions of new poses: if"
        f" {group.max() + 1} groups of neighbouring training poses are left out in turn,"
        f" their RMS position error is {after_mm:.3g} mm with the effects and"
        f" {before_mm:.3g} mm without, and the evidence does not outweigh this: the model"
        " stays as declared"
    ]


def _select_positions(residual: np.ndarray) -> np.ndarray:
    """Position part (M, 3) of a residual (M, rows), m."""
    return residual[:, :3]


def _expect_gain(
    gains: np.ndarray, size: float, predicted: PredictedGain, settings: Settings
) -> float:
    """Posterior mean of the gain at new poses.

    Parameters
    ----------
    gains : (G,) array
        What mean squared errors of the left-out groups fall by.
    size : float
        Mean square of the displacements that the effects add.
    predicted : PredictedGain
        The predicted gain, in units of `size`; its share is positive.
    settings : Settings
        Probability that the prediction is of no use.
    """
    if size <= 0.0 or gains.std() <= 0.0:
        return float(gains.mean())
    useless = settings.useless_prediction
    unit_std = float(gains.std(ddof=1))
    components = (
        (1.0 - useless, predicted.share * size, predicted.std_error * size),
        (useless, 0.0, unit_std),
    )
    gain = np.array([mean + std * _DEVIATIONS for _, mean, std in components])
    weights = np.array([probability * _DENSITIES for probability, _, _ in components])
    ratio = (gains.mean() - gain) / (unit_std / np.sqrt(len(gains)))
    # Density of Student's t for the mean of the groups.
    log_likelihood = -0.5 * len(gains) * np.log1p(ratio**2 / (len(gains) - 1))
    weights *= np.exp(log_likelihood - log_likelihood.max())
    return float((weights * gain).sum() / weights.sum())


def _count_std_errors(before: np.ndarray, after: np.ndarray) -> float:
    """Mean of what the squares of groups (G,) fall by, in its standard errors; no
    difference at all is no gain."""
    gain = before - after
    std_error = gain.std(ddof=1) / np.sqrt(len(gain))
    return float(gain.mean() / std_error) if std_error > 0.0 else 0.0


def _average_squares(residual: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Mean square length of the residuals (M, rows) of each group, (G,) array."""
    squares = (residual**2).sum(axis=1)
    return np.bincount(group, squares) / np.bincount(group)


def _group_neighbours(observations: Observations, count: int) -> np.ndarray:
    """Group of neighbouring poses of each observation, (M,) int array, of at most so
    many groups."""
    states = observations.states
    pose = index_poses(states)
    configurations = int(number_configurations(states.joint_angles, pose).max()) + 1
    group = partition_poses(states.joint_angles, pose, min(count, configurations))
    return group[observations.cluster]


def describe_losses(
    frames: Fit, models: Sequence[Fit], observations: Observations, settings: Settings
) -> list[str]:
    """Describe how models with few measurements for their parameters predict left-out
    training poses worse than frames alone, by more than a standard error.

    Parameters
    ----------
    frames : Fit
        Fit of frames and targets alone.
    models : sequence of Fit
        The declared model and, if it has any, the one with the effects found.
    observations : Observations
        What all were fitted to.
    settings : Settings
        Numbers measured for each parameter that suffice.

    Returns
    -------
    list of str
        A sentence for each model, empty for one that does not predict worse; no
        sentences at all if the last model does not.
    """
    names = ("declared model", "model with the effects found")
    states = observations.states
    pose = index_poses(states)
    configuration = number_configurations(states.joint_angles, pose)
    group = configuration[observations.cluster]
    sentences = []
    for fitted, name in zip(models, names, strict=False):
        sentences.append("")
        effective = count_effective_parameters(fitted)
        if fitted.residual.size >= settings.numbers_a_parameter * effective:
            continue
        squares, frames_squares = (
            _average_squares(
                predict_left_out_residuals(model, observations, group)[:, :3], group
            )
            for model in (fitted, frames)
        )
        if _count_std_errors(squares, frames_squares) > 1.0:
            rms_mm = 1e3 * np.sqrt(squares.mean())
            frames_rms_mm = 1e3 * np.sqrt(frames_squares.mean())
            sentences[-1] = (
                f"training poses left out in turn have an RMS error of {rms_mm:.2f} mm by the"
                f" {name} and of {frames_rms_mm:.2f} mm with frames and targets alone:"
                f" {len(squares)} poses are too few for {effective:.0f} parameters, and"
                f" the {name} is not kept"
            )
    return sentences if sentences[-1] else []
