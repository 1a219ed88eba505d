"""Blocks of data sets: what a step holds in memory at a time."""

from collections.abc import Iterator

SETS_PER_BLOCK = 500


def blocks_of_sets(data_sets: int) -> Iterator[range]:
    """Numbers of so many data sets, block by block."""
    for first in range(0, data_sets, SETS_PER_BLOCK):
        yield range(first, min(first + SETS_PER_BLOCK, data_sets))
