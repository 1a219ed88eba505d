"""Position errors of two models on held-out poses, as campaigns make them: common to a
pose, skewed, with poses far off."""

import numpy as np

from elastocal.validation.held_out import PositionErrors

INTERPRETATIONS = 6
_MANY = 400_000


def made_errors(kind, campaigns, poses, rng):
    """Errors before and after an effect of 1.5 noises is found but for a tenth, and
    after one that is none was added.

    Returns `cluster` (M,): the same in all campaigns; `before`, `after`, `false`
    (campaigns, M).
    """
    # Sizes that go round have the same share in any number of poses divisible by three.
    sizes = (
        np.resize([2, 6, 10], poses)
        if kind == "uneven"
        else np.full(poses, INTERPRETATIONS)
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
    return cluster, *(
        np.linalg.norm(off, axis=-1)
        for off in (noise + effect, noise + 0.1 * effect, false)
    )


def true_figures(kind):
    """What the intervals are of, from very many poses: mean and RMS after, and the two
    reductions."""
    _, before, after, false = made_errors(
        kind, 1, _MANY - _MANY % 3, np.random.default_rng(99)
    )
    rms = [np.sqrt((distance**2).mean()) for distance in (before, after, false)]
    figures = {"mean_m": after.mean(), "rms_m": rms[1]}
    return figures | {
        "reduction": 1 - rms[1] / rms[0],
        "reduction of none": 1 - rms[2] / rms[1],
    }


def campaigns_of(kind, campaigns, poses, seed):
    """(before, after, false) as `Errors`, campaign by campaign."""
    cluster, *stages = made_errors(kind, campaigns, poses, np.random.default_rng(seed))
    return [
        tuple(PositionErrors(distance, cluster) for distance in of_one)
        for of_one in zip(*stages, strict=True)
    ]
