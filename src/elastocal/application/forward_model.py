"""The calibrated robot in one class, from what `elastocal export` writes: joint angles to poses, and back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.application.accuracy import scope_from
from elastocal.application.calibrated import NEUTRAL, CalibratedRobot, calibrate_by_model, forward
from elastocal.application.compensation import find_joint_targets
from elastocal.counting import counted
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.gravity import declared_weight
from elastocal.errors import InputError
from elastocal.fitting.model import Estimate, Model
from elastocal.fitting.noise import Noise
from elastocal.io.json_files import read_json
from elastocal.mechanics.robot import with_rigid_joints
from elastocal.mechanics.robot_file import document_of, robot_from_document
from elastocal.mechanics.sites import sites_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal.application.calibrated import OperatingConditions
    from elastocal.application.compensation import Correction

# Of a folder that `elastocal export` wrote, and what it says of the model.
SIDECAR, KEY = "effects.json", "forward_model"


class ForwardModel:
    """Where a calibrated robot really is.

    >>> model = ForwardModel.read("calibrated")                                     # doctest: +SKIP
    >>> position, rotation = model.pose([[0.0, -1.2, 1.4, 0.0, 0.6, 0.0]])          # doctest: +SKIP

    Angles are the controller's, rad (m for prismatic joints); poses those of the last measuring point in base axes, m.
    """

    def __init__(self, calibrated: CalibratedRobot) -> None:
        self.calibrated = calibrated

    @classmethod
    def read(cls, folder: str | Path) -> ForwardModel:
        """The model of a folder that `elastocal export` wrote.

        Raises `InputError`: a file that is not there or not readable, an effect that the catalogue does not have on this robot.
        """
        path = Path(folder) / SIDECAR
        document = read_json(path)
        if KEY not in document:
            raise InputError(path, KEY, "nothing", "a file of elastocal export")
        return cls(read_calibrated(document[KEY], path.as_posix()))

    def pose(
        self, joint_angles: Sequence[Sequence[float]] | np.ndarray, operating: OperatingConditions = NEUTRAL
    ) -> tuple[np.ndarray, np.ndarray]:
        """Positions (N, 3) and rotations (N, 3, 3) at which the robot comes to rest, of joint angles (N, n)."""
        return forward(self.calibrated, np.asarray(joint_angles, float), operating)

    def joint_targets(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        operating: OperatingConditions = NEUTRAL,
        start: np.ndarray | None = None,
    ) -> Correction:
        """Joint angles to command so that the robot comes to rest at wanted poses; as `compensation.find_joint_targets`."""
        return find_joint_targets(self.calibrated, position, rotation, operating, start)


def model_document(calibrated: CalibratedRobot) -> dict[str, Any]:
    """A calibrated robot as JSON, from which `read_calibrated` makes the same."""
    model, estimate = calibrated.model, calibrated.estimate
    values = zip(model.effects, estimate.coefficients, estimate.shapes, strict=True)
    return {
        "robot": document_of(calibrated.robot),
        "rigid_joints": not (calibrated.robot.compliance_known or calibrated.robot.compliance.any()),
        "effects": [{"key": e.key, "values": linear.tolist(), "shapes": shapes.tolist()} for e, linear, shapes in values],
        "covariance": calibrated.covariance.tolist(),
        "joint_repeatability": calibrated.noise.joint_rad.tolist(),
        "pose_error_rad": calibrated.noise.pose_rad,
        "scope": None if calibrated.scope is None else calibrated.scope.document(),
        "time_zero_s": model.time_zero_s,
    }


def read_calibrated(document: Mapping[str, Any], source: str) -> CalibratedRobot:
    """A calibrated robot from the document of `model_document`; `source` is named in errors.

    An InputError refuses an effect that the catalogue does not have on this robot, or has with other parameters.
    """
    robot = robot_from_document(document["robot"], source)
    robot = with_rigid_joints(robot) if document["rigid_joints"] else robot
    sites = sites_of(robot)
    known = candidates_on(sites) | {"joint_compliance": joint_compliance(sites)}
    if sites.masses:
        known["declared_weight"] = declared_weight(sites)
    for number, entry in enumerate(document["effects"]):
        where, key = f"{KEY}.effects[{number}]", entry["key"]
        if key not in known:
            raise InputError(source, where, repr(key), f"an effect of the catalogue on {robot.name}")
        found, wanted = len(entry["values"]), len(known[key].parameters)
        if found != wanted:
            raise InputError(source, where, counted(found, "value"), f"{wanted}, as {key} has in this version")
    effects = tuple(known[entry["key"]] for entry in document["effects"])
    zero = float(document["time_zero_s"])
    model = Model(sites, (), False, 6, robot.compliance, effects, zero, None, robot.compliance_known)
    none = np.zeros((0, 3))
    estimate = Estimate(
        (0,),
        np.eye(3)[None],
        np.zeros((1, 3)),
        none,
        np.zeros((0, 3, 3)),
        tuple(np.array(entry["values"], float) for entry in document["effects"]),
        tuple(np.array(entry["shapes"], float) for entry in document["effects"]),
    )
    repeated = np.array(document["joint_repeatability"], float)
    noise = Noise("declared", 0.0, 0.0, repeated, pose_rad=float(document["pose_error_rad"]))
    calibrated = calibrate_by_model(robot, model, estimate, np.array(document["covariance"], float), noise)
    return replace(calibrated, scope=None if document["scope"] is None else scope_from(document["scope"]))
