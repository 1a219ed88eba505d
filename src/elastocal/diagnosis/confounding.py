"""Angles between what candidates contribute beyond the declared model: which of them these data distinguish.

Smallest principal angle between two subspaces [1], from Gram matrices alone.

[1] Björck, Å. and Golub, G. H., Numerical methods for computing angles between linear subspaces, Mathematics of Computation 27,
    1973.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.search import Problem

# Directions that keep less than this share of a unit's largest are rounding.
_ROUNDING = 1e-6


def angles_between(problem: Problem, numbers: Sequence[int], others: Sequence[int] | None = None) -> np.ndarray:
    """Smallest angle of each of some units to each of others, or to each of them, ndarray (N, M), degrees."""
    gram, units, others = problem.statistics.gram[0], problem.units, numbers if others is None else others
    bases = [_orthonormal(gram, units[other].columns) for other in others]
    widths, cosines = np.array([len(units[number].columns) for number in numbers]), np.empty((len(numbers), len(others)))
    for width in np.unique(widths):
        places = np.flatnonzero(widths == width)
        columns = np.array([units[numbers[place]].columns for place in places.tolist()])
        across = _orthonormal(gram, columns).swapaxes(1, 2)
        for number, (other, there) in enumerate(zip(others, bases, strict=True)):
            inner = across @ gram[columns[..., None], units[other].columns] @ there
            cosines[places, number] = np.linalg.norm(inner, 2, axis=(1, 2))
    return np.degrees(np.arccos(np.minimum(cosines, 1.0)))


def nearest_angles(problem: Problem, found: Sequence[int]) -> np.ndarray:
    """Angle of each unit to the nearest of those found, (number of units,), degrees; not a number where nothing was found."""
    every = range(len(problem.units))
    return angles_between(problem, every, found).min(axis=1) if len(found) else np.full(len(every), np.nan)


def _orthonormal(gram: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Coefficients (..., d, d) of orthonormal columns in the spans of some columns (..., d); zero for what is rounding."""
    values, vectors = np.linalg.eigh(gram[columns[..., :, None], columns[..., None, :]])
    kept = values > _ROUNDING * np.maximum(values[..., -1:], np.finfo(float).tiny)
    return vectors * (kept / np.sqrt(np.where(kept, values, 1.0)))[..., None, :]
