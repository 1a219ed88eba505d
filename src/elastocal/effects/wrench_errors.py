"""What errors of the load have in common: a changed wrench, which the joint compliances turn into angles.

theta = diag(c) J^T dw, with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the loaded
point and dw the error of the wrench (N, N m): J^T dw are its torques by the principle of virtual work [1].

[1] B. Siciliano, L. Sciavicco, L. Villani and G. Oriolo, Robotics: Modelling, Planning and Control, Springer, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import LOADED_JOINTS, Candidate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements, Parameter


@dataclass(frozen=True)
class Axis:
    """A direction, which may differ from state to state: ndarray (S, 3)."""

    direction: np.ndarray

    def turn(self, wrench: np.ndarray) -> np.ndarray:
        """Change of a wrench (S, 6) when its force is turned by one radian about the axis."""
        return _wrench(np.cross(self.direction, wrench[:, :3]), 0.0)

    def push(self, wrench: np.ndarray) -> np.ndarray:
        """A force of 1 N along the axis wherever there is a load."""
        return _wrench(self.direction * wrench.any(axis=1, keepdims=True), 0.0)

    def shift(self, wrench: np.ndarray) -> np.ndarray:
        """Change of a wrench when its force acts one metre further along the axis."""
        return _wrench(0.0, np.cross(self.direction, wrench[:, :3]))


# Share of the moments that may be left unexplained where a pull acts at one place.
_OF_ONE_PLACE = 0.01


def at_flange_and_in_pull(
    name: str, family: str, parameters: tuple[Parameter, ...], change: Callable[[Axis, np.ndarray], np.ndarray]
) -> list[Candidate]:
    """Candidates for an error of the force, with the moments right, or with those that the wrong force makes at its lever.

    Between flange and tool a sensor measures forces and moments; in the line of a pull, the force alone.

    `name`, `family`, `parameters`, `change`: as of `base_and_flange`.
    """

    def in_pull(conditions: Conditions, axes: Sequence[Axis]) -> list[np.ndarray]:
        wrench = conditions.wrench
        lever = lever_of_pull(wrench, conditions.end_rotation)
        forces = [change(axis, wrench)[:, :3] for axis in axes]
        return [np.concatenate([force, np.cross(lever, force)], axis=1) for force in forces]

    return [
        *base_and_flange(name, family, parameters, change),
        *_in_both_frames(name, family, parameters, in_pull, " in the pull"),
    ]


def lever_of_pull(wrench: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Where a pull acts: the one place, in the flange or in base axes, about which forces make the moments (least squares).

    `wrench` (S, 6): at a point of the flange, base axes. `rotation` (S, 3, 3): of the flange. Returns (S, 3): from the point of
    the wrench, m, base axes; zero where no place explains the moments.
    """
    for axes in (rotation, np.broadcast_to(np.eye(3), rotation.shape)):
        force, moment = (np.einsum("sji,sj->si", axes, part) for part in (wrench[:, :3], wrench[:, 3:]))
        # r x F = -[F] r.
        rows = -np.cross(force[:, :, None], np.eye(3)[None], axis=1).reshape(-1, 3)
        place = np.linalg.lstsq(rows, moment.ravel(), rcond=None)[0]
        if np.linalg.norm(rows @ place - moment.ravel()) <= _OF_ONE_PLACE * np.linalg.norm(moment):
            return axes @ place
    return np.zeros((len(wrench), 3))


def base_and_flange(
    name: str, family: str, parameters: tuple[Parameter, ...], change: Callable[[Axis, np.ndarray], np.ndarray]
) -> list[Candidate]:
    """Candidates for an error of the load that is fixed in base axes or turns with the flange.

    `parameters`: for x, y and z. `change`: ``change(axis, wrench)`` is the change (S, 6) of a wrench (S, 6) per unit of the
    parameter of an `Axis`.
    """

    def changes(conditions: Conditions, axes: Sequence[Axis]) -> list[np.ndarray]:
        return [change(axis, conditions.wrench) for axis in axes]

    return _in_both_frames(name, family, parameters, changes, "")


def _in_both_frames(
    name: str,
    family: str,
    parameters: tuple[Parameter, ...],
    changes: Callable[[Conditions, Sequence[Axis]], list[np.ndarray]],
    how: str,
) -> list[Candidate]:
    """Candidates whose wrench changes by each of ``changes(conditions, axes)``; `how` follows the axes in their names."""

    def in_base(conditions: Conditions) -> Displacements:
        axes = [np.broadcast_to(axis, conditions.wrench[:, :3].shape) for axis in np.eye(3)]
        return _deflections(conditions, axes)

    def in_flange(conditions: Conditions) -> Displacements:
        return _deflections(conditions, np.moveaxis(conditions.end_rotation, -1, 0))

    def _deflections(conditions: Conditions, axes: Iterable[np.ndarray]) -> Displacements:
        changed = changes(conditions, [Axis(axis) for axis in axes])
        turned = [conditions.joint_deflections(wrench) for wrench in changed]
        return [dict(enumerate(angles.T)) for angles in turned]

    return [
        Candidate(name, family, (), frame + how, parameters, law, LOADED_JOINTS)
        for frame, law in (("base axes", in_base), ("flange axes", in_flange))
    ]


def _wrench(force: np.ndarray | float, moment: np.ndarray | float) -> np.ndarray:
    shape = np.shape(force) or np.shape(moment)
    return np.concatenate([np.broadcast_to(force, shape), np.broadcast_to(moment, shape)], axis=1)
