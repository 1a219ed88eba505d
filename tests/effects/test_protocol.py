"""Shapes of laws: the values that a search tries."""

import numpy as np
import pytest

from elastocal.effects.protocol import Shape

TRIED = Shape("when", "1", 0.5, 0.0, 1.0, tried=11), Shape("lag", "s", 3600.0, 900.0, 36000.0)


@pytest.mark.parametrize("shape", TRIED, ids=lambda shape: shape.name)
@pytest.mark.parametrize("count", [1, 2, 5])
def test_shapes_share_their_range_by_which_of_them_is_nearest(shape, count):
    """On the scale on which they are spread: counted over a fine grid, whatever their order."""
    scale = (lambda value: value) if shape.tried else np.log
    every = np.linspace(scale(shape.lowest), scale(shape.highest), 100_001)
    values = np.random.default_rng(count).uniform(shape.lowest, shape.highest, count)
    nearest = np.argmin(np.abs(every[:, None] - scale(values)), axis=1)
    found = shape.shares(values)
    np.testing.assert_allclose(found, np.bincount(nearest, minlength=count) / len(every), atol=2e-5)
    assert found.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("shape", TRIED, ids=lambda shape: shape.name)
def test_shapes_between_two_are_inside_and_evenly_spread_with_the_middle_among_them(shape):
    found = shape.between(0.2, 0.8, 7) if shape.tried else shape.between(1000.0, 4000.0, 7)
    steps = np.diff(found) if shape.tried else np.diff(np.log(found))
    ends = (0.2, 0.8, 0.5) if shape.tried else (1000.0, 4000.0, 2000.0)
    assert len(found) == 7 and ends[0] < found[0] and found[-1] < ends[1]
    np.testing.assert_allclose(steps, steps[0])
    np.testing.assert_allclose(found[3], ends[2])
