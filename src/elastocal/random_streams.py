"""Random numbers that depend on what they are for and on nothing else.

Every stream is named by (seed, robot, purpose, data set): the first two make the key of
a Philox counter generator, the others its position. How many sets are drawn, in which
order, by how many cores or in which blocks cannot change a number.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


def open_stream(
    seed: int, robot: str, purpose: str, data_set: int
) -> np.random.Generator:
    """Generator for one purpose in one data set.

    `robot`: name of the robot's file. `purpose`: such as ``configurations``.
    """
    key, use = _names(seed, robot, purpose)
    return np.random.Generator(np.random.Philox(key=key, counter=[0, 0, data_set, use]))


def draw_data_sets(
    seed: int,
    robot: str,
    purpose: str,
    data_sets: Iterable[int],
    sampler: Callable[[np.random.Generator], np.ndarray],
) -> np.ndarray:
    """One array for each data set, stacked.

    `seed`, `robot`, `purpose`: as in `stream`. `sampler`: takes a Generator, returns an
    array of fixed shape. Returns (sets, ...).
    """
    generator = open_stream(seed, robot, purpose, 0)
    start = generator.bit_generator.state
    drawn = []
    for data_set in data_sets:
        # One generator is set to the start of each stream: to make one for each takes
        # longer than most draws.
        start["state"]["counter"][2] = data_set
        generator.bit_generator.state = start
        drawn.append(sampler(generator))
    return np.stack(drawn)


@lru_cache
def _names(seed: int, robot: str, purpose: str) -> tuple[np.ndarray, int]:
    """Key and position of the streams of one purpose."""
    key = np.frombuffer(
        hashlib.sha256(f"{seed}/{robot}".encode()).digest()[:16], np.uint64
    )
    return key, int.from_bytes(hashlib.sha256(purpose.encode()).digest()[:8], "little")
