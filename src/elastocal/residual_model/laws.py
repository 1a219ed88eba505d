"""Regressions as formulas, for programs that do not have this package."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.effects.formulas import Term


@dataclass(frozen=True)
class DisplacementLaw:
    """A displacement of the coordinates of the nominal chain, which its Jacobian carries
    to the target.

    Attributes
    ----------
    geometry : (G,) array
        Coefficients of the columns of `Inputs.jacobian`.
    terms : tuple of Term
        Further displacements of the joints.
    """

    geometry: np.ndarray
    terms: tuple[Term, ...]

    def scaled(self, factor: float) -> DisplacementLaw:
        """Scale the displacement."""
        terms = tuple(replace(term, value=factor * term.value) for term in self.terms)
        return DisplacementLaw(factor * self.geometry, terms)


@dataclass(frozen=True)
class ProcessLaw:
    """The mean of a Gaussian process with a Matérn kernel of order 5/2 at inputs x, m:
    offset + size * sum_i weights_i k(|u - points_i|), with u = (x - center) / spread /
    lengths and k(r) = (1 + s + s^2 / 3) exp(-s), s = sqrt(5) r.

    Attributes
    ----------
    columns : (d,) int array
        Inputs that vary, of joint angles, wrench and position of the target.
    center, spread, lengths : (d,) arrays
    points : (N, d) array
    weights : (N, 3) array
    offset, size : (3,) arrays, m
    setting : mapping
        Hyperparameters with which the process is fitted again.
    """

    columns: np.ndarray
    center: np.ndarray
    spread: np.ndarray
    lengths: np.ndarray
    points: np.ndarray
    weights: np.ndarray
    offset: np.ndarray
    size: np.ndarray
    setting: Mapping[str, Any]

    def scaled(self, factor: float) -> ProcessLaw:
        """Scale the mean."""
        return replace(self, offset=factor * self.offset, size=factor * self.size)


@dataclass(frozen=True)
class Tree:
    """A regression tree of K nodes, the first of which is the root.

    Attributes
    ----------
    column : (K,) int array
        Input that decides at a node; negative at a leaf.
    threshold : (K,) array
        An input in single precision that is at most this goes to the first child.
    children : (K, 2) int array
    value : (K, 3) array
        Predicted at a leaf, m.
    """

    column: np.ndarray
    threshold: np.ndarray
    children: np.ndarray
    value: np.ndarray


@dataclass(frozen=True)
class TreesLaw:
    """The mean of regression trees.

    Attributes
    ----------
    trees : tuple of Tree
    """

    trees: tuple[Tree, ...]

    def scaled(self, factor: float) -> TreesLaw:
        """Scale the mean."""
        trees = [replace(tree, value=factor * tree.value) for tree in self.trees]
        return TreesLaw(tuple(trees))


Law = DisplacementLaw | ProcessLaw | TreesLaw
