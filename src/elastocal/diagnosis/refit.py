"""The exact fit of a selected model: same priors, exact kinematics, and parameters averaged over models.

Coefficients keep the normal priors under which they were selected; the noise is that which the selected model leaves. The
averages differ from the exact fit of the best model by what other models add in the linearised problem, and intervals hold
their spread as well, so that they are honest after selection.

References
----------
.. [1] Hoeting, J. A. et al. (1999). Bayesian model averaging: a tutorial. Statistical Science 14, 382-417.
"""

from dataclasses import replace

import numpy as np

from elastocal.fitting import fit


def selected_candidates(problem, model):
    """Candidates of a model with the priors of its units, and their shape values.

    Parameters
    ----------
    problem : Problem
    model : search.Model

    Returns
    -------
    list of (Candidate, ndarray)
        Without the competitor, which predicts nothing.
    """
    scales = model.scales[len(problem.base) :]
    chosen = []
    for number, scale in zip(model.units, scales, strict=True):
        unit = problem.units[number]
        if unit.candidate is None:
            continue
        parameters = tuple(
            replace(parameter, prior_std=float(scale * size))
            for parameter, size in zip(unit.candidate.parameters, unit.sizes, strict=True)
        )
        chosen.append((replace(unit.candidate, parameters=parameters), np.array(unit.shapes, float)))
    return chosen


def refitted(declared, observations, noise, chosen):
    """Fit the declared model with more candidates.

    Parameters
    ----------
    declared : Fit
        Where the search starts.
    observations : Observations
    noise : Noise
        Of readings and poses, as the selected model leaves it.
    chosen : list of (Candidate, ndarray)
        As of `selected_candidates`.

    Returns
    -------
    Fit
    """
    effects = [candidate for candidate, _ in chosen]
    start = declared.estimate.with_effects(effects)
    start = replace(start, shapes=(*declared.estimate.shapes, *(shapes for _, shapes in chosen)))
    return fit(declared.model.with_effects(effects), observations, noise, start, 0.0)


def remaining_noise(problem, model, noise):
    """Noise of the readings as a model leaves it: at least the noise that repeats or the campaign say.

    Parameters
    ----------
    problem : Problem
    model : search.Model
    noise : Noise

    Returns
    -------
    Noise
    """
    statistics = problem.statistics
    place = int(np.argmin(np.abs(statistics.pose_error_rad - model.pose_error_rad)))
    members = (*problem.base, *model.units)
    columns = np.concatenate([np.zeros(0, int), *(problem.units[n].columns for n in members)])
    deviations = np.repeat(model.scales, [len(problem.units[n].columns) for n in members])
    along = deviations * statistics.along[place, columns]
    inner = deviations[:, None] * statistics.gram[place][np.ix_(columns, columns)] * deviations + np.eye(len(columns))
    left = statistics.squares[place] - along @ np.linalg.solve(inner, along)
    factor = float(np.sqrt(max(left / statistics.freedom, 1.0)))
    return replace(noise.scaled(factor), pose_rad=factor * model.pose_error_rad)
