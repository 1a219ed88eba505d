"""Loads: what the force sensor shows is not what acts, so that a wrong wrench turns the joints.

theta = diag(c) J^T dw, with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the loaded
point and dw the error of the wrench (N, N m): J^T dw are its torques by the principle of virtual work [1]. None of these moves
the robot: the wrench was recorded wrongly; one that is declared for a task is right.

[1] B. Siciliano, L. Sciavicco, L. Villani and G. Oriolo, Robotics: Modelling, Planning and Control, Springer, 2009.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import LOADED_JOINTS, effect
from elastocal.effects.sizes import ABSOLUTE, LOAD, REACH, Size

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate, Displacements, Effect, Parameter
    from elastocal.mechanics.sites import Sites

    # Change (S, 6) of a wrench (S, 6) per unit of an error along or about a direction (S, 3).
    Change = Callable[[np.ndarray, np.ndarray], np.ndarray]

_effect = partial(effect, "load")
# Share of the moments that may be left unexplained where a pull acts at one place.
_OF_ONE_PLACE = 0.01
_PULL = " in the pull"


def in_both_frames(sites: Sites) -> list[tuple[str]]:
    """Axes in which an error of the load can be fixed."""
    return [("base axes",), ("flange axes",)]


def at_flange_and_in_pull(sites: Sites) -> list[tuple[str]]:
    """The same with the moments right, or with those that the wrong force makes at its lever.

    Between flange and tool a sensor measures forces and moments; in the line of a pull, the force alone.
    """
    frames = in_both_frames(sites)
    return [*frames, *((frame + _PULL,) for (frame,) in frames)]


def wrong_wrench(own: Effect, parameters: tuple[Parameter, ...], frame: str, change: Change) -> Candidate:
    """Candidate of a wrench that is wrong by ``change(direction, wrench)`` for each of the axes of a frame."""

    def law(around: Conditions) -> Displacements:
        wrench, rotation = around.wrench, around.end_rotation
        fixed = np.broadcast_to(np.eye(3), rotation.shape)
        axes = np.moveaxis(rotation if frame.startswith("flange") else fixed, -1, 0)
        changed = [change(axis, wrench) for axis in axes]
        if frame.endswith(_PULL):
            lever = lever_of_pull(wrench, rotation)
            changed = [_wrench(wrong[:, :3], np.cross(lever, wrong[:, :3])) for wrong in changed]
        return [dict(enumerate(around.joint_deflections(wrong).T)) for wrong in changed]

    return own.candidate((), parameters, law, LOADED_JOINTS, detail=frame)


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


def _wrench(force: np.ndarray | float, moment: np.ndarray | float) -> np.ndarray:
    shape = np.shape(force) or np.shape(moment)
    return np.concatenate([np.broadcast_to(force, shape), np.broadcast_to(moment, shape)], axis=1)


def turned(axis: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Change of a wrench when its force is turned by one radian about an axis."""
    return _wrench(np.cross(axis, wrench[:, :3]), 0.0)


def pushed(axis: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """A force of 1 N along an axis wherever there is a load."""
    return _wrench(axis * wrench.any(axis=1, keepdims=True), 0.0)


def shifted(axis: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Change of a wrench when its force acts one metre further along an axis."""
    return _wrench(0.0, np.cross(axis, wrench[:, :3]))


@_effect(
    "misalignment of the force sensor",
    Size("turn", 0.02, ABSOLUTE, "a sensor mounted by eye: a degree"),
    at=at_flange_and_in_pull,
    moves_robot=False,
)
def force_misalignment(own: Effect, sites: Sites, frame: str) -> Iterator[Candidate]:
    """A force sensor that is mounted askew: it shows the right force in a wrong direction.

    theta = diag(c) J^T (phi x F, 0), or diag(c) J^T (phi x F, r x (phi x F)) in a pull,

    with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the loaded point, F the
    recorded force (N) and phi the small angle from it to the one that acts (rad), fixed in base axes, or in the flange where
    the sensor turns with the tool. A sensor in the line of a pull measures the force alone, so that the moment about its lever
    r (m) is wrong, too; elsewhere the moments are as recorded. Derived here: a small turn adds phi x F, and an error dw of the
    wrench loads by J^T dw.
    """
    yield wrong_wrench(own, own.parameters("turn", [f"about_{axis}" for axis in "xyz"], "rad", sites), frame, turned)


@_effect(
    "zero error of the force sensor",
    Size("force", 0.01, LOAD, "accuracy class of load cells that suit the arm"),
    at=at_flange_and_in_pull,
    moves_robot=False,
)
def force_bias(own: Effect, sites: Sites, frame: str) -> Iterator[Candidate]:
    """A force sensor that shows a force where there is none: its zero was not set before the pull, or has moved since.

    theta = diag(c) J^T (b, 0) wherever a load is recorded, or (b, r x b) in a pull with the lever r (m); theta are the turns of
    the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the loaded point, and b the force that acts beyond the
    recorded one (N), which is minus what the sensor shows at zero. It is fixed in base axes, or in the flange where the sensor
    turns with the tool. Derived here: a wrench w loads the joints by J^T w, so that its error dw turns them by diag(c) J^T dw.
    """
    yield wrong_wrench(own, own.parameters("force", [f"along_{axis}" for axis in "xyz"], "N", sites), frame, pushed)


@_effect(
    "wrong load application point",
    Size("shift", 0.01, REACH, "a hook or a screw beside the point that was meant"),
    at=in_both_frames,
    moves_robot=False,
)
def application_point(own: Effect, sites: Sites, frame: str) -> Iterator[Candidate]:
    """A force that acts elsewhere than was recorded: the pull or the weight is fixed to the tool at another place.

    theta = diag(c) J^T (0, dr x F), with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian
    of the loaded point, F the force (N) and dr the shift of its point of application (m), fixed in base axes, or in the flange
    where the load hangs on the tool. Derived here: a force that is moved by dr has the further moment dr x F, and a wrench w
    loads the joints by J^T w.
    """
    yield wrong_wrench(own, own.parameters("shift", [f"shift_{axis}" for axis in "xyz"], "m", sites), frame, shifted)


@_effect(
    "scale error of the force sensor",
    Size("scale", 0.02, ABSOLUTE, "a load cell that was calibrated long ago"),
    moves_robot=False,
)
def force_scale(own: Effect, sites: Sites) -> Iterator[Candidate]:
    """A force sensor that shows too much or too little: its sensitivity differs from the one of its calibration.

    theta = diag(c) J^T (s w), with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the
    loaded point, w the recorded wrench (N, N m) and s the share by which the one that acts is larger. Derived here: the error s
    w of the wrench loads the joints by J^T (s w). Where all compliances are identified and no declared masses load the joints
    it is exactly an alias of them, so that only a reference weight can find it.
    """
    yield own.candidate(
        (),
        own.parameters("scale", ["scale"], "1", sites),
        lambda around: [dict(enumerate(around.joint_deflections(around.wrench).T))],
        LOADED_JOINTS,
    )
