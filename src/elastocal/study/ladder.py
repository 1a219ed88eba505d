"""How many springs pay: from elastic joints alone, link spring by link spring, up to the
extended model (RQ1).

A link spring is the compliance of a beam about its own axes: six diagonal elements and
the two that couple bending and lateral deflection. All of them enter linearly. Within
each data set, cross-validation [1] chooses which link comes next and where to stop, by
forward selection [2]; configurations that neither uses judge the result.

References
----------
.. [1] Stone, M., Cross-validatory choice and assessment of statistical predictions, Journal
   of the Royal Statistical Society B 36, 1974.
.. [2] Hastie, T., Tibshirani, R. and Friedman, J., The Elements of Statistical Learning,
   2nd edition, sections 3.3 and 7.10, Springer, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import (
    build_extended_chain,
    compute_beam_axes,
    compute_generalized_forces,
)
from elastocal.mechanics.kinematics import compute_jacobians
from elastocal.study.in_memory import define_study_step
from elastocal.study.jobs import MICRO, define_table_step, make_frame
from elastocal.study.points import score_rms
from elastocal.study.schemas import LADDER
from elastocal.study.simulation import draw_measurement_noise

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pandas as pd

    from elastocal.io.data_frames import Frames
    from elastocal.mechanics.robot import Robot
    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.simulation import Experiments

CHOSEN = "by cross-validation"
FOLDS = 5
# Nonzero elements (row, column) of the symmetric compliance of a beam along x, on and
# above the diagonal.
_ELEMENTS = ((0, 0), (1, 1), (2, 2), (3, 3), (4, 4), (5, 5), (1, 5), (2, 4))
# Ridge, as a share of a column's squares, that keeps the normal equations well posed if
# two springs have the same effect, such as the torsion of the first link and the first
# joint. What such springs predict together does not depend on it.
_RIDGE = 1e-10


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of least-squares problems with K columns.

    Attributes
    ----------
    gram : (..., K, K) array
        Gram matrix of the columns.
    right_side : (..., K) array
        Products of the columns with the deflections.
    squares : (...) array
        Sum of squares of the deflections.
    """

    gram: np.ndarray
    right_side: np.ndarray
    squares: np.ndarray

    def __add__(self, addend: NormalEquations) -> NormalEquations:
        return NormalEquations(
            self.gram + addend.gram,
            self.right_side + addend.right_side,
            self.squares + addend.squares,
        )

    def compute_squared_error(self, coefficients: np.ndarray) -> np.ndarray:
        """Residual sum of squares (...) of coefficients (..., K)."""
        products = (self.gram @ coefficients[..., None])[..., 0]
        quadratic = (coefficients * products).sum(axis=-1)
        linear = (coefficients * self.right_side).sum(axis=-1)
        return self.squares - 2.0 * linear + quadratic


@dataclass(frozen=True)
class _ScaledEquations:
    """Normal equations of columns scaled to length 1, with a ridge.

    Attributes
    ----------
    gram : (sets, K, K) array
    right_side, scale : (sets, K) arrays
        `scale` holds the lengths of the original columns.
    """

    gram: np.ndarray
    right_side: np.ndarray
    scale: np.ndarray

    @classmethod
    def from_products(
        cls, gram: np.ndarray, right_side: np.ndarray
    ) -> _ScaledEquations:
        """Scale the columns of normal equations."""
        scale = np.sqrt(np.diagonal(gram, axis1=1, axis2=2))
        scaled = gram / (scale[:, :, None] * scale[:, None, :])
        ridge = _RIDGE * np.eye(gram.shape[-1])
        return cls(scaled + ridge, right_side / scale, scale)

    def fit(self, columns: np.ndarray) -> np.ndarray:
        """Fit some columns (sets, k) of each data set by least squares.

        Returns coefficients (sets, K), zero for all other columns.
        """
        sets = np.arange(len(columns))[:, None]
        coefficients = np.zeros_like(self.right_side)
        gram = self.gram[sets[..., None], columns[:, :, None], columns[:, None, :]]
        right_side = self.right_side[sets, columns][..., None]
        solution = np.linalg.solve(gram, right_side)[..., 0]
        coefficients[sets, columns] = solution / self.scale[sets, columns]
        return coefficients


