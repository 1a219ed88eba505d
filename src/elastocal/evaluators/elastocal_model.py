"""Evaluate a calibrated robot of elastocal with numpy alone.

    model = load_model("arm.elastocal.json")
    positions, rotations = model.predict(joint_angles, wrenches)
    correction = model.correct(positions, rotations, start, wrenches)

This file may be copied; docs/model_file.md of elastocal explains the format that it
reads. Angles are in rad (of prismatic joints m), lengths in m, wrenches in N and N m, all
in base axes.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

FORMAT = "elastocal model"
VERSION = 1
# Upper bound on Newton's steps, and the pose error at which they end, m.
_STEPS = 20
_CONVERGED_M = 1e-11
# Steps after which a regression is no longer evaluated anew; one with jumps would keep
# later steps from converging.
_REGRESSION_STEPS = 2


@dataclass(frozen=True)
class Correction:
    """Commands that reach N wanted poses.

    Attributes
    ----------
    joint_angles : (N, m) array, as the controller reports them.
    error : (N, 6) array
        Wanted less predicted pose, m and rad.
    """

    joint_angles: np.ndarray
    error: np.ndarray


class Model:
    """A calibrated robot.

    Parameters
    ----------
    document : contents of a model file.
    regression : whether to add the regression on the residuals, if the model has one.

    Raises
    ------
    ValueError
        The contents are not those of a model file, or the regression has no formula.
    """

    def __init__(self, document: dict[str, Any], *, regression: bool = True) -> None:
        if document.get("format") != FORMAT or document.get("version") != VERSION:
            raise ValueError(f"no {FORMAT} of version {VERSION}")
        self._kinematics = document["kinematics"]
        self._transforms = self._kinematics["transforms"]
        self._terms = list(document["springs"])
        for effect in document["effects"]:
            self._terms += effect["terms"]
        self._range = document["range"]
        self._regression = document["regression"] if regression else None
        if self._regression and self._regression["law"] is None:
            name = self._regression["name"]
            raise ValueError(f"the regression {name} has no formula: regression=False")
        self._matrix = np.array(self._kinematics["reported_matrix"])
        self._offset = np.array(self._kinematics["reported_offset"])
        # Directions in which commands move the joints: all, unless joints follow others.
        self._directions = np.eye(self.joints)
        if self.commands < self.joints:
            self._directions = np.linalg.qr(self._matrix)[0]

    @property
    def joints(self) -> int:
        """Number of joints of the chain."""
        return int(self._kinematics["joints"])

    @property
    def commands(self) -> int:
        """Number of reported joint angles, fewer than joints if some follow others."""
        return int(self._matrix.shape[1])

    def predict(
        self, joint_angles: np.ndarray, wrenches: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Predict where the robot comes to rest.

        Parameters
        ----------
        joint_angles : (N, m) array, as the controller reports them.
        wrenches : (N, 6) array, optional
            Loads at the origin of the last measuring point's frame.

        Returns
        -------
        Positions (N, 3) and rotations (N, 3, 3) of the last measuring point.
        """
        angles, wrench = self._check(joint_angles, wrenches)
        position, rotation, loads = self._come_to_rest(angles, wrench)
        return position + self._correct_residual(angles, wrench, loads), rotation

    def rigid(self, joint_angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses of the rigid, nominal robot at commands, for which an uncorrected
        program was made; as `predict`."""
        angles, _ = self._check(joint_angles, None)
        end = self._walk(self._place(angles))
        return end.point, end.rotation[-1]

    def is_extrapolated(
        self, joint_angles: np.ndarray, wrenches: np.ndarray | None = None
    ) -> np.ndarray:
        """Decide whether commands are beyond the fitted joint angles and loads, (N,)
        array."""
        angles, wrench = self._check(joint_angles, wrenches)
        return ~_is_within(self._range, angles, wrench)

    def correct(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        start: np.ndarray,
        wrenches: np.ndarray | None = None,
    ) -> Correction:
        """Find the commands that reach wanted poses, by Newton's method.

        Parameters
        ----------
        position, rotation : (N, 3) and (N, 3, 3) arrays, wanted poses.
        start : (N, m) array
            Uncorrected commands, at which the rigid robot has these poses.
        wrenches : (N, 6) array, optional
        """
        angles, wrench = self._check(start, wrenches)
        end = self._walk(self._place(angles))
        jacobian = self._compute_jacobian(end)[..., : self.joints] @ self._directions
        inverse = self._directions @ np.linalg.pinv(jacobian)
        displacement = np.zeros((len(angles), 3))
        for step in range(_STEPS):
            reached, reached_rotation, loads = self._come_to_rest(angles, wrench)
            if step <= _REGRESSION_STEPS:
                displacement = self._correct_residual(angles, wrench, loads)
            turn = _find_rotation_vectors(rotation, reached_rotation)
            shift = position - reached - displacement
            error = np.concatenate([shift, turn], axis=1)
            if np.abs(error).max(initial=0.0) < _CONVERGED_M:
                break
            angles = angles + (inverse @ error[..., None])[..., 0]
        reported = (angles - self._offset) @ np.linalg.pinv(self._matrix).T
        return Correction(reported, error)

    def _check(
        self, joint_angles: np.ndarray, wrenches: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Convert commands to angles of the chain."""
        angles = np.asarray(joint_angles, float) @ self._matrix.T + self._offset
        if wrenches is None:
            return angles, np.zeros((len(angles), 6))
        return angles, np.asarray(wrenches, float)

    def _place(self, angles: np.ndarray) -> np.ndarray:
        """Coordinates (N, C) of the rigid robot."""
        coordinates = np.zeros((len(angles), self._kinematics["coordinates"]))
        coordinates[:, : self.joints] = angles
        return coordinates

    def _come_to_rest(
        self, angles: np.ndarray, wrench: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, _Loads]:
        """Find position, rotation and loads, which act at the displaced pose."""
        rigid = self._place(angles)
        coordinates = rigid
        for _ in range(self._kinematics["load_iterations"] + 1):
            loads = _Loads(self._kinematics, self._walk(coordinates), wrench)
            coordinates = rigid + self._displace(self._terms, angles, loads)
        end = self._walk(coordinates)
        return end.point, end.rotation[-1], loads

    def _displace(
        self, terms: list[dict[str, Any]], angles: np.ndarray, loads: _Loads
    ) -> np.ndarray:
        """Sum the terms of each coordinate, (N, C) array."""
        displacement = np.zeros((len(angles), self._kinematics["coordinates"]))
        for term in terms:
            value = np.full(len(angles), term["value"])
            if "orders" in term:
                phase = sum(order * angles[:, j] for j, order in term["orders"])
                wave = np.sin if term.get("wave") == "sin" else np.cos
                value = value * wave(phase)
            for joint in term.get("angles", ()):
                value = value * angles[:, joint]
            for coordinate in term.get("loads", ()):
                value = value * loads.total[:, coordinate]
            if "limited" in term:
                value = value * _limit(loads.total, **term["limited"])
            if "weight" in term:
                value = value * loads.weigh(**term["weight"])
            displacement[:, term["coordinate"]] += value
        return displacement

    def _correct_residual(
        self, angles: np.ndarray, wrench: np.ndarray, loads: _Loads
    ) -> np.ndarray:
        """Displacement (N, 3) by the regression on the residuals."""
        if not self._regression:
            return np.zeros((len(angles), 3))
        law = self._regression["law"]
        if "displacements" in law:
            jacobian = self._compute_jacobian(self._walk(self._place(angles)))[:, :3]
            moved = self._displace(law["displacements"], angles, loads)
            mean = (jacobian @ moved[..., None])[..., 0]
        elif "trees" in law:
            mean = _evaluate_trees(law, angles, wrench)
        else:
            mean = _evaluate_process(law, angles, wrench)
        within = _is_within(self._regression["range"], angles, wrench)
        return np.where(within[:, None], mean, 0.0)

    def _walk(self, coordinates: np.ndarray) -> _Walk:
        """Follow the chain."""
        count = len(coordinates)
        rotation = np.broadcast_to(np.eye(3), (count, 3, 3))
        position = np.zeros((count, 3))
        twists = np.zeros((count, 6, coordinates.shape[1]))
        index = np.zeros(coordinates.shape[1], int)
        walk = _Walk([rotation], [position], twists, index, position)
        for number, transform in enumerate(self._transforms):
            axis = "xyz".index(transform["axis"])
            sign = transform.get("sign", 1.0)
            coordinate = transform.get("coordinate")
            amount = np.full(count, sign * transform.get("constant", 0.0))
            direction = sign * rotation[:, :, axis]
            if coordinate is not None:
                amount = sign * coordinates[:, coordinate]
                index[coordinate] = number
                twists[:, :, coordinate] = _make_twist(
                    transform["kind"], position, direction
                )
            if transform["kind"] == "T":
                position = position + amount[:, None] * rotation[:, :, axis]
            else:
                rotation = _turn(rotation, axis, amount)
            walk.rotation.append(rotation)
            walk.position.append(position)
        offset = np.array(self._kinematics["end_effector_offset_m"])
        walk.point = position + rotation @ offset
        return walk

    def _compute_jacobian(self, walk: _Walk) -> np.ndarray:
        """Jacobian (N, 6, C) of the last measuring point."""
        jacobian = walk.twists.copy()
        angular = walk.twists[:, 3:]
        jacobian[:, :3] += np.cross(angular, walk.point[..., None], axis=1)
        return jacobian


@dataclass
class _Walk:
    """Frames before each transform and behind the last, spatial twists (N, 6, C) of the
    coordinates, the transform of each, and the last measuring point (N, 3)."""

    rotation: list[np.ndarray]
    position: list[np.ndarray]
    twists: np.ndarray
    index: np.ndarray
    point: np.ndarray


class _Loads:
    """Loads of the coordinates at a displaced pose."""

    def __init__(
        self, kinematics: dict[str, Any], walk: _Walk, wrench: np.ndarray
    ) -> None:
        self._walk = walk
        self._gravity = np.array(kinematics["gravity_m_s2"])
        force = wrench[:, :3]
        moment = wrench[:, 3:] + np.cross(walk.position[-1], force)
        self.total = self._project(np.concatenate([force, moment], axis=1))
        for body in kinematics["bodies"]:
            load = self._project(
                self._compute_wrench(
                    body["after"], body["mass_kg"], body["moment_kg_m"]
                )
            )
            load[:, walk.index >= body["after"]] = 0.0
            if not body["loads_joints"]:
                load[:, : kinematics["joints"]] = 0.0
            self.total += load

    def weigh(
        self, joint: int, after: int, mass: float, moment: list[float]
    ) -> np.ndarray:
        """Load (N,) on a joint by the weight of a body."""
        return self._project(self._compute_wrench(after, mass, moment))[:, joint]

    def _compute_wrench(
        self, after: int, mass: float, moment: list[float]
    ) -> np.ndarray:
        """Weight (N, 6) of a body about the base's origin."""
        first_moment = mass * self._walk.position[after]
        first_moment = first_moment + self._walk.rotation[after] @ np.array(moment)
        force = np.broadcast_to(mass * self._gravity, first_moment.shape)
        return np.concatenate([force, np.cross(first_moment, self._gravity)], axis=1)

    def _project(self, wrench: np.ndarray) -> np.ndarray:
        """Load (N, C) by a wrench about the base's origin."""
        return np.einsum("nic,ni->nc", self._walk.twists, wrench)


def load_model(path: str | Path, *, regression: bool = True) -> Model:
    """Load a model file; see `Model`."""
    document = json.loads(Path(path).read_text(encoding="utf-8"))
    return Model(document, regression=regression)


def _limit(loads: np.ndarray, kind: str, coordinate: int, limit: float) -> np.ndarray:
    if kind == "tanh":
        return np.asarray(np.tanh(loads[:, coordinate] / limit))
    return np.clip(loads[:, coordinate], -limit, limit)


def _is_within(
    span: dict[str, Any], angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    beyond = (angles < np.array(span["low"])) | (angles > np.array(span["high"]))
    force, moment = np.linalg.norm(wrench.reshape(-1, 2, 3), axis=2).T
    overloaded = (force > span["force_N"]) | (moment > span["moment_Nm"])
    return np.asarray(~(beyond.any(axis=1) | overloaded))


def _collect_inputs(
    law: dict[str, Any], angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """Inputs of a regression on joint angles, wrench and position of the target."""
    offset = np.broadcast_to(law["target_offset_m"], (len(angles), 3))
    return np.hstack([angles, wrench, offset])


def _evaluate_trees(
    law: dict[str, Any], angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    # Trees are grown on inputs in single precision.
    inputs = _collect_inputs(law, angles, wrench).astype(np.float32)
    rows = np.arange(len(inputs))
    total = np.zeros((len(inputs), 3))
    for tree in law["trees"]:
        column = np.array(tree["column"])
        threshold = np.array(tree["threshold"])
        children = np.array(tree["children"])
        node = np.zeros(len(inputs), int)
        while (column[node] >= 0).any():
            goes_right = inputs[rows, column[node]] > threshold[node]
            is_leaf = column[node] < 0
            node = np.where(is_leaf, node, children[node, goes_right.astype(int)])
        total += np.array(tree["value"])[node]
    return total / len(law["trees"])


def _evaluate_process(
    law: dict[str, Any], angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    inputs = _collect_inputs(law, angles, wrench)[:, law["columns"]]
    scaled = (inputs - law["center"]) / law["spread"] / law["lengths"]
    points = np.array(law["points"])
    square = (scaled**2).sum(axis=1)[:, None] + (points**2).sum(axis=1)
    root = np.sqrt(np.maximum(5.0 * (square - 2.0 * scaled @ points.T), 0.0))
    kernel = (1.0 + root + root**2 / 3.0) * np.exp(-root)
    return np.asarray(kernel @ law["weights"] * law["size"] + law["offset"])


def _make_twist(kind: str, position: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Spatial twists (N, 6) of motions along or about axes through positions (N, 3)."""
    if kind == "T":
        return np.hstack([direction, np.zeros_like(direction)])
    return np.hstack([np.cross(position, direction), direction])


def _turn(rotation: np.ndarray, axis: int, angle: np.ndarray) -> np.ndarray:
    """Turn frames about one of their axes."""
    cosine = np.cos(angle)[:, None]
    sine = np.sin(angle)[:, None]
    second = rotation[:, :, axis - 2]
    third = rotation[:, :, axis - 1]
    turned = rotation.copy()
    turned[:, :, axis - 2] = cosine * second + sine * third
    turned[:, :, axis - 1] = cosine * third - sine * second
    return turned


def _find_rotation_vectors(rotation: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Rotation vectors (N, 3) from one orientation to another, less than half a turn."""
    relative = rotation @ start.transpose(0, 2, 1)
    skew = 0.5 * np.stack(
        [relative[:, i - 1, i - 2] - relative[:, i - 2, i - 1] for i in range(3)],
        axis=1,
    )
    sine = np.linalg.norm(skew, axis=1)
    cosine = 0.5 * (np.trace(relative, axis1=1, axis2=2) - 1.0)
    ratio = np.arctan2(sine, cosine) / np.where(sine > 0.0, sine, 1.0)
    return np.where(sine > 0.0, ratio, 1.0)[:, None] * skew
