"""Simulated position errors of two models on held-out poses.

Errors of a pose are correlated; they may be skewed or have outlying poses.
"""

import numpy as np

from elastocal.validation.held_out import PositionErrors

# Kinds of errors: Gaussian and correlated within a pose; with uneven numbers of
# measurements; skewed; with outlying poses.
KINDS = ("common", "uneven", "skewed", "far off")
MEASUREMENTS_A_POSE = 6
# Poses for the true values of the figures.
_MANY_POSES = 400_000


def made_errors(kind, campaigns, poses, rng):
    """Draw errors before and after an effect is corrected, and after a false correction.

    The effect is 1.5 times the noise; a tenth of it remains.

    Returns
    -------
    cluster : (M,) array, pose of each error, the same in all campaigns
    before, after, false : (campaigns, M) arrays
    """
    # Each of the three sizes has the same share if the number of poses is divisible by
    # three.
    sizes = (
        np.resize([2, 6, 10], poses)
        if kind == "uneven"
        else np.full(poses, MEASUREMENTS_A_POSE)
    )
    cluster = np.repeat(np.arange(poses), sizes)
    scale = np.ones((campaigns, poses))
    if kind == "skewed":
        scale = np.exp(0.5 * rng.standard_normal((campaigns, poses)))
    if kind == "far off":
        scale = np.where(rng.random((campaigns, poses)) < 0.05, 4.0, 1.0)
    common = rng.standard_normal((campaigns, poses, 3))
    noise = (scale[..., None] * common)[:, cluster] + scale[
        :, cluster, None
    ] * rng.standard_normal((campaigns, len(cluster), 3))
    angle = rng.uniform(-np.pi, np.pi, (campaigns, poses))
    effect = (
        3.0
        * (np.sin(angle)[:, cluster] * rng.random((campaigns, len(cluster))))[..., None]
        * [0.0, 0.0, 1.0]
    )
    false = noise + 0.1 * effect + 0.3 * rng.standard_normal(noise.shape)
    before = np.linalg.norm(noise + effect, axis=-1)
    after = np.linalg.norm(noise + 0.1 * effect, axis=-1)
    return cluster, before, after, np.linalg.norm(false, axis=-1)


def true_figures(kind):
    """Compute the true values of the intervals from very many poses.

    They are mean and RMS after the correction, and the two reductions of the RMS.
    """
    _, before, after, false = made_errors(
        kind, 1, _MANY_POSES - _MANY_POSES % 3, np.random.default_rng(99)
    )
    rms = [np.sqrt((distance**2).mean()) for distance in (before, after, false)]
    figures = {"mean_m": after.mean(), "rms_m": rms[1]}
    return figures | {
        "reduction": 1 - rms[1] / rms[0],
        "reduction of none": 1 - rms[2] / rms[1],
    }


def campaigns_of(kind, campaigns, poses, seed):
    """List before, after and false as `PositionErrors`, campaign by campaign."""
    cluster, *stages = made_errors(kind, campaigns, poses, np.random.default_rng(seed))
    campaign_errors = []
    for before, after, false in zip(*stages, strict=True):
        campaign_errors.append(
            (
                PositionErrors(before, cluster),
                PositionErrors(after, cluster),
                PositionErrors(false, cluster),
            )
        )
    return campaign_errors