@dataclass(frozen=True)
class Ladder:
    """Models of each data set, from no link spring to all L.

    Attributes
    ----------
    order : (sets, L) array of int
        Links in the order in which they were added.
    cross_validated : (sets, L + 1) array
        Sum of squares left in the folds that were left out.
    coefficients : (sets, L + 1, K) array
        Of the model with each number of links, fitted to the whole data set.
    """

    order: np.ndarray
    cross_validated: np.ndarray
    coefficients: np.ndarray

    @property
    def chosen(self) -> np.ndarray:
        """Number of links chosen by cross-validation, (sets,) array of int."""
        return np.argmin(self.cross_validated, axis=1)


def compute_spring_columns(robot: Robot, experiments: Experiments) -> np.ndarray:
    """Compute the deflection of the end-effector per unit of each spring element.

    Returns
    -------
    (sets, configurations, 6, n + 8 L) array
        The n joints first, then eight elements for each of the robot's L links.
    """
    chain = build_extended_chain(robot)
    n = robot.joints
    jacobian = compute_jacobians(
        chain, chain.at(experiments.joint_angles), chain.end_effector
    )
    torques = compute_generalized_forces(jacobian, experiments.wrench)
    columns = [jacobian[..., :n] * torques[..., None, :n]]
    for number, link in enumerate(robot.links):
        axes = compute_beam_axes(link)
        coordinates = slice(n + 6 * number, n + 6 * number + 6)
        motion = jacobian[..., coordinates] @ axes
        force = torques[..., coordinates] @ axes
        for i, j in _ELEMENTS:
            column = motion[..., i] * force[..., None, j]
            if i != j:
                column = column + motion[..., j] * force[..., None, i]
            columns.append(column[..., None])
    return np.concatenate(columns, axis=-1)


def form_normal_equations(
    columns: np.ndarray, deflection: np.ndarray
) -> NormalEquations:
    """Form the normal equations of each data set.

    Parameters
    ----------
    columns : (sets, configurations, rows, K) array
    deflection : (sets, configurations, rows) array

    Returns
    -------
    NormalEquations
        Of shape (sets,).
    """
    matrix = columns.reshape(len(columns), -1, columns.shape[-1])
    values = deflection.reshape(len(deflection), -1)
    transposed = matrix.swapaxes(1, 2)
    right_side = (transposed @ values[..., None])[..., 0]
    return NormalEquations(transposed @ matrix, right_side, (values**2).sum(axis=1))


