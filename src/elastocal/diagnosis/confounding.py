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


def angles_between(problem: Problem, numbers: Sequence[int]) -> np.ndarray:
    """Smallest angle between each two of some units.

    Returns (N, N): degrees.
    """
    gram = problem.statistics.gram[0]
    bases = [_orthonormal(gram, problem.units[number].columns) for number in numbers]
    starts = np.concatenate([[0], np.cumsum([basis.shape[1] for basis in bases])]).astype(int)
    together = np.zeros((len(gram), starts[-1]))
    for number, basis, start in zip(numbers, bases, starts, strict=False):
        together[problem.units[number].columns, start : start + basis.shape[1]] = basis
    products = together.T @ gram @ together
    cosines = np.eye(len(bases))
    for one in range(len(bases)):
        for other in range(one):
            block = products[starts[one] : starts[one + 1], starts[other] : starts[other + 1]]
            cosines[one, other] = cosines[other, one] = np.linalg.norm(block, 2) if block.size else 0.0
    return np.degrees(np.arccos(np.clip(cosines, 0.0, 1.0)))


def nearest_angles(problem: Problem, found: Sequence[int]) -> np.ndarray:
    """Angle of each unit to the nearest of those found.

    Returns (number of units,): degrees; not a number where nothing was found.
    """
    nearest = np.full(len(problem.units), np.nan)
    if not len(found):
        return nearest
    gram, units = problem.statistics.gram[0], problem.units
    mine = [_orthonormal(gram, units[number].columns) for number in found]
    widths = np.array([len(unit.columns) for unit in units])
    for width in np.unique(widths):
        numbers = np.flatnonzero(widths == width)
        columns = np.array([units[number].columns for number in numbers])
        across = _orthonormal(gram, columns).swapaxes(1, 2)
        cosines = [
            np.linalg.norm(across @ gram[columns[..., None], units[other].columns] @ there, 2, axis=(1, 2))
            for other, there in zip(found, mine, strict=True)
        ]
        nearest[numbers] = np.degrees(np.arccos(np.minimum(np.max(cosines, axis=0), 1.0)))
    return nearest


def _orthonormal(gram: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Coefficients (..., d, d) of orthonormal columns in the spans of some columns (..., d); zero for what is rounding."""
    values, vectors = np.linalg.eigh(gram[columns[..., :, None], columns[..., None, :]])
    kept = values > _ROUNDING * np.maximum(values[..., -1:], np.finfo(float).tiny)
    return vectors * (kept / np.sqrt(np.where(kept, values, 1.0)))[..., None, :]
