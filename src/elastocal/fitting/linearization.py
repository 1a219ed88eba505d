"""Sensitivities of the measurements: the Jacobian of the chain times the displacement
of its coordinates per parameter.

An effect displaces coordinates of the sites, by an amount that belongs to the state;
how a coordinate moves what is measured belongs to the measurement. In row r of state s
a column of sensitivities is the sum over coordinates c of J[r, c] f_c(s), so that
products of two columns are sums over states of f_c(s) g_d(s) H_cd(s), with H = J'J of
the rows of one state: as many terms as states, where the columns themselves have a term
for each component of each target in it.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from elastocal.effects.conditions import (
    MASS_PARAMETERS,
    Conditions,
    with_springs,
    with_total,
)
from elastocal.fitting.model import (
    LOAD_EFFECTS,
    compute_displaced_coordinates,
    evaluate_basis_functions,
    get_joint_compliances,
    get_mass_corrections,
    locate_targets,
    subtract_prediction,
    sum_displacements,
    update_springs_and_masses,
)
from elastocal.fitting.observations import batch_groups_by_size
from elastocal.mechanics.kinematics import motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from elastocal.effects.protocol import Candidate, Law
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

    Laws = Sequence[Mapping[int, np.ndarray]]

# Numbers of products by state that are in memory at once.
_AT_ONCE = 1_500_000
# Relative step of the central difference in a shape parameter; of the forward
# difference in what loads the springs, in plausible sizes: laws of gears bend little
# over that.
_SHAPE_STEP = 1e-4
_SPRING_STEP = 1e-4


@dataclass(frozen=True)
class FactoredSensitivities:
    """Rows of K columns that displace coordinates, in two factors.

    Entries tell what a column does to a coordinate; those of one coordinate lie side by
    side, those of many first. `columns`: K. `values` (E, S): displacement of one
    coordinate by one column, in each state. `coordinate`, `column` (E,) of int.
    `jacobian` (M, rows, C): of each observation with respect to the coordinates,
    whitened or not. `state` (M,) of int: its state.
    """

    columns: int
    values: np.ndarray
    coordinate: np.ndarray
    column: np.ndarray
    jacobian: np.ndarray
    state: np.ndarray

    @classmethod
    def of(
        cls,
        laws: Laws,
        jacobian: np.ndarray,
        state: np.ndarray,
        states: int,
        sizes: np.ndarray | None = None,
    ) -> FactoredSensitivities:
        """Gather laws, one for each column, each a displacement of some coordinates in
        S `states`, times `sizes` (K,)."""
        count = Counter(coordinate for law in laws for coordinate in law)
        entries = sorted(
            (-count[coordinate], coordinate, column)
            for column, law in enumerate(laws)
            for coordinate in law
        )
        values = np.empty((len(entries), states))
        sizes = np.ones(len(laws)) if sizes is None else sizes
        for place, (_, coordinate, column) in zip(values, entries, strict=True):
            np.multiply(laws[column][coordinate], sizes[column], out=place)
        _, coordinates, columns = np.array(entries, int).reshape(-1, 3).T
        return cls(len(laws), values, coordinates, columns, jacobian, state)

    def select_columns(self, kept: np.ndarray) -> FactoredSensitivities:
        """The same of some of the columns, ndarray of bool (K,), which are numbered
        anew."""
        mine = kept[self.column]
        number = np.cumsum(kept) - 1
        entries = self.values[mine], self.coordinate[mine], number[self.column[mine]]
        return FactoredSensitivities(
            int(kept.sum()), *entries, self.jacobian, self.state
        )

    def at(self, seen: np.ndarray) -> FactoredSensitivities:
        """The same of some of the observations, ndarray of bool (M,), whose states are
        numbered anew."""
        states, state = np.unique(self.state[seen], return_inverse=True)
        return replace(
            self,
            values=self.values[:, states],
            jacobian=self.jacobian[seen],
            state=state,
        )

    @cached_property
    def spans(self) -> list[tuple[int, slice]]:
        """Coordinates that are displaced, and the entries of each."""
        first = np.flatnonzero(np.diff(self.coordinate, prepend=-1)).tolist()
        return [
            (int(self.coordinate[a]), slice(a, b))
            for a, b in pairwise([*first, len(self.coordinate)])
        ]

    @cached_property
    def _fold(self) -> csr_array:
        """Ones where an entry is of a column, sparse (K, E)."""
        entries = len(self.column)
        return csr_array(
            (np.ones(entries), (self.column, np.arange(entries))),
            (self.columns, entries),
        )

    def _products(
        self, right: np.ndarray | None = None
    ) -> Iterator[tuple[slice, np.ndarray]]:
        """J' times some rows (M, rows, q), or times J itself, summed over each state,
        of some states at a time.

        Yields the states, and ndarray (S', C', q) for the coordinates that are
        displaced.
        """
        left = self.jacobian[..., [coordinate for coordinate, _ in self.spans]]
        right = left if right is None else right
        shape, states = (left.shape[2], right.shape[2]), self.values.shape[1]
        step = max(_AT_ONCE // max(shape[0] * shape[1], 1), 1)
        groups = batch_groups_by_size(self.state)
        for start in range(0, states, step):
            found = np.zeros((min(step, states - start), *shape))
            for each in groups:
                state = self.state[each[:, 0]] - start
                inside = (state >= 0) & (state < step)
                mine = each if inside.all() else each[inside]
                height = each.shape[1] * left.shape[1]
                rows, others = (
                    part[mine].reshape(len(mine), height, part.shape[2])
                    for part in (left, right)
                )
                found[state[inside]] = rows.transpose(0, 2, 1) @ others
            yield slice(start, start + step), found

    def gram(self) -> np.ndarray:
        """Products of the columns with each other, ndarray (K, K)."""
        place = np.repeat(
            np.arange(len(self.spans)),
            [span.stop - span.start for _, span in self.spans],
        )
        entries = np.zeros((len(self.values),) * 2)
        for states, products in self._products():
            values = self.values[:, states]
            pairs = np.ascontiguousarray(products.transpose(1, 2, 0))
            for number, (_, span) in enumerate(self.spans):
                # With coordinates from this one on, for the others are alike.
                rest = slice(span.start, None)
                entries[span, rest] += (
                    values[span] @ (values[rest] * pairs[number][place[rest]]).T
                )
        for _, span in self.spans:
            entries[span.stop :, span] = entries[span, span.stop :].T
        return self._fold @ (self._fold @ entries).T

    def times(self, right: np.ndarray) -> np.ndarray:
        """Products of the columns with other rows (M, rows, q), ndarray (K, q)."""
        found = np.zeros((len(self.values), right.shape[2]))
        for states, products in self._products(right):
            for number, (_, span) in enumerate(self.spans):
                found[span] += self.values[span, states] @ products[:, number]
        return self._fold @ found

    def multiply_by_pose(self, right: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Products of the columns with other rows (M, rows, n), of the measurements of
        each pose, ndarray (G, n, K).

        `pose` (M,) of int: 0 .. G-1; all measurements of a state are of one pose.
        """
        shape = int(pose.max()) + 1, right.shape[2]
        of_state = np.zeros(self.values.shape[1], int)
        of_state[self.state] = pose
        found = np.zeros((len(self.values), *shape))
        for states, products in self._products(right):
            for members in batch_groups_by_size(of_state[states]):
                at = of_state[states][members[:, 0]]
                for number, (_, span) in enumerate(self.spans):
                    some = self.values[span, states][:, members].transpose(1, 0, 2)
                    found[span, at] += (some @ products[members, number]).transpose(
                        1, 0, 2
                    )
        folded = self._fold @ found.reshape(len(found), shape[0] * shape[1])
        return np.ascontiguousarray(folded.T).reshape(*shape, self.columns)

    def dense(self) -> np.ndarray:
        """The columns themselves, ndarray (M, rows, K); the observations of each lie
        side by side."""
        jacobian = self.jacobian.transpose(2, 1, 0)
        found, made = (
            np.zeros((columns, jacobian.shape[1], len(self.state)))
            for columns in (self.columns, 1)
        )
        single = np.array_equal(self.state, np.arange(self.values.shape[1]))
        for coordinate, column, values in zip(
            self.coordinate, self.column, self.values, strict=True
        ):
            found[column] += np.multiply(
                jacobian[coordinate],
                values if single else values[self.state],
                out=made[0],
            )
        return found.transpose(2, 1, 0)


