"""Extremely randomized trees: averages of neighbours in boxes, for whatever is not smooth [1].

[1] Geurts, P., Ernst, D. and Wehenkel, L., Extremely randomized trees, Machine Learning 63, 2006.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.remainder.protocol import Inputs, Predictor, Setting

NAME, WORDS = "extra_trees", "forest of extremely randomized trees"
_TREES = 100
# What the method's authors use for regression: all inputs at each node, and no node of fewer observations is split.
SETTINGS: Sequence[Setting] = ({"min_samples_split": 5, "max_features": 1.0},)


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
        grown = [ExtraTreeRegressor(random_state=each, **setting).fit(columns, target, check_input=False) for each in seeds]

        def predictor(there: Inputs, trees: Sequence[ExtraTreeRegressor] = grown) -> Prediction:
            asked = there.columns.astype(np.float32)
            return Prediction(np.mean([tree.predict(asked, check_input=False) for tree in trees], axis=0))

        yield predictor
