"""From a fit of the declared model to the problem that is searched: columns of every unit, whitened, and their products."""

from dataclasses import dataclass

import numpy as np

from elastocal.diagnosis import other
from elastocal.diagnosis.hypotheses import prior_of, units_of
from elastocal.diagnosis.search import Problem
from elastocal.diagnosis.statistics import pose_error_unit, products_of, statistics_of
from elastocal.model import effect_columns, linearize, parameter_values
from elastocal.whitening import whitening

# Values of a shape that are tried: neighbours differ by less than readings show at the sizes that matter.
_SHAPES_TRIED = 3
# Declared parameters without a prior of their own get one this many times their plausible size: it decides nothing, and keeps
# well posed what the readings do not determine.
_WIDE = 10.0


@dataclass(frozen=True)
class Linearized:
    """The declared model about its fit, and everything that it might lack.

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


def linearized(fitted, observations, candidates, settings):
    """Gather what the readings say of a fit and of all candidates.

    Parameters
    ----------
    fitted : Fit
        Of the declared model.
    observations : Observations
    candidates : sequence of Candidate
    settings : Settings

    Returns
    -------
    Linearized
    """
    line = linearize(fitted.model, fitted.estimate, observations, fitted.circumstances)
    untestable = {c.key: reason for c in candidates if (reason := lacking(c, observations.states))}
    tested = [(c, shapes) for c in candidates if c.key not in untestable for shapes in shapes_tried(c)]
    around = fitted.circumstances
    places = other.locations(fitted.model.sites)
    waves = [other.displacements(around, place, settings.other_features) for place in places]
    made = effect_columns(
        [*tested, *((_Fixed(laws), ()) for laws in waves)], around, line.coordinate_jacobian, observations.state
    )
    units = units_of(tested, [(place, len(laws)) for place, laws in zip(places, waves, strict=True)], fitted.model.sites)
    made *= np.concatenate([unit.sizes for unit in units])
    root = np.sqrt(fitted.weights)
    whitener = whitening(observations, fitted.joint_jacobian, fitted.noise)

    def white(values):
        weighted = values * root.reshape(-1, *[1] * (values.ndim - 1))
        return whitener.apply(weighted).reshape(values.shape[0] * values.shape[1], *values.shape[2:])

    priors = fitted.parameters
    deviation = np.array([_WIDE * p.plausible if p.prior_std is None else p.prior_std for _, p in priors])
    present = np.where([p.prior_std is not None for _, p in priors], parameter_values(fitted.model, fitted.estimate), 0.0)
    products = products_of(
        white(line.sensitivities),
        white(made),
        white(line.residual),
        white(fitted.joint_jacobian),
        np.repeat(observations.cluster, fitted.model.rows),
        deviation,
        present,
        np.zeros(fitted.model.sites.joints),
    )
    grid = pose_error_unit(products) * np.array(settings.pose_steps)
    problem = Problem(statistics_of(products, grid), units, (), prior_of(units, settings), settings)
    return Linearized(problem, products, untestable)


@dataclass(frozen=True)
class _Fixed:
    """Displacements that are known already, in the shape of a candidate."""

    laws: list

    def displacement(self, _):
        return self.laws


def shapes_tried(candidate):
    """Values of the shape of a candidate over its range, list of tuple."""
    if not candidate.shapes:
        return [()]
    (shape,) = candidate.shapes
    return [(float(value),) for value in np.geomspace(shape.lowest, shape.highest, _SHAPES_TRIED + 2)[1:-1]]


def lacking(candidate, states):
    """Why the readings cannot test a candidate at all; empty where they might."""
    there = {
        "load": bool(states.wrench.any()),
        "approach": states.approach is not None and bool(states.approach.any()),
        "time": states.time_s is not None and np.ptp(states.time_s) > 0,
        "temperature": states.temperature_c is not None and np.ptp(states.temperature_c) > 0,
    }
    missing = sorted(need for need in candidate.needs if not there[need])
    if missing:
        return f"no {' and no '.join(missing)} in the data"
    for joint in candidate.joints if candidate.distinct_angles else ():
        angles = len(np.unique(np.round(np.mod(states.joint_angles[:, joint - 1], 2 * np.pi), 3)))
        if angles < candidate.distinct_angles:
            return f"{angles} angles of joint {joint} where {candidate.distinct_angles} are needed"
    return ""
