"""Checks that every kind of measurement must pass."""

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.measuring.protocol import Feature

_STEP = 1e-6


def check_derivatives(kind, values, numbers, seed=1):
    """Compare the derivatives of a kind with central differences of its residual."""
    draws = np.random.default_rng(seed)
    count = len(numbers)
    position = draws.standard_normal((count, 3))
    rotation = Rotation.random(count, random_state=seed).as_matrix()

    def residual(place, turn, features):
        turned = Rotation.from_rotvec(turn).as_matrix() @ rotation
        return kind.evaluate(position + place, turned, numbers, features).residual

    predicted = kind.evaluate(position, rotation, numbers, values)
    for axis, step in enumerate(_STEP * np.eye(6)):
        above = residual(step[:3], step[3:], values)
        below = residual(-step[:3], -step[3:], values)
        slope = -(above - below) / (2 * _STEP)
        np.testing.assert_allclose(predicted.by_pose[..., axis], slope, atol=1e-6)
    still = np.zeros(3)
    width = predicted.by_unknowns.shape[2]
    for number, step in enumerate(_STEP * np.eye(width)):
        above = residual(still, still, kind.move(values, step))
        below = residual(still, still, kind.move(values, -step))
        slope = -(above - below) / (2 * _STEP)
        np.testing.assert_allclose(predicted.by_unknowns[..., number], slope, atol=1e-6)


def describe(kind, **stated):
    """A feature of a kind, checked as campaign.yaml is."""
    feature = Feature("it", kind.name, stated)
    kind.check(feature)
    return feature
