"""Which rows of an array are alike."""

import numpy as np


def groups_of(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Group equal rows: `numpy.unique` along the first axis, many times as fast.

    `keys` (N, k). Returns `first` (G,) of int: first row of each group; groups in lexicographic order; `group` (N,) of int: of
    each row.
    """
    order = np.lexsort(keys.T[::-1])
    rising = keys[order]
    new = np.concatenate([np.ones(min(len(keys), 1), bool), (rising[1:] != rising[:-1]).any(axis=1)])
    group = np.empty(len(keys), int)
    group[order] = np.cumsum(new) - 1
    return order[new], group
