"""From a fit of the declared model to the problem that is searched: columns of every unit, whitened, and their products."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from elastocal.diagnosis import other
from elastocal.diagnosis.hypotheses import prior_of, units_of
from elastocal.diagnosis.search import Problem
from elastocal.diagnosis.statistics import pose_error_unit, products_of, statistics_of
from elastocal.effects.protocol import offered
from elastocal.model import bends as shape_parameters
from elastocal.model import effect_columns, linearize, parameter_values
from elastocal.whitening import whitening

# Values of a shape that are tried: neighbours differ by less than readings show at the sizes that matter.
_SHAPES_TRIED = 3
# Declared parameters without a prior of their own get one this many times their plausible size: it decides nothing, and keeps
# well posed what the readings do not determine.
_WIDE = 10.0


@dataclass(frozen=True)
class Linearized:
    """A model about a fit, and everything that it might lack.

    Attributes
    ----------
    problem : Problem
    products : Products
        Of one pass over the readings.
    untestable : dict of str to str
        Why a candidate is not tested.
    """

    problem: object
    products: object
    untestable: dict


def linearized(fitted, observations, candidates, declared, settings):
    """Gather what the readings say of a fit and of all candidates.

    Coefficients count from zero, not from the fit: what candidates and declared geometry contribute to the prediction is
    given back to the residual, so that their priors mean what they say.

    Parameters
    ----------
    fitted : Fit
        Of the declared model, or with effects found already, about which the problem is then linear.
    observations : Observations
    candidates : sequence of Candidate
    declared : sequence of Candidate
        Declared effects of the fitted model whose sizes are averaged over, as of declared geometry.
    settings : Settings

    Returns
    -------
    Linearized
    """
    line = linearize(fitted.model, fitted.estimate, observations, fitted.circumstances)
    around, sites = line.circumstances, fitted.model.sites
    untestable = {c.key: reason for c in candidates if (reason := lacking(c, sites, observations.states))}
    tested = [(c, shapes) for c in candidates if c.key not in untestable for shapes in shapes_tried(c, fitted)]
    places = other.locations(sites)
    waves = [other.displacements(around, place, settings.other_features) for place in places]
    laws = [*tested, *((_Fixed(made), ()) for made in waves), *((c, ()) for c in declared)]
    made = effect_columns(laws, around, line.coordinate_jacobian, observations.state)
    units, base = units_of(tested, [(place, len(laws)) for place, laws in zip(places, waves, strict=True)], declared, settings)
    for unit in units:
        made[..., unit.columns] *= unit.sizes
    owners = np.array([owner for owner, _ in fitted.parameters])
    averaged = np.isin(owners, [c.key for c in (*candidates, *declared)])
    values = np.where(shape_parameters(fitted.model, fitted.estimate), 0.0, parameter_values(fitted.model, fitted.estimate))
    residual = line.residual + line.sensitivities[..., averaged] @ values[averaged]
    root = np.sqrt(fitted.weights)
    whitener = whitening(observations, fitted.joint_jacobian, fitted.noise.of_readings)

    def white(values):
        weighted = values * root.reshape(-1, *[1] * (values.ndim - 1))
        return whitener.apply(weighted).reshape(values.shape[0] * values.shape[1], *values.shape[2:])

    priors = [parameter for (_, parameter), left in zip(fitted.parameters, averaged, strict=True) if not left]
    own = np.array([parameter.prior_std is not None for parameter in priors], bool)
    deviation = np.array([_WIDE * p.plausible if p.prior_std is None else p.prior_std for p in priors])
    products = products_of(
        white(line.sensitivities[..., ~averaged]),
        white(made),
        white(residual),
        white(fitted.joint_jacobian),
        np.repeat(observations.cluster, fitted.model.rows),
        deviation,
        np.where(own, values[~averaged], 0.0),
        np.zeros(sites.joints),
    )
    grid = pose_error_unit(products) * np.array(settings.pose_steps)
    statistics = statistics_of(products, grid)
    kept = testable(statistics, units, settings)
    for unit, good in zip(units, kept, strict=True):
        if not good and unit.candidate:
            untestable.setdefault(unit.candidate.key, "too small to be seen at its plausible size")
    untestable = {
        key: why for key, why in untestable.items() if key not in {u.key for u, k in zip(units, kept, strict=True) if k}
    }
    # Columns of units that are left out stay in the statistics, where nothing refers to them.
    shown = tuple(unit for unit, good in zip(units, kept, strict=True) if good)
    everything = (*shown, *base)
    free = tuple(range(len(shown), len(everything)))
    return Linearized(Problem(statistics, everything, free, prior_of(shown, settings), settings), products, untestable)


def testable(statistics, units, settings):
    """Which units at their plausible size would be found with a power of at least one half, were each the only candidate.

    A test for one direction among all units reaches that where the non-centrality is the critical value.

    Parameters
    ----------
    statistics : Statistics
    units : sequence of Unit
    settings : Settings

    Returns
    -------
    ndarray of bool
        True throughout for the competitor.
    """
    critical = chi2.isf(settings.alarm_level / max(len(units), 1), 1)
    largest = []
    for unit in units:
        gram = statistics.gram[0][np.ix_(unit.columns, unit.columns)]
        largest.append(np.inf if unit.candidate is None else np.linalg.eigvalsh(gram)[-1])
    return np.array(largest) >= critical


@dataclass(frozen=True)
class _Fixed:
    """Displacements that are known already, in the shape of a candidate."""

    laws: list

    def displacement(self, _):
        return self.laws


def shapes_tried(candidate, fitted):
    """Values of the shape of a candidate over its range, and that of the fit where it has the candidate; list of tuple."""
    if not candidate.shapes:
        return [()]
    if candidate.key in {effect.key for effect in fitted.model.effects}:
        return [tuple(fitted.values_of(candidate.key)[1].tolist())]
    (shape,) = candidate.shapes
    return [(float(value),) for value in shape.values(_SHAPES_TRIED)]


def lacking(candidate, sites, states):
    """Why the readings cannot test a candidate at all; empty where they might."""
    missing = sorted(candidate.needs - offered(sites, states))
    if missing:
        return f"no {' and no '.join(missing)} in the data"
    for joint in candidate.joints if candidate.distinct_angles else ():
        angles = len(np.unique(np.round(np.mod(states.joint_angles[:, joint - 1], 2 * np.pi), 3)))
        if angles < candidate.distinct_angles:
            return f"{angles} angles of joint {joint} where {candidate.distinct_angles} are needed"
    return ""
