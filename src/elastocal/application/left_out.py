"""Errors at given poses by effects of a fit that no command can correct.

A command states neither the side from which a joint is approached nor the time. So each
pose has several possible errors: those of all sides, and of all times at which the
campaign was measured. They differ from pose to pose, since play of a joint moves the
end effector by its half width times the Jacobian at that pose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import hadamard

from elastocal.application.calibrated import (
    build_observations,
    fill_from_blocks,
    move_to_end_effector,
    split_into_chunks,
    zero_coefficients,
)
from elastocal.application.frames import PLACEMENT_PARAMETERS, compute_placement_columns
from elastocal.fitting.covariance import factor_covariance
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    compute_displaced_coordinates,
    evaluate_conditions,
    list_parameters,
)
from elastocal.mechanics.kinematics import compute_pose_differences, compute_poses
from elastocal.residual_model.selection import is_commanded

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.application.frames import Scope
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import States

# Fewest conditions that are tried at a pose; times between them change smoothly.
_MIN_CONDITIONS = 8


@dataclass(frozen=True)
class LeftOutEffects:
    """Effects of a fit that no command contains, as they move the end effector.

    Attributes
    ----------
    model, estimate : fit with all its effects, whose only target is the end effector's
        measuring point.
    covariance_factor : (L, L) factor of the covariance of their parameters.
    states : states of the campaign, which tell the conditions that no command states.
    at_end : whether only the time at the end of the campaign counts, because a declared
        base is not placed again before the robot is used.
    absorbed : (12, 1 + L) placement that compensates their displacement over the
        campaign's poses, and that by their uncertainty, best.
    """

    model: Model
    estimate: Estimate
    covariance_factor: np.ndarray
    states: States
    at_end: bool
    absorbed: np.ndarray

    @classmethod
    def from_fit(
        cls, model: Model, estimate: Estimate, covariance: np.ndarray, states: States
    ) -> LeftOutEffects:
        """Select the effects of a fit, with the covariance (P, P) of all its parameters
        and the states of its campaign; no placement compensates them yet."""
        if model.row_span is None and states.row is not None:
            # Drift counts from the first to the last row of the campaign, also if it is
            # evaluated at other states.
            row_span = (int(states.row.min()), int(states.row.max()))
            model = replace(model, row_span=row_span)
        end_model, end_estimate = move_to_end_effector(model, estimate)
        rows = _find_parameters(model, estimate)
        factor = factor_covariance(covariance[np.ix_(rows, rows)])
        absorbed = np.zeros((PLACEMENT_PARAMETERS, 1 + factor.shape[1]))
        states = replace(states, session=np.zeros_like(states.session))
        at_end = not model.fitted_frames
        return cls(end_model, end_estimate, factor, states, at_end, absorbed)

    def compute_fields(self, states: States) -> np.ndarray:
        """Compute the displacements of the end effector in states whose conditions are
        known.

        Returns (S, 6, 1 + L): the displacement and rotation by all effects together,
        then those by a standard deviation along each axis of their uncertainty, m and
        rad, base axes.
        """
        shape = (len(states), 6, 1 + self.covariance_factor.shape[1])
        return fill_from_blocks(shape, self.generate_fields(states))

    def generate_fields(self, states: States) -> Iterator[np.ndarray]:
        """Generate the result of `compute_fields` in blocks of consecutive states, so
        that not all of them are in memory at once."""
        for chunk in split_into_chunks(len(states)):
            yield self._compute_fields_of_chunk(states.select(chunk))

    def _compute_fields_of_chunk(self, states: States) -> np.ndarray:
        model = self.model
        left_out = {
            number for number, effect in enumerate(model.effects) if is_left_out(effect)
        }
        conditions = evaluate_conditions(model, self.estimate, states)
        with_effects = self._compute_end_poses(self.estimate, conditions)
        without = zero_coefficients(self.estimate, left_out)
        without_effects = self._compute_end_poses(
            without, evaluate_conditions(model, without, states)
        )
        displacement = compute_pose_differences(*with_effects, *without_effects)
        sensitivities = linearize(
            model, self.estimate, build_observations(states), conditions
        ).sensitivities[..., _find_parameters(model, self.estimate)]
        spread = sensitivities @ self.covariance_factor
        return np.concatenate([displacement[..., None], spread], axis=2)

    def _compute_end_poses(
        self, estimate: Estimate, conditions: Conditions
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute position (S, 3), m, and rotation (S, 3, 3) of the end effector."""
        chain = self.model.sites.chain
        coordinates = compute_displaced_coordinates(self.model, estimate, conditions)
        return compute_poses(chain, coordinates, chain.end_effector)

    def predict_branches(
        self, scope: Scope, states: States, position: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Predict the possible position errors at N poses.

        Parameters
        ----------
        scope : gives the point about which the base rotates.
        states : N commanded states.
        position, rotation : (N, 3), m, and (N, 3, 3) poses of the end effector there.

        Returns
        -------
        (N, K, 3) errors under K conditions, m, and (N, 3, 3) covariance of each by the
        uncertainty of the effects.
        """
        conditions = self._choose_conditions()
        count = len(conditions)
        repeated = np.repeat(np.arange(len(states)), count)
        condition = np.tile(np.arange(count), len(states))
        fields = self.compute_fields(
            replace(
                conditions.select(condition),
                pose=repeated,
                joint_angles=states.joint_angles[repeated],
                wrench=states.wrench[repeated],
            )
        )
        columns = compute_placement_columns(scope, position, rotation)[:, :3]
        fields = fields[:, :3].reshape(len(states), count, 3, -1)
        errors = fields - (columns @ self.absorbed)[:, None]
        spread = errors[..., 1:]
        covariance = (spread @ spread.transpose(0, 1, 3, 2)).mean(axis=1)
        return errors[..., 0], covariance

    def _choose_conditions(self) -> States:
        """Choose times that are spread over the campaign, with joints approached from
        both sides.

        The sides are columns of a Hadamard matrix, so that no joint's side goes with
        another's [1]_.

        References
        ----------
        .. [1] Plackett and Burman, The design of optimum multifactorial experiments,
           Biometrika 33, 1946.
        """
        joints = self.states.joint_angles.shape[1]
        count = max(_MIN_CONDITIONS, 2 ** int(joints).bit_length())
        spread = np.linspace(0, len(self.states) - 1, count).round().astype(int)
        order = np.arange(len(self.states))
        if self.states.row is not None:
            order = np.argsort(self.states.row)
        chosen = order[spread]
        if self.at_end:
            chosen = np.full(count, order[-1])
        sides = hadamard(count)[:, 1 : joints + 1].astype(float)
        return replace(self.states.select(chosen), approach=sides)


def is_left_out(effect: Candidate) -> bool:
    """Whether an effect that no command corrects also acts in the use of the robot. An
    error of declared values of the campaign's own set-up does not."""
    return not is_commanded(effect) and effect.family != "declared"


def _find_parameters(model: Model, estimate: Estimate) -> np.ndarray:
    """Find the parameters of the effects that no command contains, (P,) bool."""
    keys = {effect.key for effect in model.effects if is_left_out(effect)}
    return np.array([owner in keys for owner, _ in list_parameters(model, estimate)])