def build_ladder(folds: list[NormalEquations], joints: int, links: int) -> Ladder:
    """Add link springs one by one; in each data set the one with the lowest
    cross-validated error comes next.

    Parameters
    ----------
    folds
        Of each fold, of shape (sets,).
    joints, links : int
        Numbers of joints and links.
    """
    total = sum(folds[1:], start=folds[0])
    sets = len(total.right_side)
    elements = np.arange((total.right_side.shape[1] - joints) // links)
    scaled = _ScaledEquations.from_products(total.gram, total.right_side)
    training = [
        _ScaledEquations.from_products(
            total.gram - fold.gram, total.right_side - fold.right_side
        )
        for fold in folds
    ]
    rows = np.arange(sets)
    columns = np.broadcast_to(np.arange(joints), (sets, joints))
    remaining = np.broadcast_to(np.arange(links), (sets, links))
    order = []
    scores = [_cross_validate(folds, training, columns)]
    fits = [scaled.fit(columns)]
    for _ in range(links):
        candidates = [
            np.concatenate(
                [columns, joints + len(elements) * link[:, None] + elements], axis=1
            )
            for link in remaining.T
        ]
        errors = np.stack(
            [_cross_validate(folds, training, candidate) for candidate in candidates],
            axis=1,
        )
        best = np.argmin(errors, axis=1)
        order.append(remaining[rows, best])
        columns = np.stack(candidates)[best, rows]
        is_kept = np.arange(remaining.shape[1]) != best[:, None]
        remaining = remaining[is_kept].reshape(sets, -1)
        scores.append(errors[rows, best])
        fits.append(scaled.fit(columns))
    return Ladder(
        np.stack(order, axis=1), np.stack(scores, axis=1), np.stack(fits, axis=1)
    )


def _cross_validate(
    folds: list[NormalEquations], training: list[_ScaledEquations], columns: np.ndarray
) -> np.ndarray:
    """Sum of squares (sets,) that fits of columns (sets, k) leave in the folds that they
    do not use."""
    errors = [
        fold.compute_squared_error(equations.fit(columns))
        for fold, equations in zip(folds, training, strict=True)
    ]
    return np.sum(errors, axis=0)


def evaluate_ladder(
    study: StudyInMemory, lengths: Sequence[int], noises: Sequence[float]
) -> Iterator[dict[str, np.ndarray]]:
    """Fit models with more and more link springs to each data set of the study of the
    tables.

    Parameters
    ----------
    study
        Of a robot with links; the noise of its size is not used.
    lengths
        Numbers of configurations from which to identify.
    noises
        Standard deviations, the same number in m and rad.

    Yields
    ------
    dict
        Columns of the ladder table.
    """
    robot = study.robot
    tests = study.draw_tests()
    test_equations = form_normal_equations(
        compute_spring_columns(robot, tests)[:, :, :3],
        study.compute_deflections(tests)[..., :3],
    )
    longest = max(lengths)
    for sets in study.list_blocks():
        experiments = study.draw_experiments(sets, longest)
        columns = compute_spring_columns(robot, experiments)
        ideal = study.compute_deflections(experiments)
        normal = draw_measurement_noise(
            study.seed, study.key, robot.chain.end_effector.name, sets, longest
        )
        for noise, length in product(noises, lengths):
            ladder = _fit_ladder(
                robot, columns[:, :length], (ideal + noise * normal)[:, :length]
            )
            errors = [
                test_equations.compute_squared_error(model)
                for model in ladder.coefficients.swapaxes(0, 1)
            ]
            mean_square = np.stack(errors, axis=1) / study.size.tests
            springs = np.arange(len(robot.links) + 1)
            yield {
                "noise": np.full(mean_square.size, noise),
                "length": np.full(mean_square.size, length),
                "data_set": np.repeat(sets, len(springs)),
                "link_springs": np.tile(springs, len(sets)),
                "chosen": (springs == ladder.chosen[:, None]).ravel(),
                "mean_square": mean_square.ravel(),
            }


def _fit_ladder(robot: Robot, columns: np.ndarray, deflection: np.ndarray) -> Ladder:
    """Build the ladder of some data sets; every `FOLDS`-th configuration is in one
    fold."""
    folds = [
        form_normal_equations(columns[:, fold::FOLDS], deflection[:, fold::FOLDS])
        for fold in range(FOLDS)
    ]
    return build_ladder(folds, robot.joints, len(robot.links))


def build_ladder_table(ladders: Frames) -> pd.DataFrame:
    """Error of one data set on test configurations, by number of link springs or
    `CHOSEN`.

    Parameters
    ----------
    ladders
        The ladder table of each robot with links.

    Returns
    -------
    DataFrame
        ``chosen_percent`` is the share of data sets in which cross-validation stops
        there.
    """
    rows = []
    for robot, frame in ladders.items():
        for (noise, length), cell in frame.groupby(["noise", "length"]):
            noise_um = round(MICRO * float(str(noise)), 6)
            head = (robot, noise_um, length)
            for springs, models in cell.groupby("link_springs"):
                share = 100 * models.chosen.mean()
                rows.append((*head, str(springs), *_score_models(models), share))
            chosen = cell[cell.chosen]
            rows.append((*head, CHOSEN, *_score_models(chosen), np.nan))
    columns = ("robot", "noise_um", "length", "link_springs")
    return make_frame(rows, (*columns, "rms_um", "rms_um_std_error", "chosen_percent"))


def _score_models(models: pd.DataFrame) -> tuple[float, float]:
    """RMS error in µm and its standard error."""
    rms = score_rms(models.mean_square.to_numpy(), MICRO)
    return rms.value, rms.compute_std_error()


climb_ladder = define_study_step(LADDER, evaluate_ladder)
tabulate_ladder = define_table_step(LADDER, build_ladder_table)