@dataclass(frozen=True)
class LinearModel:
    """A model about an estimate, for M observations.

    `residual` (M, rows): measured less predicted, base axes, m and rad. `columns`:
    sensitivities to the P `parameters`; to them the place of a target that is fitted is
    another few coordinates, which move no other target. `coordinates` (S, C) of the
    sites, `conditions`: where the robot has yielded to, by this estimate.
    """

    residual: np.ndarray
    columns: FactoredSensitivities
    coordinates: np.ndarray
    conditions: Conditions

    @property
    def coordinate_jacobian(self) -> np.ndarray:
        """Of each target with respect to the coordinates of the sites, ndarray (M,
        rows, C)."""
        return self.columns.jacobian[..., : self.conditions.sites.chain.coordinates]

    @property
    def joint_jacobian(self) -> np.ndarray:
        """Of each target with respect to the joints, ndarray (M, rows, n)."""
        return self.columns.jacobian[..., : self.conditions.sites.joints]

    @cached_property
    def sensitivities(self) -> np.ndarray:
        """With respect to `parameters`, ndarray (M, rows, P)."""
        return self.columns.dense()


def linearize(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> LinearModel:
    """Residuals of a model and their sensitivities; arguments as of `predict`.

    Sensitivities are analytic, but for shapes (central differences) and for what
    springs do by way of other effects (forward differences).
    """
    around = update_springs_and_masses(model, estimate, conditions)
    states = observations.states
    found = linearize_coordinates(model, estimate, observations, around)
    laws = []
    for session in estimate.sessions if model.fitted_frames else ():
        in_session = (states.session == session).astype(float)
        laws += [{coordinate: in_session} for coordinate in model.sites.base]
    placed = range(model.sites.chain.coordinates, found.columns.jacobian.shape[2])
    laws += [{coordinate: np.ones(len(states))} for coordinate in placed]
    for effect, values, shapes in zip(
        model.effects, estimate.coefficients, estimate.shapes, strict=True
    ):
        laws += (
            _spring_laws(effect, model, estimate, around)
            if effect.effect in LOAD_EFFECTS
            else evaluate_basis_functions(effect, shapes, around)
        )
        laws += _shape_laws(effect, values, shapes, around)
    return replace(
        found,
        columns=FactoredSensitivities.of(
            laws, found.columns.jacobian, observations.state, len(states)
        ),
    )


def linearize_coordinates(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> LinearModel:
    """The same without sensitivities to parameters: no columns beside the Jacobian."""
    around = update_springs_and_masses(model, estimate, conditions)
    coordinates = compute_displaced_coordinates(model, estimate, around)
    count = len(observations)
    rows = model.rows
    chain = model.sites.chain
    points = locate_targets(model, estimate)
    placed = [
        (index, part)
        for index, parts in model.fitted_target_components
        for part in range(parts.start, parts.stop, 3)
    ]
    moved = motion(chain, coordinates, (*model.sites.followed, *points))
    position = np.empty((count, 3))
    rotation = np.empty((count, 3, 3))
    # Component first, so that every effect's arithmetic runs along the observations.
    jacobian = np.zeros((rows, chain.coordinates + 3 * len(placed), count))
    for index, point in enumerate(points):
        seen = np.flatnonzero(observations.target == index)
        # Where each state is seen once there is nothing to gather.
        once = np.array_equal(seen, observations.state) and len(seen) == len(
            coordinates
        )
        state = slice(None) if once else observations.state[seen]
        number = len(model.sites.followed) + index
        at = moved.position[number][:, state]
        position[seen] = at.T
        rotation[seen] = np.moveaxis(moved.rotation[number][..., state], -1, 0)
        jacobian[:, : chain.coordinates, seen] = moved.jacobian(
            point.after, at, rows, state
        )
    residual = subtract_prediction(
        estimate,
        observations,
        position,
        rotation @ estimate.target_rotation[observations.target],
    )
    # A target's shift along the axes of its measuring point and, for poses, its turn
    # about them, where it is seen.
    for first, (index, part) in zip(
        range(chain.coordinates, jacobian.shape[1], 3), placed, strict=True
    ):
        seen = np.flatnonzero(observations.target == index)
        jacobian[part : part + 3, first : first + 3, seen] = rotation[seen].transpose(
            1, 2, 0
        )
    columns = FactoredSensitivities.of(
        [], np.moveaxis(jacobian, -1, 0), observations.state, len(observations.states)
    )
    return LinearModel(residual, columns, coordinates, replace(around, motion=moved))


def compute_effect_sensitivities(
    effects: Iterable[tuple[Law, Iterable[float]]],
    around: Conditions,
    jacobian: np.ndarray,
    state: np.ndarray,
    sizes: np.ndarray | None = None,
) -> np.ndarray:
    """Sensitivities (M, rows, D) to the parameters of what displaces linearly, with its
    shapes, by a `coordinate_jacobian`, times some sizes (D,)."""
    laws = [
        law for displacement, shapes in effects for law in displacement(around, *shapes)
    ]
    return FactoredSensitivities.of(
        laws, jacobian, state, len(around.joint_angles), sizes
    ).dense()


def _shape_laws(
    effect: Candidate, values: np.ndarray, shapes: np.ndarray, conditions: Conditions
) -> Iterator[dict[int, np.ndarray]]:
    for number, shape in enumerate(effect.shapes):
        if shape.tried > 1:
            # A law that changes in jumps has no slope: a search finds its place, and a
            # fit that took the jump of a row within a step for one would go to and fro.
            yield {}
            continue
        step = _SHAPE_STEP * max(abs(shapes[number]), shape.lowest, 0.1 * shape.highest)
        off = step * (np.arange(len(shapes)) == number)
        above, below = (
            sum_displacements([(effect, values, at)], conditions)
            for at in (shapes + off, shapes - off)
        )
        yield {
            c: (above.get(c, 0.0) - below.get(c, 0.0)) / (2 * step)
            for c in {*above, *below}
        }


def _spring_laws(
    spring: Candidate, model: Model, estimate: Estimate, around: Conditions
) -> list[dict[int, np.ndarray]]:
    """Displacements per unit of compliances or of errors of masses, with all that they
    do by way of other effects.

    Compliances turn other loads into angles; errors of masses are part of the load that
    other effects go with.
    """
    laws = spring.displacement(around)
    springs = spring.effect == "joint_compliance"
    others = [
        found
        for found in zip(
            model.effects, estimate.coefficients, estimate.shapes, strict=True
        )
        if (
            found[0].family in ("gravity", "load")
            if springs
            else "load" in found[0].needs and found[0].effect not in LOAD_EFFECTS
        )
    ]
    if not others:
        return laws
    present = [sum_displacements([other], around) for other in others]
    place = around.motion.place
    coordinates = sorted(
        {coordinate for each in present for coordinate in each},
        key=lambda coordinate: place[coordinate],
    )
    steps = np.array(
        [_SPRING_STEP * parameter.plausible for parameter in spring.parameters]
    )
    if springs:
        every = {*coordinates}
        values = get_joint_compliances(model, estimate)
        corrections = get_mass_corrections(model, estimate)
        sprung: Iterable[Any] = (
            (every, with_springs(around, values + row, corrections))
            for row in np.diag(steps)
        )
    else:
        sprung = _with_each_correction(around, coordinates, steps)
    for law, step, (loaded, changed) in zip(laws, steps, sprung, strict=True):
        for other, before in zip(others, present, strict=True):
            moved = (
                {} if loaded.isdisjoint(before) else sum_displacements([other], changed)
            )
            for coordinate, by in moved.items():
                by -= before[coordinate]
                if by.any():
                    by /= step
                    law[coordinate] = (
                        np.add(law[coordinate], by, out=by) if coordinate in law else by
                    )
    return laws


def _with_each_correction(
    around: Conditions, coordinates: list[int], steps: np.ndarray
) -> Iterator[Any]:
    """Conditions with one error of a mass after the other changed by a step, behind the
    set of coordinates that this loads."""
    present = around.total.T
    total = around.total.T.copy()
    for sizes, forces in zip(
        steps.reshape(-1, MASS_PARAMETERS),
        around.gravity_of_corrections(coordinates),
        strict=True,
    ):
        loaded = coordinates[: forces.shape[1]]
        for step, per_unit in zip(sizes, forces, strict=True):
            total[loaded] = present[loaded] + step * per_unit
            yield {*loaded}, with_total(around, total.T)
        total[loaded] = present[loaded]
