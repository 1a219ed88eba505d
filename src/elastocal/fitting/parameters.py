"""Everything that a model leaves open as one vector of parameters: their names, ranges and values, and a step of them all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.effects.protocol import Parameter, moved_and_turned
from elastocal.fitting.model import Estimate

if TYPE_CHECKING:
    from elastocal.fitting.model import Model

# Frames and targets may be anywhere in a workshop.
_ANYWHERE_M, _ANYWHERE_RAD = 1.0, 1.0


def parameters(model: Model, estimate: Estimate) -> list[tuple[str, Parameter]]:
    """Everything that is fitted, in the order of the sensitivities.

    Returns (str, Parameter): what it belongs to ("frame 0", "target A", the key of an effect) and the parameter.
    """
    found, placed = [], moved_and_turned(_ANYWHERE_M, _ANYWHERE_RAD)
    if model.fitted_frames:
        found += [(f"frame {session}", parameter) for session in estimate.sessions for parameter in placed]
    for number, parts in model.fitted_parts:
        found += [(f"target {model.targets[number].name}", parameter) for parameter in placed[parts]]
    for effect in model.effects:
        found += [(effect.key, parameter) for parameter in effect.parameters]
        found += [(effect.key, Parameter(s.name, s.unit, s.highest - s.lowest)) for s in effect.shapes]
    return found


def nonlinear_parameters(model: Model, estimate: Estimate) -> np.ndarray:
    """Which of the `parameters` are shapes, which alone have limits, ndarray of bool (P,)."""
    return np.isfinite(limits(model, estimate)).all(axis=1)


def limits(model: Model, estimate: Estimate) -> np.ndarray:
    """Lowest and highest value of each of the `parameters`, ndarray (P, 2): the ranges of shapes, infinite for all others."""
    ranges = {(effect.key, shape.name): (shape.lowest, shape.highest) for effect in model.effects for shape in effect.shapes}
    listed = [ranges.get((owner, p.name), (-np.inf, np.inf)) for owner, p in parameters(model, estimate)]
    return np.array(listed).reshape(-1, 2)


def parameter_values(model: Model, estimate: Estimate) -> np.ndarray:
    """Present values of all that is fitted, in the order of `parameters`.

    Frames and targets are fitted by steps from where they are and count as zero.

    Returns (P,).
    """
    owned = [owner.startswith(("frame ", "target ")) for owner, _ in parameters(model, estimate)]
    effects = [part for pair in zip(estimate.coefficients, estimate.shapes, strict=True) for part in pair]
    return np.concatenate([np.zeros(sum(owned)), *effects])


def stepped(model: Model, estimate: Estimate, step: np.ndarray) -> Estimate:
    """An estimate after a step of all parameters, in the order of `parameters`.

    `step` (P,).
    """
    left = list(step)

    def take(count: int) -> np.ndarray:
        taken, left[:] = np.array(left[:count]), left[count:]
        return taken

    frame_rotation, frame_position = estimate.frame_rotation.copy(), estimate.frame_position.copy()
    if model.fitted_frames:
        for number in range(len(estimate.sessions)):
            shift, turn = take(3), take(3)
            frame_position[number] += frame_rotation[number] @ shift
            frame_rotation[number] = frame_rotation[number] @ Rotation.from_rotvec(turn).as_matrix()
    target_offset, target_rotation = estimate.target_offset.copy(), estimate.target_rotation.copy()
    for number, parts in model.fitted_parts:
        moved = np.zeros(6)
        moved[parts] = take(parts.stop - parts.start)
        target_offset[number] += moved[:3]
        target_rotation[number] = Rotation.from_rotvec(moved[3:]).as_matrix() @ target_rotation[number]
    coefficients, shapes = [], []
    for effect, values, shape in zip(model.effects, estimate.coefficients, estimate.shapes, strict=True):
        coefficients.append(values + take(len(values)))
        limits = np.array([(shape.lowest, shape.highest) for shape in effect.shapes]).reshape(-1, 2)
        shapes.append(np.clip(shape + take(len(shape)), *limits.T))
    return Estimate(
        estimate.sessions, frame_rotation, frame_position, target_offset, target_rotation, tuple(coefficients), tuple(shapes)
    )
