"""Step 4a: the bootstrap weights of one robot, drawn once for all strategies and noise levels."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from elastocal.study.bootstrap import bootstrap_test_weights, bootstrap_weights
from elastocal.study.steps.blocks import blocks_of_sets

DATA_SETS, TESTS = "data sets", "test configurations"


def weight_blocks(key: str, seed: int, data_sets: int, tests: int, replicates: int) -> Iterator[dict[str, np.ndarray | str]]:
    """How often each data set and each test configuration counts in each bootstrap replicate, in blocks.

    `key`: name of the robot's file. `data_sets`, `tests`: how many there are. Yields columns of one block of the weights table:
    data sets in the blocks of the experiments, then all test configurations.
    """
    for sets in blocks_of_sets(data_sets):
        yield _columns(DATA_SETS, sets, bootstrap_weights(seed, key, sets, replicates))
    yield _columns(TESTS, range(tests), bootstrap_test_weights(seed, key, tests, replicates))


def to_weights(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Weights (1 + replicates, members) of a block of the weights table; replicate 0 counts each member once."""
    counts = columns["count"].reshape(-1, columns["replicate"].max())
    return np.vstack([np.ones(len(counts)), counts.T])


def _columns(members: str, numbers: Sequence[int], weights: np.ndarray) -> dict[str, np.ndarray | str]:
    counts = weights[1:].T
    return {
        "members": members,
        "number": np.repeat(numbers, counts.shape[1]),
        "replicate": np.tile(np.arange(1, counts.shape[1] + 1), len(counts)),
        "count": counts.ravel(),
    }
