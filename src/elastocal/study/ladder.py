"""How many springs pay: from elastic joints alone, link spring by link spring, up to
the extended model (RQ1).

A link spring is the compliance of a beam about its own axes: six diagonal elements and
the two by which bending and lateral deflection go together. All of them enter linearly.
Which link comes next, and where to stop, is chosen by cross-validation [1] within each
data set, by forward selection [2]; configurations that neither has seen judge the
result.

[1] Stone, M., Cross-validatory choice and assessment of statistical predictions, Journal of the Royal Statistical Society B 36,
    1974.
[2] Hastie, T., Tibshirani, R. and Friedman, J., The Elements of Statistical Learning, 2nd edition, sections 3.3 and 7.10,
    Springer, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.storage import Column
from elastocal.mechanics.elastostatics import (
    beam_axes,
    extended_chain,
    generalized_forces,
)
from elastocal.mechanics.kinematics import jacobians
from elastocal.study.in_memory import define_study_step
from elastocal.study.jobs import (
    DATA_SET,
    LENGTH,
    MEAN_SQUARE_MEANING,
    MICRO,
    define_table_step,
    make_frame,
    make_integer_column,
    make_real_column,
    make_schema,
)
from elastocal.study.points import mean_of
from elastocal.study.simulation import draw_measurement_noise

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.mechanics.robot import Robot
    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.simulation import Experiments

LADDER = make_schema(
    "ladder",
    make_real_column("noise", "m, rad", "standard deviation of the measurements"),
    LENGTH,
    DATA_SET,
    make_integer_column("link_springs", "number of link springs in the model", 0),
    Column("chosen", "bool", "", "whether cross-validation stops here"),
    make_real_column("mean_square", "m^2", MEAN_SQUARE_MEANING),
)
CHOSEN = "by cross-validation"
FOLDS = 5
# Elements of the compliance of a beam along x: (row, column) of those that are not
# zero, each with its mirror image.
_ELEMENTS = ((0, 0), (1, 1), (2, 2), (3, 3), (4, 4), (5, 5), (1, 5), (2, 4))
# Share of a column's squares that keeps normal equations well posed where springs do
# the same, as the torsion of the first link and the first joint: what such springs
# predict together does not depend on it.
_RIDGE = 1e-10


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of some measurements, K columns.

    `gram` (..., K, K), `along` (..., K), `squares` (...).
    """

    gram: np.ndarray
    along: np.ndarray
    squares: np.ndarray

    def squared_error(self, coefficients: np.ndarray) -> np.ndarray:
        """Sum of squares that coefficients (..., K) leave."""
        quadratic = (coefficients * (self.gram @ coefficients[..., None])[..., 0]).sum(
            axis=-1
        )
        return self.squares - 2.0 * (coefficients * self.along).sum(axis=-1) + quadratic


@dataclass(frozen=True)
class Ladder:
    """Models of each data set, from no link spring to all.

    `order` (sets, L) of int: links in the order in which they were added.
    `cross_validated` (sets, L + 1): sum of squares left in the folds that were left
    out. `coefficients` (sets, L + 1, K): of the model with so many links, fitted to the
    whole data set.
    """

    order: np.ndarray
    cross_validated: np.ndarray
    coefficients: np.ndarray

    @property
    def chosen(self) -> np.ndarray:
        """Number of links by cross-validation, ndarray of int (sets,)."""
        return np.argmin(self.cross_validated, axis=1)


def compute_spring_columns(robot: Robot, experiments: Experiments) -> np.ndarray:
    """Deflection of the end-effector per unit of each spring element: joints first,
    then eight for each link.

    `robot`: with links. Returns (sets, configurations, 6, n + 8 L).
    """
    chain = extended_chain(robot)
    n = robot.joints
    jacobian = jacobians(chain, chain.at(experiments.joint_angles), chain.end_effector)
    torques = generalized_forces(jacobian, experiments.wrench)
    columns = [jacobian[..., :n] * torques[..., None, :n]]
    for number, link in enumerate(robot.links):
        axes = beam_axes(link)
        mine = slice(n + 6 * number, n + 6 * number + 6)
        moved = jacobian[..., mine] @ axes
        forced = torques[..., mine] @ axes
        for i, j in _ELEMENTS:
            column = moved[..., i] * forced[..., None, j]
            columns.append(
                (column if i == j else column + moved[..., j] * forced[..., None, i])[
                    ..., None
                ]
            )
    return np.concatenate(columns, axis=-1)


def form_normal_equations(
    columns: np.ndarray, deflection: np.ndarray
) -> NormalEquations:
    """Normal equations of each data set.

    `columns` (sets, configurations, rows, K), `deflection` (sets, configurations,
    rows). Returns of shape (sets,).
    """
    left = columns.reshape(len(columns), -1, columns.shape[-1])
    right = deflection.reshape(len(deflection), -1)
    across = left.swapaxes(1, 2)
    return NormalEquations(
        across @ left, (across @ right[..., None])[..., 0], (right**2).sum(axis=1)
    )


