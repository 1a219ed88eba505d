"""Designs against each other and against their bound."""

import numpy as np
import pytest

from elastocal.study.designs import CONTINUOUS, RANDOM, rate_designs


@pytest.fixture(scope="module")
def found():
    rng = np.random.default_rng(1)
    rows = 30 * rng.standard_normal((300, 6, 4)) * np.array([1.0, 2.0, 0.5, 1.0])
    return rate_designs(rows, 1e-3 * rng.standard_normal((50, 3, 4)), [3, 8], np.random.default_rng(2))


def worth(found, kind, size):
    (one,) = [each for each in found if (each.kind, each.configurations) == (kind, size)]
    return one


@pytest.mark.parametrize("size", [3, 8])
def test_designs_lie_between_the_bound_and_random_ones(found, size):
    random, least = worth(found, RANDOM, size), worth(found, CONTINUOUS, size)
    for kind in ("D", "A", "I"):
        assert least.rms <= worth(found, kind, size).rms < random.rms
    # What is optimised is best, as far as an exchange finds it.
    assert worth(found, "I", size).rms <= 1.001 * min(worth(found, "D", size).rms, worth(found, "A", size).rms)
    assert random.low < random.rms < random.high
