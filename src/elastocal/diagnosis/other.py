"""A competitor for effects that the catalogue does not have: smooth random displacements of each joint and of the base.

A displacement is a random function of angles, load, approach and time, a sum of random Fourier features [1]_ with normal
coefficients: an approximate Gaussian process. Half of the features are multiplied by the load, so that they vanish without it.
Alone it means that the residual is *unexplained*; beside a mechanism, that a *related* one acts. It names nothing and is not
used to predict.

References
----------
.. [1] Rahimi, A. and Recht, B. (2007). Random features for large-scale kernel machines. NIPS 20.
"""

import numpy as np

from elastocal.diagnosis.hypotheses import OTHER
from elastocal.random_streams import stream

# Deviations that no machine would hide: joints about an arc minute, the base a tenth of a millimetre and of a milliradian.
JOINT_RAD, BASE_M, BASE_RAD = 2e-4, 1e-4, 1e-4
# Length scales of the features in units of the inputs, which are of size one: from smooth to as many waves as poses can show.
_LENGTH_SCALES = (0.7, 3.0)
_BASE_FEATURES = 8
_SEED = 2007


def locations(sites):
    """Where the competitor acts: each joint, and the base.

    Returns
    -------
    list of tuple of int
        Joint counted from 1; empty for the base.
    """
    return [*((joint + 1,) for joint in range(sites.joints)), ()]


def displacements(around, location, features, campaign=None):
    """Random displacements at one location, per unit of their coefficients in plausible sizes.

    Parameters
    ----------
    around : Circumstances
    location : tuple of int
    features : int
        At a joint.
    campaign : Circumstances, optional
        By whose inputs those are normalised; without, by their own. It makes the same function of other states.

    Returns
    -------
    list of dict of int to ndarray (S,)
        For each feature a displacement of one coordinate.
    """
    campaign = around if campaign is None else campaign
    inputs, load = _inputs(around, campaign), _relative_load(around, location, campaign)
    loaded = bool(_load(campaign, location).any())
    draws = stream(_SEED, OTHER, "random Fourier features", location[0] if location else 0)
    if location:
        return [{location[0] - 1: JOINT_RAD * wave} for wave in _waves(inputs, load, features, draws, loaded)]
    sizes = dict(zip(around.sites.base, (BASE_M,) * 3 + (BASE_RAD,) * 3, strict=True))
    return [
        {coordinate: size * wave}
        for coordinate, size in sizes.items()
        for wave in _waves(inputs, load, _BASE_FEATURES, draws, loaded)
    ]


def _waves(inputs, load, count, draws, loaded):
    """Features (count, S) whose squares sum to about one; the second half times the load."""
    low, high = np.log(_LENGTH_SCALES)
    lengths = np.exp(draws.uniform(low, high, count))
    frequency = draws.standard_normal((inputs.shape[1], count)) / lengths
    waves = np.sqrt(2.0 / count) * np.cos(inputs @ frequency + draws.uniform(0, 2 * np.pi, count))
    if loaded:
        waves[:, count // 2 :] *= load[:, None]
    return waves.T


def _inputs(around, campaign):
    """Angles as points of a circle, load, sense of approach and time, each of size about one, ndarray (S, D)."""
    parts = [np.cos(around.joint_angles), np.sin(around.joint_angles)]
    for name in ("wrench", "approach", "time_s", "temperature_c"):
        known = getattr(campaign, name)
        if known is not None:
            known = np.reshape(known, (len(campaign.joint_angles), -1)).astype(float)
            values = np.reshape(getattr(around, name), (len(around.joint_angles), -1)).astype(float)
            spread = np.abs(known - known.mean(axis=0)).max(axis=0)
            parts.append(((values - known.mean(axis=0)) / np.where(spread > 0, spread, 1.0))[:, spread > 0])
    return np.concatenate(parts, axis=1)


def _relative_load(around, location, campaign):
    """The load relative to the largest of the campaign, ndarray (S,)."""
    load, largest = _load(around, location), np.abs(_load(campaign, location)).max(initial=0.0)
    return load / largest if largest else np.zeros(len(load))


def _load(around, location):
    """Torque on the joint, or force on the base, ndarray (S,)."""
    return around.total[:, location[0] - 1] if location else np.linalg.norm(around.wrench[:, :3], axis=1)
