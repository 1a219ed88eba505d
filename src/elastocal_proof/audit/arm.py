"""An arm of springs by pinocchio, and by MuJoCo: poses, Jacobians and deflections (equations 1 to 10)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import pinocchio as pin

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_WORD = re.compile(r"([TR])([xyz])\((-?)([^()]+)\)|\[([^\[\]]+)\]")
_JOINTS = {
    "T": (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
    "R": (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
}


@dataclass(frozen=True)
class Step:
    """One word of a chain: fixed by `amount`, moved by a coordinate, or a measuring point.

    `kind`: one of "T", "R", "point". `amount`: m or rad.
    """

    kind: str
    axis: int = 0
    amount: float = 0.0
    coordinate: int | None = None
    sign: float = 1.0
    point: str = ""


def steps_of(document: Mapping[str, Any]) -> list[Step]:
    """Words of a robot file's chain; behind each rigid stretch of an arm with elastic links six springs (equation 5).

    `document`: keys as in the robot schema: chain, lengths_m, compliance_urad_per_Nm, links. Returns coordinates 0 to n - 1 are
    the joints, then come six for each link.
    """
    elastic, joints = "links" in document, _joints(document["chain"])
    found: list[Step] = []
    springs, stretched = joints, False
    points: list[Step] = []

    def end_of_stretch() -> None:
        nonlocal springs, stretched
        if elastic and stretched:
            for kind in "TR":
                for axis in range(3):
                    found.append(Step(kind, axis, coordinate=springs))
                    springs += 1
        stretched = False
        found.extend(points)
        points.clear()

    for kind, axis, sign, argument, point in _WORD.findall(document["chain"]):
        if point:
            points.append(Step("point", point=point))
            continue
        scale, place = -1.0 if sign else 1.0, "xyz".index(axis)
        if kind == "R" or re.fullmatch(r"q\d+", argument):
            end_of_stretch()
        if re.fullmatch(r"q\d+", argument):
            found.append(Step(kind, place, coordinate=int(argument[1:]) - 1, sign=scale))
        else:
            found.extend(points)
            points.clear()
            amount = _amount(kind, argument, document.get("lengths_m", {}))
            stretched = stretched or (kind == "T" and amount != 0)
            found.append(Step(kind, place, scale * amount))
    end_of_stretch()
    return found


class Arm:
    """An arm with a spring in each joint and, where its file has tubes, at the end of each link.

    `document`: a robot file. `tool_offset_m`: from each measuring point to its target, in the frame of the point. `diameter`:
    by which the tubes' outer diameter is another one.
    """

    def __init__(
        self, document: Mapping[str, Any], tool_offset_m: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0), diameter: float = 1.0
    ) -> None:
        self.document, self.tool = document, np.array(tool_offset_m, float)
        self.steps = steps_of(document)
        self.points = [step.point for step in self.steps if step.kind == "point"]
        self.joints = _joints(document["chain"])
        # Where a campaign has to identify them, the file need not state any.
        self.compliance = 1e-6 * np.array(document.get("compliance_urad_per_Nm", [0.0] * self.joints), float)
        self._model = pin.Model()
        self._moved: list[tuple[Step, int]] = []
        parent, placement = 0, pin.SE3.Identity()
        self._frames = {}
        for step in self.steps:
            if step.kind == "point":
                for name, offset in ((step.point, np.zeros(3)), (f"{step.point} target", self.tool)):
                    frame = pin.Frame(name, parent, placement * pin.SE3(np.eye(3), offset), pin.FrameType.OP_FRAME)
                    self._frames[name] = self._model.addFrame(frame)
            elif step.coordinate is None:
                placement = placement * _fixed(step)
            else:
                joint = _JOINTS[step.kind][step.axis]()
                parent = self._model.addJoint(parent, joint, placement, f"{len(self._moved)}")
                placement = pin.SE3.Identity()
                self._moved.append((step, step.coordinate))
                if step.coordinate < self.joints:
                    behind = f"body {step.coordinate + 1}"
                    self._frames[behind] = self._model.addFrame(pin.Frame(behind, parent, placement, pin.FrameType.OP_FRAME))
        self._data = self._model.createData()
        self.coordinates = 1 + max(coordinate for _, coordinate in self._moved)
        self.springs = self._spring_compliance(diameter)

    @cached_property
    def links(self) -> list[np.ndarray]:
        """Rigid stretches behind which an arm with elastic links has six springs each, as vectors (m)."""
        found, vector = [], np.zeros(3)
        for step in self.steps:
            if step.kind == "T" and step.coordinate is None:
                vector[step.axis] += step.amount
            elif step.kind != "point" and vector.any():
                found.append(vector)
                vector = np.zeros(3)
        return found

    @property
    def end_effector(self) -> str:
        """Name of the last measuring point."""
        return self.points[-1]

    def link_block(self, number: int) -> slice:
        """Coordinates of the six springs of a link, from 0."""
        return slice(self.joints + 6 * number, self.joints + 6 * number + 6)

    def pose(self, coordinates: np.ndarray, point: str) -> tuple[np.ndarray, np.ndarray]:
        """Position (m) and rotation of the target at a measuring point."""
        pin.framesForwardKinematics(self._model, self._data, self._ordered(coordinates))
        placed = self._data.oMf[self._frames[f"{point} target"]]
        return placed.translation.copy(), placed.rotation.copy()

    def rotation(self, coordinates: np.ndarray, frame: str) -> np.ndarray:
        """Rotation (3, 3) of a frame, named as for `jacobian`."""
        pin.framesForwardKinematics(self._model, self._data, self._ordered(coordinates))
        return self._data.oMf[self._frames[frame]].rotation.copy()

    def jacobian(self, coordinates: np.ndarray, frame: str) -> np.ndarray:
        """Jacobian (6, coordinates), linear over angular, base axes, of a point, as "NAME target" of its target, as "body 2" of
        the frame directly behind joint 2.
        """
        aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        found = np.reshape(
            pin.computeFrameJacobian(self._model, self._data, self._ordered(coordinates), self._frames[frame], aligned), (6, -1)
        )
        return self._collected(found)

    def torques(self, joint_angles: np.ndarray, wrench: np.ndarray, point: str, wrench_at: str) -> np.ndarray:
        """Generalized forces of the wrench on every coordinate (right-hand factor of equation 7)."""
        frame = self.end_effector if wrench_at == "end_effector" else f"{point} target"
        return self.jacobian(self.extend(joint_angles), frame).T @ wrench

    def deflection(
        self, joint_angles: np.ndarray, wrench: np.ndarray, point: str, wrench_at: str, compliance: np.ndarray | None = None
    ) -> np.ndarray:
        """Exact deflection (6,), m and rad: by all springs, or by joints of the given compliances alone."""
        unloaded, torques = self.extend(joint_angles), self.torques(joint_angles, wrench, point, wrench_at)
        springs = self.springs @ torques if compliance is None else self.extend(compliance * torques[: self.joints])
        position_0, rotation_0 = self.pose(unloaded, point)
        position, rotation = self.pose(unloaded + springs, point)
        return np.concatenate([position - position_0, pin.log3(rotation @ rotation_0.T)])

    def regressor(self, joint_angles: np.ndarray, wrench: np.ndarray, point: str, wrench_at: str) -> np.ndarray:
        """Matrix A (6, joints) of equation 10."""
        torques = self.torques(joint_angles, wrench, point, wrench_at)
        return (self.jacobian(self.extend(joint_angles), f"{point} target") * torques)[:, : self.joints]

    def mujoco_regressor(self, joint_angles: np.ndarray, wrench: np.ndarray, point: str, wrench_at: str) -> np.ndarray:
        """The same matrix by MuJoCo's kinematics."""
        model, data = self._mujoco
        unloaded = self.extend(joint_angles)
        data.qpos[:] = self._ordered(unloaded)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)

        def jacobian(site: str) -> np.ndarray:
            rows = np.zeros((6, model.nv))
            mujoco.mj_jacSite(model, data, rows[:3], rows[3:], model.site(site).id)
            return self._collected(rows)

        at = self.end_effector if wrench_at == "end_effector" else f"{point} target"
        return (jacobian(f"{point} target") * (jacobian(at).T @ wrench))[:, : self.joints]

    @cached_property
    def _mujoco(self) -> tuple[Any, Any]:
        spec = mujoco.MjSpec()
        body, placement = spec.worldbody, pin.SE3.Identity()
        for step in self.steps:
            if step.kind == "point":
                for name, offset in ((step.point, np.zeros(3)), (f"{step.point} target", self.tool)):
                    body.add_site(name=name, pos=placement.translation + placement.rotation @ offset)
            elif step.coordinate is None:
                placement = placement * _fixed(step)
            else:
                turn = pin.Quaternion(placement.rotation)
                body = body.add_body(pos=placement.translation, quat=[turn.w, turn.x, turn.y, turn.z])
                body.mass, body.inertia, body.explicitinertial = 1.0, np.ones(3), True
                kind = mujoco.mjtJoint.mjJNT_HINGE if step.kind == "R" else mujoco.mjtJoint.mjJNT_SLIDE
                body.add_joint(type=kind, axis=np.eye(3)[step.axis])
                placement = pin.SE3.Identity()
        model = spec.compile()
        return model, mujoco.MjData(model)

    def _ordered(self, coordinates: np.ndarray) -> np.ndarray:
        return np.array([step.sign * coordinates[coordinate] for step, coordinate in self._moved])

    def _collected(self, columns: np.ndarray) -> np.ndarray:
        """Columns of the model's joints as those of the coordinates, of which one may move several."""
        found = np.zeros((6, self.coordinates))
        for (step, coordinate), column in zip(self._moved, columns.T, strict=True):
            found[:, coordinate] += step.sign * column
        return found

    def extend(self, joint_angles: np.ndarray) -> np.ndarray:
        """Coordinates (rad) of joints with all other springs at rest."""
        return np.concatenate([joint_angles, np.zeros(self.coordinates - self.joints)])

    def _spring_compliance(self, diameter: float) -> np.ndarray:
        found = np.zeros((self.coordinates, self.coordinates))
        found[: self.joints, : self.joints] = np.diag(self.compliance)
        # Links that are named but not described yield as whoever asks for them says.
        if self.coordinates == self.joints or not self.document["links"]:
            return found
        links = self.document["links"]
        for number, vector in enumerate(self.links):
            tube, block = links["tubes"][number if len(links["tubes"]) > 1 else 0], self.link_block(number)
            found[block, block] = _tube(vector, tube, diameter, links)
        return found


