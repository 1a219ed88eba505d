"""Sensitivities: Jacobian of the chain times coordinate displacement per parameter.

An effect displaces coordinates of the sites by an amount that depends on the state. How
far a coordinate moves a target depends on the observation. In row r of state s, a
column of sensitivities is the sum over coordinates c of J[r, c] f_c(s). Products of two
columns are therefore sums over states of f_c(s) g_d(s) H_cd(s), where H = J'J of the
rows of one state. They have one term a state; products of the dense columns have one
for each component of each target of the state.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from elastocal.effects.conditions import (
    MASS_PARAMETERS,
    Conditions,
    replace_motion,
    replace_springs,
    replace_total_load,
)
from elastocal.fitting.model import (
    LOAD_EFFECTS,
    compute_displaced_coordinates,
    evaluate_basis_functions,
    get_joint_compliances,
    get_mass_corrections,
    locate_targets,
    predict_channels,
    subtract_prediction,
    sum_displacements,
    update_springs_and_masses,
)
from elastocal.fitting.observations import batch_groups_by_size
from elastocal.mechanics.kinematics import compute_motion, form_cross_matrices

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from elastocal.effects.protocol import Candidate, Law
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

    # For each parameter, the displacement (S,) of each coordinate that it displaces.
    Basis = Sequence[Mapping[int, np.ndarray]]

# Upper bound on the products by state that are in memory at once.
_AT_ONCE = 1_500_000
# Relative step of the central difference in a shape parameter, and step of the forward
# difference in a compliance or mass, in plausible sizes. Basis functions of gears are
# nearly linear over such a step.
_SHAPE_STEP = 1e-4
_LOAD_STEP = 1e-4
# Families of effects that turn the joints by a load of their own. They act through the
# compliances, and do not depend on the load by the masses.
_OWN_LOAD = ("gravity", "load")
# The step in a shape is no smaller than that of this share of its highest value.
_SHAPE_STEP_FLOOR = 0.1


@dataclass(frozen=True)
class FactoredSensitivities:
    """K columns of sensitivities in two factors: displacements and a Jacobian.

    An entry is the displacement of one coordinate by one column. Entries of a
    coordinate are consecutive; coordinates with the most entries come first.

    Attributes
    ----------
    columns : int, K
    values : (E, S) array, displacement of each entry in each state
    coordinate, column : (E,) int arrays, of each entry
    jacobian : (M, rows, C) array
        Of each observation with respect to the coordinates, whitened or not.
    state : (M,) int array, state of each observation
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
        basis: Basis,
        jacobian: np.ndarray,
        state: np.ndarray,
        states: int,
        sizes: np.ndarray | None = None,
    ) -> FactoredSensitivities:
        """Gather the basis functions of each column, (S,) arrays by coordinate.

        Parameters
        ----------
        basis : sequence of mappings, one for each column
        jacobian, state : as attributes
        states : int, S
        sizes : (K,) array, optional
            Factor of each column.
        """
        count = Counter(coordinate for functions in basis for coordinate in functions)
        entries = sorted(
            (-count[coordinate], coordinate, column)
            for column, functions in enumerate(basis)
            for coordinate in functions
        )
        values = np.empty((len(entries), states))
        sizes = np.ones(len(basis)) if sizes is None else sizes
        for row, (_, coordinate, column) in zip(values, entries, strict=True):
            np.multiply(basis[column][coordinate], sizes[column], out=row)
        _, coordinates, columns = np.array(entries, int).reshape(-1, 3).T
        return cls(len(basis), values, coordinates, columns, jacobian, state)

    def select_columns(self, kept: np.ndarray) -> FactoredSensitivities:
        """Select columns, given as (K,) bool array, and renumber them."""
        kept_entries = kept[self.column]
        new_number = np.cumsum(kept) - 1
        return replace(
            self,
            columns=int(kept.sum()),
            values=self.values[kept_entries],
            coordinate=self.coordinate[kept_entries],
            column=new_number[self.column[kept_entries]],
        )

    def at(self, chosen: np.ndarray) -> FactoredSensitivities:
        """Select observations, given as (M,) bool array, and renumber their states."""
        states, state = np.unique(self.state[chosen], return_inverse=True)
        return replace(
            self,
            values=self.values[:, states],
            jacobian=self.jacobian[chosen],
            state=state,
        )

    @cached_property
    def spans(self) -> list[tuple[int, slice]]:
        """Each displaced coordinate with the slice of its entries."""
        first = np.flatnonzero(np.diff(self.coordinate, prepend=-1)).tolist()
        return [
            (int(self.coordinate[start]), slice(start, stop))
            for start, stop in pairwise([*first, len(self.coordinate)])
        ]

    @cached_property
    def _fold(self) -> csr_array:
        """Sparse (K, E) matrix that sums the entries of each column."""
        entries = len(self.column)
        return csr_array(
            (np.ones(entries), (self.column, np.arange(entries))),
            (self.columns, entries),
        )

    def _iterate_products(
        self, right: np.ndarray | None = None
    ) -> Iterator[tuple[slice, np.ndarray]]:
        """Compute J' times rows (M, rows, q), or times J itself, summed over each state.

        Yields a slice of states, and the products (S', C', q) for the displaced
        coordinates.
        """
        left = self.jacobian[..., [coordinate for coordinate, _ in self.spans]]
        right = left if right is None else right
        shape = (left.shape[2], right.shape[2])
        states = self.values.shape[1]
        step = max(_AT_ONCE // max(shape[0] * shape[1], 1), 1)
        groups = batch_groups_by_size(self.state)
        for start in range(0, states, step):
            products = np.zeros((min(step, states - start), *shape))
            for group in groups:
                state = self.state[group[:, 0]] - start
                inside = (state >= 0) & (state < step)
                members = group if inside.all() else group[inside]
                stacked = (len(members), group.shape[1] * left.shape[1])
                left_rows = left[members].reshape(*stacked, shape[0])
                right_rows = right[members].reshape(*stacked, shape[1])
                products[state[inside]] = left_rows.transpose(0, 2, 1) @ right_rows
            yield slice(start, start + step), products

    def gram(self) -> np.ndarray:
        """Products of the columns with each other, (K, K) array."""
        sizes = [span.stop - span.start for _, span in self.spans]
        position = np.repeat(np.arange(len(self.spans)), sizes)
        entries = np.zeros((len(self.values),) * 2)
        for states, products in self._iterate_products():
            values = self.values[:, states]
            pairs = np.ascontiguousarray(products.transpose(1, 2, 0))
            for number, (_, span) in enumerate(self.spans):
                # The matrix is symmetric, so compute it from this coordinate on.
                upper = slice(span.start, None)
                weighted = values[upper] * pairs[number][position[upper]]
                entries[span, upper] += values[span] @ weighted.T
        for _, span in self.spans:
            entries[span.stop :, span] = entries[span, span.stop :].T
        return self._fold @ (self._fold @ entries).T

    def times(self, right: np.ndarray) -> np.ndarray:
        """Products of the columns with rows (M, rows, q), (K, q) array."""
        entries = np.zeros((len(self.values), right.shape[2]))
        for states, products in self._iterate_products(right):
            for number, (_, span) in enumerate(self.spans):
                entries[span] += self.values[span, states] @ products[:, number]
        return self._fold @ entries

    def combine(self, coefficients: np.ndarray) -> np.ndarray:
        """Sum of the columns times their coefficients (K,), (M, rows) array, without
        the columns themselves."""
        weights = coefficients[self.column]
        combined = np.zeros(self.jacobian.shape[:2])
        for coordinate, span in self.spans:
            displacement = weights[span] @ self.values[span]
            combined += self.jacobian[..., coordinate] * displacement[self.state, None]
        return combined

    def multiply_by_pose(self, right: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Products of the columns with rows (M, rows, n), summed over each pose.

        `pose` (M,) holds numbers 0 .. G-1; all observations of a state belong to one
        pose. Returns a (G, n, K) array.
        """
        shape = (int(pose.max()) + 1, right.shape[2])
        pose_of_state = np.zeros(self.values.shape[1], int)
        pose_of_state[self.state] = pose
        entries = np.zeros((len(self.values), *shape))
        for states, products in self._iterate_products(right):
            for members in batch_groups_by_size(pose_of_state[states]):
                poses = pose_of_state[states][members[:, 0]]
                for number, (_, span) in enumerate(self.spans):
                    values = self.values[span, states][:, members].transpose(1, 0, 2)
                    by_pose = values @ products[members, number]
                    entries[span, poses] += by_pose.transpose(1, 0, 2)
        folded = self._fold @ entries.reshape(len(entries), shape[0] * shape[1])
        return np.ascontiguousarray(folded.T).reshape(*shape, self.columns)

    def dense(self) -> np.ndarray:
        """The columns as an (M, rows, K) array, contiguous along the observations."""
        jacobian = self.jacobian.transpose(2, 1, 0)
        shape = (jacobian.shape[1], len(self.state))
        columns = np.zeros((self.columns, *shape))
        product = np.zeros(shape)
        single = np.array_equal(self.state, np.arange(self.values.shape[1]))
        for coordinate, column, values in zip(
            self.coordinate, self.column, self.values, strict=True
        ):
            by_observation = values if single else values[self.state]
            columns[column] += np.multiply(
                jacobian[coordinate], by_observation, out=product
            )
        return columns.transpose(2, 1, 0)


@dataclass(frozen=True)
class LinearModel:
    """A model linearized about an estimate, for M observations.

    Attributes
    ----------
    residual : (M, rows) array
        Measured minus predicted, base axes, m and rad.
    columns : FactoredSensitivities
        With respect to the P parameters. The components of fitted targets and the
        unknowns of features are additional coordinates, each of which moves one target
        or one feature; turns of the axes of the residual come last, if there are any.
    coordinates : (S, C) array, displaced coordinates of the sites
    conditions : Conditions, at the displaced pose of this estimate
    """

    residual: np.ndarray
    columns: FactoredSensitivities
    coordinates: np.ndarray
    conditions: Conditions

    @property
    def coordinate_jacobian(self) -> np.ndarray:
        """Of each target with respect to the coordinates of the sites, (M, rows, C)."""
        return self.columns.jacobian[..., : self.conditions.sites.chain.coordinates]

    @property
    def joint_jacobian(self) -> np.ndarray:
        """Jacobian of each target with respect to the joints, (M, rows, n)."""
        return self.columns.jacobian[..., : self.conditions.sites.joints]

    @cached_property
    def sensitivities(self) -> np.ndarray:
        """With respect to the parameters, (M, rows, P)."""
        return self.columns.dense()


def linearize(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> LinearModel:
    """Linearize a model about an estimate; arguments are those of `model.predict`.

    Sensitivities are analytic, except for shapes (central differences) and for the
    influence of compliances and masses on other effects (forward differences).
    """
    conditions = update_springs_and_masses(model, estimate, conditions)
    by_coordinates = linearize_coordinates(model, estimate, observations, conditions)
    return _differentiate(model, estimate, observations, conditions, by_coordinates, {})


def linearize_residual(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> LinearModel:
    """Linearize a model and the axes of its residual; arguments as of `linearize`.

    Residuals are in base axes, which turn with the frame of their session. The errors
    of an instrument keep the axes of the session. Those of contacts are errors of the
    joints, which turn with the base: a residual r turns back by r x w if the frame
    turns by w. The frame turns the displacement d of the base as well, by w x d, whereas
    the coordinates of the base turn it about its displaced origin. Both matter where
    frames are hardly determined, such as by two sockets in each session.
    """
    conditions = update_springs_and_masses(model, estimate, conditions)
    by_coordinates = linearize_coordinates(model, estimate, observations, conditions)
    turns: dict[int, int] = {}
    if model.has_contact_vectors and model.has_frame_parameters:
        first = by_coordinates.columns.jacobian.shape[2]
        turns = dict(zip(model.sites.base[3:], range(first, first + 3), strict=True))
        by_coordinates = _append_turns(by_coordinates, model.sites.base[:3])
    return _differentiate(
        model, estimate, observations, conditions, by_coordinates, turns
    )


def _append_turns(
    by_coordinates: LinearModel, shift_coordinates: Sequence[int]
) -> LinearModel:
    """Append three coordinates that turn the axes of the residual; the coordinates that
    shift the base are given."""
    columns = by_coordinates.columns
    vectors = by_coordinates.residual.copy()
    displacement = by_coordinates.coordinates[:, shift_coordinates]
    vectors[:, :3] += displacement[columns.state]
    turned = -form_cross_matrices(vectors.reshape(-1, 3))
    # The result is contiguous along the observations, as what it extends.
    jacobian = np.concatenate(
        [
            np.moveaxis(columns.jacobian, 0, -1),
            np.moveaxis(turned.reshape(*vectors.shape, 3), 0, -1),
        ],
        axis=1,
    )
    extended = replace(columns, jacobian=np.moveaxis(jacobian, -1, 0))
    return replace(by_coordinates, columns=extended)


def _differentiate(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    conditions: Conditions,
    by_coordinates: LinearModel,
    turns: Mapping[int, int],
) -> LinearModel:
    """Linearize with respect to the parameters, from the linearization with respect to
    the coordinates.

    `turns` names, for coordinates that turn the base, the last coordinates, which turn
    the axes of the residual.
    """
    jacobian = by_coordinates.columns.jacobian
    states = observations.states
    basis: list[Mapping[int, np.ndarray]] = []
    if model.has_frame_parameters:
        for session in estimate.sessions:
            in_session = (states.session == session).astype(float)
            basis += _move_frame(model.sites.base, in_session, turns)
    unknown_coordinates = range(
        model.sites.chain.coordinates, jacobian.shape[2] - len(turns)
    )
    basis += [{coordinate: np.ones(len(states))} for coordinate in unknown_coordinates]
    basis += _move_effects(model, estimate, conditions)
    columns = FactoredSensitivities.of(basis, jacobian, observations.state, len(states))
    return replace(by_coordinates, columns=columns)


def _move_frame(
    base: Sequence[int], in_session: np.ndarray, turns: Mapping[int, int]
) -> Iterator[dict[int, np.ndarray]]:
    """Displacements by each component of the frame of one session; `turns` as of
    `_differentiate`."""
    for coordinate in base:
        functions = {coordinate: in_session}
        if coordinate in turns:
            functions[turns[coordinate]] = in_session
        yield functions


def _move_effects(
    model: Model, estimate: Estimate, conditions: Conditions
) -> Iterator[dict[int, np.ndarray]]:
    """Displacements by each linear parameter and each shape of the effects."""
    for effect, values, shapes in zip(
        model.effects, estimate.coefficients, estimate.shapes, strict=True
    ):
        if effect.effect in LOAD_EFFECTS:
            yield from _load_effect_basis(effect, model, estimate, conditions)
        else:
            yield from evaluate_basis_functions(effect, shapes, conditions)
        yield from _shape_derivatives(effect, values, shapes, conditions)


def linearize_coordinates(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> LinearModel:
    """Linearize with respect to the coordinates alone, without parameters.

    The result has a Jacobian and no columns. Arguments are those of `model.predict`.
    """
    conditions = update_springs_and_masses(model, estimate, conditions)
    coordinates = compute_displaced_coordinates(model, estimate, conditions)
    sites = model.sites
    points = locate_targets(model, estimate)
    moved = compute_motion(sites.chain, coordinates, (*sites.tracked_points, *points))
    position = np.empty((len(observations), 3))
    rotation = np.empty((len(observations), 3, 3))
    # The component comes first, so that the arithmetic of effects is contiguous along
    # the observations.
    jacobian = np.zeros(
        (
            6 if model.has_orientations else 3,
            sites.chain.coordinates + _count_target_coordinates(model),
            len(observations),
        )
    )
    for index, point in enumerate(points):
        members = np.flatnonzero(observations.target == index)
        state = observations.state[members]
        if len(members) == len(coordinates) and np.array_equal(members, state):
            # Each state has one observation, so there is nothing to gather.
            state = slice(None)  # type: ignore[assignment]
        followed = len(sites.tracked_points) + index
        point_position = moved.position[followed][:, state]
        position[members] = point_position.T
        rotation[members] = np.moveaxis(moved.rotation[followed][..., state], -1, 0)
        jacobian[:, : sites.chain.coordinates, members] = moved.jacobian(
            point.after, point_position, len(jacobian), state
        )
    _fill_target_jacobian(
        jacobian[:, sites.chain.coordinates :], model, observations, rotation
    )
    rotation = rotation @ estimate.target_rotation[observations.target]
    residual, jacobian = _read_targets(
        model,
        estimate,
        observations,
        (position, rotation),
        np.moveaxis(jacobian, -1, 0),
    )
    return LinearModel(
        residual,
        FactoredSensitivities.of([], jacobian, observations.state, len(coordinates)),
        coordinates,
        replace_motion(conditions, moved),
    )


def _read_targets(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    predicted: tuple[np.ndarray, np.ndarray],
    jacobian: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute residuals and Jacobian of the measurements from those of target poses.

    Parameters
    ----------
    model, estimate, observations : as in `linearize_coordinates`
    predicted : positions (M, 3), m, and rotations (M, 3, 3) of the targets, base axes
    jacobian : (M, 3 or 6, C) array, derivative of these poses in the coordinates

    Returns
    -------
    residual : (M, rows) array
    jacobian : (M, rows, C + K) array; the K fitted unknowns of features are additional
        coordinates
    """
    if model.measuring is None:
        residual = subtract_prediction(model, estimate, observations, *predicted)
        return residual, jacobian
    channels = predict_channels(model, estimate, observations, *predicted)
    by_pose = channels.by_pose[..., : jacobian.shape[1]] @ jacobian
    return channels.residual, np.concatenate([by_pose, channels.by_unknowns], axis=2)


def _count_target_coordinates(model: Model) -> int:
    """Count the fitted components of targets; each is an additional coordinate."""
    return sum(
        components.stop - components.start
        for _, components in model.fitted_target_components
    )


def _fill_target_jacobian(
    jacobian: np.ndarray,
    model: Model,
    observations: Observations,
    rotation: np.ndarray,
) -> None:
    """Fill a Jacobian (rows, coordinates, M) with respect to the fitted targets.

    A fitted target moves along and about the axes (M, 3, 3) of its measuring point.
    """
    start = 0
    for index, components in model.fitted_target_components:
        members = np.flatnonzero(observations.target == index)
        axes = rotation[members].transpose(1, 2, 0)
        for first in range(components.start, components.stop, 3):
            jacobian[first : first + 3, start : start + 3, members] = axes
            start += 3


def compute_effect_sensitivities(
    effects: Iterable[tuple[Law, Iterable[float]]],
    conditions: Conditions,
    jacobian: np.ndarray,
    state: np.ndarray,
    sizes: np.ndarray | None = None,
) -> np.ndarray:
    """Compute the sensitivities to the linear parameters of effects, (M, rows, D).

    Parameters
    ----------
    effects : iterable of pairs of a displacement function and its shapes
    conditions : Conditions of the states
    jacobian : (M, rows, C) array, see `LinearModel.coordinate_jacobian`
    state : (M,) int array
    sizes : (D,) array, optional
        Factor of each column.
    """
    basis: list[dict[int, np.ndarray]] = []
    for displacement, shapes in effects:
        basis += displacement(conditions, *shapes)
    states = len(conditions.joint_angles)
    return FactoredSensitivities.of(basis, jacobian, state, states, sizes).dense()


def _shape_derivatives(
    effect: Candidate, values: np.ndarray, shapes: np.ndarray, conditions: Conditions
) -> Iterator[dict[int, np.ndarray]]:
    """Derivatives of the displacements with respect to each shape of an effect."""
    for number, shape in enumerate(effect.shapes):
        if shape.tried > 1:
            # A basis function with jumps has no slope. A search finds its shape; a fit
            # would take the jump of a row within a step for a slope and oscillate.
            yield {}
            continue
        step = _SHAPE_STEP * max(
            abs(shapes[number]), shape.lowest, _SHAPE_STEP_FLOOR * shape.highest
        )
        offset = step * (np.arange(len(shapes)) == number)
        above = sum_displacements([(effect, values, shapes + offset)], conditions)
        below = sum_displacements([(effect, values, shapes - offset)], conditions)
        yield {
            coordinate: (above.get(coordinate, 0.0) - below.get(coordinate, 0.0))
            / (2 * step)
            for coordinate in {*above, *below}
        }


def _load_effect_basis(
    load_effect: Candidate, model: Model, estimate: Estimate, conditions: Conditions
) -> list[dict[int, np.ndarray]]:
    """Displacements per unit of compliances or of errors of masses, including their
    influence on other effects.

    Compliances turn the loads of other effects into angles. Errors of masses are part
    of the load on which other effects depend.
    """
    basis = load_effect.displacement(conditions)
    is_compliance = load_effect.effect == "joint_compliance"
    influenced = [
        (effect, values, shapes)
        for effect, values, shapes in zip(
            model.effects, estimate.coefficients, estimate.shapes, strict=True
        )
        if _depends_on(effect, is_compliance=is_compliance)
    ]
    if not influenced:
        return basis
    present = [sum_displacements([effect], conditions) for effect in influenced]
    coordinates = sorted(
        {coordinate for displacements in present for coordinate in displacements},
        key=conditions.motion.transform_index.__getitem__,
    )
    steps = np.array(
        [_LOAD_STEP * parameter.plausible for parameter in load_effect.parameters]
    )
    if is_compliance:
        changes = _step_each_compliance(model, estimate, conditions, steps)
    else:
        changes = _step_each_mass_correction(conditions, coordinates, steps)
    for functions, step, (loaded, changed) in zip(basis, steps, changes, strict=True):
        for effect, before in zip(influenced, present, strict=True):
            if loaded is not None and loaded.isdisjoint(before):
                continue
            after = sum_displacements([effect], changed)
            _add_slopes(functions, before, after, step)
    return basis


def _add_slopes(
    functions: dict[int, np.ndarray],
    before: dict[int, np.ndarray],
    after: dict[int, np.ndarray],
    step: float,
) -> None:
    """Add the forward difference of displacements to a basis function."""
    for coordinate, change in after.items():
        change -= before[coordinate]
        if change.any():
            change /= step
            if coordinate in functions:
                change += functions[coordinate]
            functions[coordinate] = change


def _depends_on(effect: Candidate, *, is_compliance: bool) -> bool:
    """Whether an effect acts through the compliances, or through the masses."""
    has_own_load = effect.family in _OWN_LOAD
    if is_compliance:
        return has_own_load
    is_loaded = "load" in effect.needs and effect.effect not in LOAD_EFFECTS
    return is_loaded and not has_own_load


def _step_each_compliance(
    model: Model, estimate: Estimate, conditions: Conditions, steps: np.ndarray
) -> Iterator[tuple[set[int] | None, Conditions]]:
    """Conditions with one compliance after the other changed by a step.

    They come with None, because a compliance may act on any coordinate.
    """
    compliances = get_joint_compliances(model, estimate)
    corrections = get_mass_corrections(model, estimate)
    for step in np.diag(steps):
        yield None, replace_springs(conditions, compliances + step, corrections)


def _step_each_mass_correction(
    conditions: Conditions, coordinates: list[int], steps: np.ndarray
) -> Iterator[tuple[set[int] | None, Conditions]]:
    """Conditions with one error of a mass after the other changed by a step.

    They come with the coordinates that this loads.
    """
    present = conditions.total.T
    total = conditions.total.T.copy()
    for mass_steps, forces in zip(
        steps.reshape(-1, MASS_PARAMETERS),
        conditions.gravity_of_corrections(coordinates),
        strict=True,
    ):
        loaded = coordinates[: forces.shape[1]]
        for step, per_unit in zip(mass_steps, forces, strict=True):
            total[loaded] = present[loaded] + step * per_unit
            yield {*loaded}, replace_total_load(conditions, total.T)
        total[loaded] = present[loaded]