def build_ladder(parts: list[NormalEquations], joints: int, links: int) -> Ladder:
    """Add link springs one by one, in each data set that which cross-validation likes
    best.

    `parts`: of each fold, of shape (sets,).
    """
    whole = NormalEquations(
        *(
            sum(getattr(part, name) for part in parts)
            for name in ("gram", "along", "squares")
        )
    )
    sets, size = whole.along.shape
    each = np.arange(sets)
    elements = (size - joints) // links
    columns = np.broadcast_to(np.arange(joints), (sets, joints))
    left = np.broadcast_to(np.arange(links), (sets, links))
    order = np.zeros((sets, 0), int)
    scaled = _scaled(whole.gram, whole.along)
    others = [
        _scaled(whole.gram - part.gram, whole.along - part.along) for part in parts
    ]
    scores = [_cross_validate(parts, others, columns)]
    fits = [_fit(columns, *scaled)]
    for _ in range(links):
        added = [
            joints + elements * left[:, [place]] + np.arange(elements)
            for place in range(left.shape[1])
        ]
        tried = [np.concatenate([columns, of_link], axis=1) for of_link in added]
        found = np.stack(
            [_cross_validate(parts, others, some) for some in tried], axis=1
        )
        best = np.argmin(found, axis=1)
        order = np.concatenate([order, left[each, best][:, None]], axis=1)
        columns = np.stack(tried)[best, each]
        left = left[np.arange(left.shape[1]) != best[:, None]].reshape(sets, -1)
        scores.append(found[each, best])
        fits.append(_fit(columns, *scaled))
    return Ladder(order, np.stack(scores, axis=1), np.stack(fits, axis=1))


def _cross_validate(
    parts: list[NormalEquations],
    others: list[tuple[np.ndarray, ...]],
    columns: np.ndarray,
) -> np.ndarray:
    """Sum of squares left in each fold by the fit to the others, (sets,)."""
    return np.sum(
        [
            part.squared_error(_fit(columns, *rest))
            for part, rest in zip(parts, others, strict=True)
        ],
        axis=0,
    )


def _scaled(gram: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, ...]:
    """Normal equations with columns of length 1, and these lengths (sets, K)."""
    scale = np.sqrt(np.diagonal(gram, axis1=1, axis2=2))
    return (
        gram / (scale[:, :, None] * scale[:, None, :])
        + _RIDGE * np.eye(gram.shape[-1]),
        along / scale,
        scale,
    )


def _fit(
    columns: np.ndarray, gram: np.ndarray, along: np.ndarray, scale: np.ndarray
) -> np.ndarray:
    """Least squares with some columns of each data set, zero for the others, (sets, K);
    the rest from `_scaled`."""
    each = np.arange(len(columns))[:, None]
    found = np.zeros_like(along)
    chosen = gram[each[..., None], columns[:, :, None], columns[:, None, :]]
    found[each, columns] = (
        np.linalg.solve(chosen, along[each, columns][..., None])[..., 0]
        / scale[each, columns]
    )
    return found


def evaluate_ladder(
    study: StudyInMemory, lengths: Sequence[int], noises: Sequence[float]
) -> Iterator[dict[str, np.ndarray]]:
    """Models with more and more link springs, in each data set of the study of the
    tables.

    `study`: of a robot with links; the noise of its size is not looked at. `lengths`:
    configurations from which to identify. `noises`: standard deviations, the same
    number in m and rad.
    """
    robot = study.robot
    tests = study.tests()
    judged = form_normal_equations(
        compute_spring_columns(robot, tests)[:, :, :3],
        study.deflections(tests)[..., :3],
    )
    longest = max(lengths)
    count = len(robot.links)
    for sets in study.blocks():
        drawn = study.experiments(sets, longest)
        columns = compute_spring_columns(robot, drawn)
        ideal = study.deflections(drawn)
        normal = draw_measurement_noise(
            study.seed, study.key, robot.chain.end_effector.name, sets, longest
        )
        for noise, length in (
            (noise, length) for noise in noises for length in lengths
        ):
            deflection = ideal + noise * normal
            folds = [
                form_normal_equations(
                    columns[:, fold:length:FOLDS], deflection[:, fold:length:FOLDS]
                )
                for fold in range(FOLDS)
            ]
            found = build_ladder(folds, robot.joints, count)
            errors = np.stack(
                [
                    judged.squared_error(some)
                    for some in found.coefficients.swapaxes(0, 1)
                ],
                axis=1,
            )
            yield {
                "noise": np.full(errors.size, noise),
                "length": np.full(errors.size, length),
                "data_set": np.repeat(sets, count + 1),
                "link_springs": np.tile(np.arange(count + 1), len(sets)),
                "chosen": (np.arange(count + 1) == found.chosen[:, None]).ravel(),
                "mean_square": errors.ravel() / study.size.tests,
            }


def build_ladder_table(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Error of one data set on configurations that it has not seen, by number of link
    springs, or `CHOSEN`.

    `found`: the ladder table of each robot with links. chosen_percent: share of data
    sets in which cross-validation stops there.
    """
    rows = []
    for robot, frame in found.items():
        for (noise, length), cell in frame.groupby(["noise", "length"]):
            steps = [
                (str(number), some) for number, some in cell.groupby("link_springs")
            ]
            for name, some in [*steps, (CHOSEN, cell[cell.chosen])]:
                rms = mean_of(some.mean_square.to_numpy(), True, MICRO)
                chosen = 100 * some.chosen.mean() if name != CHOSEN else np.nan
                noise_um = round(MICRO * float(str(noise)), 6)
                rows.append(
                    (robot, noise_um, length, name, rms.value, rms.std_error(), chosen)
                )
    head = ("robot", "noise_um", "length", "link_springs")
    return make_frame(rows, (*head, "rms_um", "rms_um_std_error", "chosen_percent"))


climb_ladder = define_study_step(LADDER, evaluate_ladder)
tabulate_ladder = define_table_step(LADDER, build_ladder_table)