def _tube(vector: np.ndarray, tube: Mapping[str, float], diameter: float, material: Mapping[str, float]) -> np.ndarray:
    """Compliance (6, 6) of a cantilever tube at its tip: force and moment there integrated along it (Castigliano's theorem)."""
    outer = diameter * tube["outer_diameter_m"]
    inner = outer - 2 * tube["wall_m"]
    area, second = np.pi * (outer**2 - inner**2) / 4, np.pi * (outer**4 - inner**4) / 64
    young, shear = 1e9 * material["youngs_modulus_GPa"], 1e9 * material["shear_modulus_GPa"]
    length = float(np.linalg.norm(vector))
    along = vector / length
    axial = np.outer(along, along)
    local = np.zeros((6, 6))
    local[:3, :3] = axial / (young * area)
    local[3:, 3:] = axial / (shear * 2 * second) + (np.eye(3) - axial) / (young * second)
    # Two Gauss points integrate exactly what is quadratic along the tube.
    total = np.zeros((6, 6))
    for place in (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)):
        lever = np.eye(6)
        lever[3:, :3] = pin.skew((1 - place) * vector)
        total += 0.5 * length * lever.T @ local @ lever
    return total


def _fixed(step: Step) -> pin.SE3:
    unit = step.amount * np.eye(3)[step.axis]
    return pin.SE3(np.eye(3), unit) if step.kind == "T" else pin.SE3(pin.exp3(unit), np.zeros(3))


def _joints(chain: str) -> int:
    return max(int(found) for found in re.findall(r"\(-?q(\d+)\)", chain))


def _amount(kind: str, argument: str, lengths_m: Mapping[str, float]) -> float:
    if kind == "R":
        return float(np.deg2rad(float(argument.removesuffix("deg"))))
    return float(lengths_m[argument]) if argument in lengths_m else float(argument)
