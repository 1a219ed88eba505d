"""Bootstrap weights: how often each data set and each test configuration counts in each replicate."""

from collections.abc import Sequence

import numpy as np

from elastocal.random_streams import draw


def bootstrap_weights(seed: int, key: str, data_sets: Sequence[int] | np.ndarray, replicates: int) -> np.ndarray:
    """How often each data set counts in each replicate: once in replicate 0, Poisson(1) times in the others.

    The Poisson bootstrap [1], whose independent weights of mean one do not need to know how many data sets there are. They are
    the same for every noise level and strategy, so that replicates of two of them may be compared one by one.

    `seed`, `key`: as in `random_streams.stream`. Returns (1 + replicates, sets).

    [1] Hanley, J. A. and MacGibbon, B., Creating non-parametric bootstrap samples using Poisson frequencies, Computer Methods
        and Programs in Biomedicine 83, 2006.
    """
    counts = draw(seed, key, "bootstrap", data_sets, lambda stream: stream.poisson(1.0, replicates))
    return np.vstack([np.ones(len(counts)), counts.T])


def bootstrap_test_weights(seed: int, key: str, tests: int, replicates: int) -> np.ndarray:
    """How often each test configuration counts in each replicate, as `bootstrap_weights` for data sets.

    `seed`, `key`, `replicates`: as in `bootstrap_weights`. Returns (1 + replicates, tests).
    """
    counts = draw(seed, key, "bootstrap of tests", [0], lambda stream: stream.poisson(1.0, (replicates, tests)))[0]
    return np.vstack([np.ones(tests), counts])
