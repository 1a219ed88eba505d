"""Random numbers that depend on what they are for and on nothing else.

A stream is named by (seed, robot, purpose, data set). Seed and robot make the key of a
Philox counter-based generator [1], purpose and data set make its position. How many
data sets are drawn, in which order, by how many cores or in which blocks cannot change
a number.

[1] Salmon, J. K., Moraes, M. A., Dror, R. O. and Shaw, D. E., Parallel random numbers:
    as easy as 1, 2, 3, SC11, 2011.
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
    """Return the generator of one purpose in one data set.

    Parameters
    ----------
    seed : seed of the configuration.
    robot : name of the robot's file.
    purpose : what the numbers are for, such as ``configurations``.
    data_set : number of the data set.
    """
    key, position = _key_and_position(seed, robot, purpose)
    counter = [0, 0, data_set, position]
    return np.random.Generator(np.random.Philox(key=key, counter=counter))


def draw_data_sets(
    seed: int,
    robot: str,
    purpose: str,
    data_sets: Iterable[int],
    sampler: Callable[[np.random.Generator], np.ndarray],
) -> np.ndarray:
    """Draw an array for each data set, and stack them to (data sets, ...).

    Parameters
    ----------
    seed, robot, purpose : as of `open_stream`.
    data_sets : numbers of the data sets.
    sampler : draws an array of fixed shape.
    """
    generator = open_stream(seed, robot, purpose, 0)
    state = generator.bit_generator.state
    arrays = []
    for data_set in data_sets:
        # Move one generator to the start of each stream, because making a generator
        # takes longer than most draws.
        state["state"]["counter"][2] = data_set
        generator.bit_generator.state = state
        arrays.append(sampler(generator))
    return np.stack(arrays)


@lru_cache
def _key_and_position(seed: int, robot: str, purpose: str) -> tuple[np.ndarray, int]:
    """Return the key of the streams of a robot, and the position of a purpose."""
    digest = hashlib.sha256(f"{seed}/{robot}".encode()).digest()
    key = np.frombuffer(digest[:16], np.uint64)
    purpose_digest = hashlib.sha256(purpose.encode()).digest()
    return key, int.from_bytes(purpose_digest[:8], "little")
