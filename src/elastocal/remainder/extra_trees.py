"""Extremely randomized trees: averages of neighbours in boxes, for whatever is not smooth [1].

[1] Geurts, P., Ernst, D. and Wehenkel, L., Extremely randomized trees, Machine Learning 63, 2006.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sklearn.ensemble import ExtraTreesRegressor

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np

    from elastocal.remainder.protocol import Inputs, Predictor, Setting

NAME, WORDS = "extra_trees", "forest of extremely randomized trees"
_TREES = 100
# Observations in a leaf, and the share of the inputs among which each node chooses: the two that the method's authors tune.
SETTINGS: Sequence[Setting] = tuple(
    {"min_samples_leaf": leaf, "max_features": share} for leaf in (1, 5) for share in (0.5, 1.0)
)


class _Predictor:
    def __init__(self, trees: ExtraTreesRegressor) -> None:
        self._trees = trees

    def __call__(self, inputs: Inputs) -> Prediction:
        return Prediction(self._trees.predict(inputs.columns))


def fitted(inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int) -> Iterator[Predictor]:
    """Trees for all three axes together.

    `inputs`, `residual`, `settings`, `seed`: as in `protocol.Regression`.
    """
    for setting in settings:
        yield _Predictor(ExtraTreesRegressor(_TREES, random_state=seed, **setting).fit(inputs.columns, residual))
