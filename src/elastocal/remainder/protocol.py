"""What a regression on residuals is: inputs, a prediction with its uncertainty, and settings among which poses choose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    Setting = Mapping[str, Any]
    # A fitted regression, which predicts residuals of other observations.
    Predictor = Callable[["Inputs"], "Prediction"]


@dataclass(frozen=True)
class Inputs:
    """What a regression may know of an observation; arrays of M.

    `joint_angles` (M, n): rad. `others` (M, k): wrench and place of the target in its measuring point; neither time nor
    temperature, of which a correction knows nothing. `jacobian` (M, 3, C): of the target's position with respect to the joints,
    first, and whatever else of the chain may be displaced: base and links; base axes, m per rad or m; then what effects of the
    model do, see `corrected.inputs_of`.
    """

    joint_angles: np.ndarray
    others: np.ndarray
    jacobian: np.ndarray

    def __len__(self) -> int:
        return len(self.joint_angles)

    @property
    def columns(self) -> np.ndarray:
        """ndarray (M, n + k): joint angles, then the others."""
        return np.hstack([self.joint_angles, self.others])

    def select(self, chosen: np.ndarray | slice) -> Inputs:
        """The inputs of some observations."""
        return Inputs(self.joint_angles[chosen], self.others[chosen], self.jacobian[chosen])


@dataclass(frozen=True)
class Prediction:
    """Predicted residuals.

    `mean` (M, 3): m, base axes. `spread`: gives the standard deviation (M, 3) of a new measurement about it, which costs more
    than the mean; None where the regression states none.
    """

    mean: np.ndarray
    spread: Callable[[], np.ndarray] | None = None

    @cached_property
    def std(self) -> np.ndarray | None:
        """ndarray (M, 3), m; None where the regression states none."""
        return None if self.spread is None else self.spread()


@dataclass(frozen=True)
class Folds:
    """Training poses in K folds, and what models leave of them that were fitted without each.

    `inputs`: of M observations. `configuration`, `fold` (M,): of each, 0 .. G-1 and 0 .. K-1; a configuration has one fold.
    `whole` (M, 3): residuals of the model fitted to all of them, m, base axes. `residual` (K, M, 3): without each fold.
    """

    inputs: Inputs
    configuration: np.ndarray
    fold: np.ndarray
    whole: np.ndarray
    residual: np.ndarray


class Regression(Protocol):
    """A module of this package.

    `NAME`: as configurations name it. `WORDS`: as people do. `SETTINGS`: among which `tuning.tuned` chooses by poses that a fit
    has not seen; a single one where the regression chooses itself.
    """

    NAME: str
    WORDS: str
    SETTINGS: Sequence[Setting]

    def fitted(self, inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int) -> Iterator[Predictor]:
        """Fit the regression with each of some settings, in their order.

        `residual` (M, 3): m, base axes. `seed`: of whatever is drawn.
        """
        ...
