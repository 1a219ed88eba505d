"""Loads: what the force sensor shows is not what acts. A wrench that is declared for a task is right: none moves the robot."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import effect
from elastocal.effects.sizes import LOAD, REACH, Size

if TYPE_CHECKING:
    from collections.abc import Callable

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate, Candidates, Displacements, Effect, Parameter
    from elastocal.mechanics.sites import Sites

    # Change of force and moment (S, 3) by a unit of an error along or about a direction (S, 3), of the wrench (S, 6).
    Change = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]

_effect = partial(effect, "load", moves_robot=False)
# Share of the moments that may be left unexplained where a pull acts at one place.
_OF_ONE_PLACE = 0.01
# Axes in which an error can be fixed, with the moments right, or with those that the wrong force makes at its lever: between
# flange and tool a sensor measures forces and moments; in the line of a pull, the force alone.
_PULL = " in the pull"
_FRAMES = [("base axes",), ("flange axes",)]
_AND_IN_PULL = [*_FRAMES, *((frame + _PULL,) for (frame,) in _FRAMES)]


def _wrong(own: Effect, parameters: tuple[Parameter, ...], frame: str, change: Change) -> Candidate:
    """Candidate of a wrench that is wrong by ``change(direction, wrench)`` for each of the axes of a frame."""

    def law(around: Conditions) -> Displacements:
        wrench, rotation = around.wrench, around.end_rotation
        fixed = np.broadcast_to(np.eye(3), rotation.shape)
        changed = [change(axis, wrench) for axis in np.moveaxis(rotation if frame.startswith("flange") else fixed, -1, 0)]
        if frame.endswith(_PULL):
            lever = lever_of_pull(wrench, rotation)
            changed = [(force, np.cross(lever, force)) for force, _ in changed]
        wrong = [around.joint_deflections(np.concatenate(part, axis=1)) for part in changed]
        return [dict(enumerate(turns.T)) for turns in wrong]

    return own.candidate((), parameters, law, {"load"}, detail=frame)


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


@_effect(
    "misalignment of the force sensor", Size("turn", 0.02, "a sensor mounted by eye: a degree"), at=lambda sites: _AND_IN_PULL
)
def force_misalignment(own: Effect, sites: Sites, frame: str) -> Candidates:
    """A force sensor that is mounted askew: it shows the right force in a wrong direction.

    theta = diag(c) J^T (phi x F, 0), or diag(c) J^T (phi x F, r x (phi x F)) in a pull,

    with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the loaded point, F the
    recorded force (N) and phi the small angle from it to the one that acts (rad), fixed in base axes, or in the flange where
    the sensor turns with the tool. A sensor in the line of a pull measures the force alone, so that the moment about its lever
    r (m) is wrong, too; elsewhere the moments are as recorded. Derived here: a small turn adds phi x F, and an error dw of the
    wrench loads by J^T dw.
    """
    parameters = own.parameters("turn", [f"about_{axis}" for axis in "xyz"], "rad", sites)
    yield _wrong(own, parameters, frame, lambda axis, wrench: (np.cross(axis, wrench[:, :3]), np.zeros_like(axis)))


@_effect(
    "zero error of the force sensor",
    Size("force", 0.01, "accuracy class of load cells that suit the arm", LOAD),
    at=lambda sites: _AND_IN_PULL,
)
def force_bias(own: Effect, sites: Sites, frame: str) -> Candidates:
    """A force sensor that shows a force where there is none: its zero was not set before the pull, or has moved since.

    theta = diag(c) J^T (b, 0) wherever a load is recorded, or (b, r x b) in a pull with the lever r (m); theta are the turns of
    the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the loaded point, and b the force that acts beyond the
    recorded one (N), which is minus what the sensor shows at zero. It is fixed in base axes, or in the flange where the sensor
    turns with the tool.
    """
    parameters = own.parameters("force", [f"along_{axis}" for axis in "xyz"], "N", sites)
    yield _wrong(own, parameters, frame, lambda axis, wrench: (axis * wrench.any(axis=1, keepdims=True), np.zeros_like(axis)))


@_effect(
    "wrong load application point",
    Size("shift", 0.01, "a hook or a screw beside the point that was meant", REACH),
    at=lambda sites: _FRAMES,
)
def application_point(own: Effect, sites: Sites, frame: str) -> Candidates:
    """A force that acts elsewhere than was recorded: the pull or the weight is fixed to the tool at another place.

    theta = diag(c) J^T (0, dr x F), with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian
    of the loaded point, F the force (N) and dr the shift of its point of application (m), fixed in base axes, or in the flange
    where the load hangs on the tool. Derived here: a force that is moved by dr has the further moment dr x F.
    """
    parameters = own.parameters("shift", [f"shift_{axis}" for axis in "xyz"], "m", sites)
    yield _wrong(own, parameters, frame, lambda axis, wrench: (np.zeros_like(axis), np.cross(axis, wrench[:, :3])))


@_effect("scale error of the force sensor", Size("scale", 0.02, "a load cell that was calibrated long ago"))
def force_scale(own: Effect, sites: Sites) -> Candidates:
    """A force sensor that shows too much or too little: its sensitivity differs from the one of its calibration.

    theta = diag(c) J^T (s w), with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the
    loaded point, w the recorded wrench (N, N m) and s the share by which the one that acts is larger. Where all compliances are
    identified and no declared masses load the joints it is exactly an alias of them, so that only a reference weight can find
    it.
    """
    scale = own.parameters("scale", ["scale"], "1", sites)
    yield own.candidate((), scale, lambda around: [dict(enumerate(around.joint_deflections(around.wrench).T))], {"load"})
