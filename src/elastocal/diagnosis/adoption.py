"""Decide by left-out training poses which model predicts new ones: cross-validation
without the held-out poses.

Poses that are left out one at a time have neighbours among the fitted ones, and
whatever neighbours have in common passes for prediction. Groups of neighbouring poses
are therefore left out together [1]_. This choice is made inside the training poses, and
the held-out poses judge its result (nested validation [2]_). Two models are compared
group by group, and a gain within a standard error is none (the one-standard-error rule
[3]_). No estimate of the variance of cross-validated errors is unbiased [4]_. Groups
have less in common than poses, so that their spread is used.

References
----------
.. [1] Roberts et al., Cross-validation strategies for data with temporal, spatial,
   hierarchical, or phylogenetic structure, Ecography 40, 2017.
.. [2] Varma and Simon, Bias in error estimation when using cross-validation for model
   selection, BMC Bioinformatics 7, 2006.
.. [3] Breiman, Friedman, Olshen and Stone, Classification and Regression Trees, 1984,
   section 3.4.3.
.. [4] Bengio and Grandvalet, No unbiased estimator of the variance of K-fold
   cross-validation, Journal of Machine Learning Research 5, 2004.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.holdout import number_configurations, partition_poses
from elastocal.fitting.noise import count_effective_parameters
from elastocal.fitting.observations import index_poses
from elastocal.validation.held_out import predict_left_out_residuals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.observations import Observations

TOO_UNCERTAIN = (
    "what was found is too uncertain to make predictions better:"
    " the model stays as declared"
)


def describe_missing_gain(
    declared: Fit, full_model: Fit, observations: Observations, settings: Settings
) -> list[str]:
    """Describe why effects are not adopted that do not help at groups of left-out poses.

    They help if they predict the measurements better by more than a standard error, in
    units of the noise, and the positions not worse by more than that.

    Parameters
    ----------
    declared, full_model : Fit
        The declared model without and with the effects found.
    observations : Observations
        What both were fitted to.
    settings : Settings
        Number of groups.

    Returns
    -------
    list of str
        One sentence, or none if the effects help.
    """
    group = _group_neighbours(observations, settings.adoption_groups)
    residuals = [
        predict_left_out_residuals(fitted, observations, group)
        for fitted in (declared, full_model)
    ]
    squares = [_average_squares(residual[:, :3], group) for residual in residuals]
    white_squares = [
        _average_squares(full_model.whiten(residual), group) for residual in residuals
    ]
    is_better = _count_std_errors(*white_squares) > 1.0
    is_worse = _count_std_errors(*squares) < -1.0
    if is_better and not is_worse:
        return []
    result = "does not predict measurements better, beyond a standard error,"
    if is_worse:
        before_mm, after_mm = (1e3 * np.sqrt(values.mean()) for values in squares)
        result = (
            f"predicts positions worse ({after_mm:.3g} mm RMS with it, {before_mm:.3g} mm"
            " without)"
        )
    return [
        f"what was found {result} if {group.max() + 1} groups of neighbouring training"
        " poses are left out in turn: the model stays as declared"
    ]


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
                f"training poses left out in turn are off by {rms_mm:.2f} mm RMS by the"
                f" {name}, by {frames_rms_mm:.2f} mm with frames and targets alone:"
                f" {len(squares)} poses are too few for {effective:.0f} parameters, and"
                f" the {name} is not kept"
            )
    return sentences if sentences[-1] else []
