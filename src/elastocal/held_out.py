"""Errors on poses that no step has seen: before and after, with intervals over poses."""

from dataclasses import dataclass

import numpy as np

from elastocal.model import circumstances, linearize, residuals
from elastocal.noise import reading_covariances

METRICS = ("mean_m", "rms_m", "p95_m", "max_m")
_INTERVAL = (2.5, 97.5)


@dataclass(frozen=True)
class Errors:
    """Position errors of observations.

    Attributes
    ----------
    distance : ndarray (M,)
        m.
    cluster : ndarray (M,)
        Pose of each, 0 .. P-1.
    """

    distance: np.ndarray
    cluster: np.ndarray

    @property
    def poses(self):
        """Number of poses."""
        return int(self.cluster.max()) + 1


def position_errors(model, estimate, observations):
    """Distances between measured and predicted positions.

    Parameters
    ----------
    model : Model
    estimate : Estimate
    observations : Observations

    Returns
    -------
    Errors
    """
    off = residuals(model, estimate, observations, circumstances(model, estimate, observations.states))
    return Errors(np.linalg.norm(off[:, :3], axis=1), observations.cluster)


def summary(distance):
    """Mean, RMS, 95th percentile and maximum.

    Parameters
    ----------
    distance : ndarray (..., M)

    Returns
    -------
    dict of str to ndarray (...)
    """
    return {
        "mean_m": distance.mean(axis=-1),
        "rms_m": np.sqrt((distance**2).mean(axis=-1)),
        "p95_m": np.quantile(distance, 0.95, axis=-1),
        "max_m": distance.max(axis=-1),
    }


def intervals(errors, replicates, stream, reference=0):
    """95 % intervals of the summary by a bootstrap over poses.

    Parameters
    ----------
    errors : sequence of Errors
        Of several models for the same observations; every replicate draws the same poses for all.
    replicates : int
    stream : numpy.random.Generator
    reference : int
        Which of `errors` the reductions count from.

    Returns
    -------
    intervals : list of dict of str to ndarray (2,)
        For each of `errors`.
    reductions : list of ndarray (2,)
        Of the share by which the RMS falls from the reference to each.
    """
    poses = errors[0].poses
    chosen = stream.integers(0, poses, (replicates, poses))
    times = np.array([np.bincount(row, minlength=poses) for row in chosen])[:, errors[0].cluster]
    drawn = [_repeated_summary(one.distance, times) for one in errors]
    found = [{name: np.percentile(values, _INTERVAL) for name, values in one.items()} for one in drawn]
    whole = drawn[reference]["rms_m"]
    return found, [np.percentile(1 - one["rms_m"] / whole, _INTERVAL) for one in drawn]


def _repeated_summary(distance, times):
    """The summary of each row of ``times`` (B, M), in which observations count so many times."""
    order = np.argsort(distance)
    rising, up_to = distance[order], np.cumsum(times[:, order], axis=1)
    count = up_to[:, -1]
    place = 0.95 * (count - 1)
    below = np.floor(place).astype(int)
    low, high = (rising[(up_to <= rank[:, None]).sum(axis=1)] for rank in (below, np.minimum(below + 1, count - 1)))
    return {
        "mean_m": times @ distance / count,
        "rms_m": np.sqrt(times @ distance**2 / count),
        "p95_m": low + (place - below) * (high - low),
        "max_m": rising[(up_to < count[:, None]).sum(axis=1)],
    }


def noise_floor(fitted, observations, model, estimate):
    """RMS position error that the noise alone leaves in observations.

    Parameters
    ----------
    fitted : Fit
        Holds the noise.
    observations : Observations
    model : Model
    estimate : Estimate

    Returns
    -------
    float
        m; not a number where the noise is not known.
    """
    if fitted.noise.source == "residual":
        return float("nan")
    line = linearize(model, estimate, observations, circumstances(model, estimate, observations.states))
    jacobian = line.coordinate_jacobian[:, None, :3, : model.sites.joints]
    variance = np.trace(reading_covariances(fitted.noise, jacobian, 3), axis1=1, axis2=2)
    return float(np.sqrt((variance / observations.states.repeats[observations.state]).mean()))


def grown(before, after):
    """Metrics of a summary that got worse.

    Parameters
    ----------
    before, after : dict of str to float

    Returns
    -------
    list of str
    """
    return [name for name in METRICS if after[name] > before[name]]
