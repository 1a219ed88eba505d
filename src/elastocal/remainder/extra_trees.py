"""Extremely randomized trees: averages of neighbours in boxes, for whatever is not smooth [1].

[1] Geurts, P., Ernst, D. and Wehenkel, L., Extremely randomized trees, Machine Learning 63, 2006.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from sklearn.tree import ExtraTreeRegressor

    from elastocal.remainder.protocol import Inputs, Predictor, Setting

NAME, WORDS = "extra_trees", "forest of extremely randomized trees"
_TREES = 100
# Observations in a leaf, and the share of the inputs among which each node chooses: the two that the method's authors tune.
SETTINGS: Sequence[Setting] = tuple(
    {"min_samples_leaf": leaf, "max_features": share} for leaf in (1, 5) for share in (0.5, 1.0)
)


@dataclass(frozen=True)
class _Forest:
    trees: list[ExtraTreeRegressor]

    def __call__(self, inputs: Inputs) -> Prediction:
        columns = inputs.columns.astype(np.float32)
        return Prediction(np.mean([tree.predict(columns, check_input=False) for tree in self.trees], axis=0))


def fitted(inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int) -> Iterator[Predictor]:
    """Trees for all three axes together.

    `inputs`, `residual`, `settings`, `seed`: as in `protocol.Regression`.
    """
    # Most of what needs the catalogue grows no tree.
    from sklearn.tree import ExtraTreeRegressor

    columns, target = inputs.columns.astype(np.float32), np.ascontiguousarray(residual)
    for setting in settings:
        # One by one: a forest would look at the same inputs again for each of its trees.
        draws = np.random.RandomState(seed)
        seeds = [draws.randint(np.iinfo(np.int32).max) for _ in range(_TREES)]
        grown = [ExtraTreeRegressor(random_state=each, **setting) for each in seeds]
        yield _Forest([tree.fit(columns, target, check_input=False) for tree in grown])
