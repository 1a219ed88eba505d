"""An arm of springs by pinocchio: poses, Jacobians, and deflections under a load
(equations 1 to 10)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

_TOKEN = re.compile(r"([TR])([xyz])\((-?)([^()]+)\)|\[([^\[\]]+)\]")
_JOINT = re.compile(r"q\d+")
_JOINT_MODELS = {
    "T": (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
    "R": (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
}
# Gauss-Legendre rule on (-1, 1) for integrals along a tapered link.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


class ChainElement(NamedTuple):
    """One element of a chain: a transform, fixed or moved by a coordinate, or a
    measuring point.

    Attributes
    ----------
    kind : "T", "R" or "point"
    axis : 0, 1, 2 for x, y, z
    amount : of a fixed transform, m or rad
    coordinate : index of the coordinate that moves the transform, or None
    sign : sense of the coordinate, +1 or -1
    point : name of a measuring point
    """

    kind: str
    axis: int = 0
    amount: float = 0.0
    coordinate: int | None = None
    sign: float = 1.0
    point: str = ""


def parse_chain_elements(
    document: Mapping[str, Any],
) -> tuple[list[ChainElement], list[np.ndarray]]:
    """Parse the chain of a robot file.

    If the file has ``links``, six springs follow each link (equation 5); their
    coordinates follow those of the joints. A point at the end of a link moves with it.

    Returns
    -------
    elements : list of chain elements
    links : vectors (3,) along the rigid links, m
    """
    text = document["chain"]
    lengths = document.get("lengths_m", {})
    joints = len({*_JOINT.findall(text)})
    vector = np.zeros(3)
    elements: list[ChainElement] = []
    points: list[ChainElement] = []
    links: list[np.ndarray] = []
    # A last rotation by zero ends the last link and its points.
    for kind, letter, minus, argument, point in _TOKEN.findall(f"{text} Rx(0)"):
        if point:
            points.append(ChainElement("point", point=point))
            continue
        is_joint = _JOINT.fullmatch(argument)
        if vector.any() and (kind == "R" or is_joint):
            if "links" in document:
                elements += _list_springs(joints + 6 * len(links))
            links.append(vector)
            vector = np.zeros(3)
        elements += points
        points.clear()
        axis = "xyz".index(letter)
        sign = -1.0 if minus else 1.0
        if is_joint:
            coordinate = int(argument[1:]) - 1
            elements.append(ChainElement(kind, axis, 0.0, coordinate, sign))
            continue
        if kind == "R":
            amount = sign * np.deg2rad(float(argument.removesuffix("deg")))
        else:
            amount = sign * float(lengths.get(argument, argument))
            vector[axis] += amount
        elements.append(ChainElement(kind, axis, amount))
    return elements, links


def _list_springs(first_coordinate: int) -> list[ChainElement]:
    """Three springs along the axes and three about them, at the end of a link."""
    return [
        ChainElement(kind, axis, coordinate=first_coordinate + 3 * block + axis)
        for block, kind in enumerate("TR")
        for axis in range(3)
    ]


class Arm:
    """An arm with a spring in each joint and, if its file has links, six springs at the
    end of each.

    Attributes
    ----------
    document : contents of the robot file
    joints : number of joints
    coordinates : number of joints and springs of links
    elements, links : see `parse_chain_elements`
    points : names of the measuring points
    frames : measuring point and offset (3,), m, by the name of the frame
    compliance : (joints,) array, rad/(N m)
    springs : (coordinates, coordinates) array, compliance that the file states
    """

    def __init__(
        self,
        document: Mapping[str, Any],
        targets: Mapping[Any, tuple[str, Any]] | None = None,
        tool_m: Any = (0.0, 0.0, 0.0),
    ) -> None:
        """Build the arm of a robot file.

        Parameters
        ----------
        document : contents of the robot file
        targets : mapping, optional
            Measuring point and offset in its frame, m, by the name of the target. By
            default each point has a target of its name.
        tool_m : offset of the default targets
        """
        self.document = document
        self.joints = len({*_JOINT.findall(document["chain"])})
        self.elements, self.links = parse_chain_elements(document)
        self.points = [
            element.point for element in self.elements if element.kind == "point"
        ]
        if targets is None:
            targets = {point: (point, tool_m) for point in self.points}
        # The wrench acts at the last measuring point.
        self.frames = {"wrench": (self.points[-1], np.zeros(3))}
        for name, (point, offset) in targets.items():
            self.frames[f"target {name}"] = (point, np.array(offset, float))
        self._moving = [
            element for element in self.elements if element.coordinate is not None
        ]
        self.coordinates = 1 + max(element.coordinate or 0 for element in self._moving)
        self._model = pin.Model()
        self._frame_ids: dict[str, int] = {}
        self._build_model()
        self._data = self._model.createData()
        # The file need not state compliances that a campaign identifies.
        stated = document.get("compliance_urad_per_Nm", [0.0] * self.joints)
        self.compliance = 1e-6 * np.array(stated, float)
        self.springs = self._build_stated_springs()

    def _build_model(self) -> None:
        """Add the joints and frames of all elements to the model of pinocchio."""
        parent = 0
        placement = pin.SE3.Identity()
        for element in self.elements:
            if element.kind == "point":
                for name, (point, offset) in self.frames.items():
                    if point == element.point:
                        target = placement * pin.SE3(np.eye(3), offset)
                        frame = pin.Frame(name, parent, target, pin.FrameType.OP_FRAME)
                        self._frame_ids[name] = self._model.addFrame(frame)
            elif element.coordinate is None:
                vector = element.amount * np.eye(3)[element.axis]
                if element.kind == "R":
                    placement = placement * pin.SE3(pin.exp3(vector), np.zeros(3))
                else:
                    placement = placement * pin.SE3(np.eye(3), vector)
            else:
                joint = _JOINT_MODELS[element.kind][element.axis]()
                name = str(self._model.njoints)
                parent = self._model.addJoint(parent, joint, placement, name)
                placement = pin.SE3.Identity()

    def build_springs(
        self, joints: np.ndarray, links: Mapping[int, np.ndarray]
    ) -> np.ndarray:
        """Build the compliance (C, C) of all coordinates from that of the joints (n,)
        and of links (6, 6) by their number."""
        compliance = np.diag(self.extend(joints))
        for number, block in links.items():
            start = self.joints + 6 * number
            compliance[start : start + 6, start : start + 6] = block
        return compliance

    def pose(
        self, coordinates: np.ndarray, target: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute the position (m) and rotation of a target."""
        pin.framesForwardKinematics(self._model, self._data, self.order(coordinates))
        placement = self._data.oMf[self._frame_ids[f"target {target}"]]
        return placement.translation.copy(), placement.rotation.copy()

    def jacobian(self, coordinates: np.ndarray, *target: Any) -> np.ndarray:
        """Compute the Jacobian (6, coordinates), linear over angular, base axes, of a
        target or, without one, of the last point."""
        frame = self._frame_ids[f"target {target[0]}" if target else "wrench"]
        columns = pin.computeFrameJacobian(
            self._model,
            self._data,
            self.order(coordinates),
            frame,
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
        )
        return self.collect(np.reshape(columns, (6, -1)))

    def deflect(
        self,
        springs: np.ndarray,
        angles: np.ndarray,
        wrench: np.ndarray,
        passes: int,
        *at: str,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute the coordinates of the deflected arm by fixed-point iteration.

        Parameters
        ----------
        springs : (C, C) array, compliance
        angles : (n,) array, commanded joint angles
        wrench : (6,) array
        passes : number of iterations; the first one evaluates the forces at the
            commanded pose
        at : target on which the wrench acts; none for the last point

        Returns
        -------
        coordinates : (C,) array
        forces : (C,) array, generalized forces of the last iteration
        """
        commanded = self.extend(angles)
        coordinates = commanded
        for _ in range(passes):
            forces = self.jacobian(coordinates, *at).T @ wrench
            coordinates = commanded + springs @ forces
        return coordinates, forces

    def regressor(
        self, angles: np.ndarray, wrench: np.ndarray, target: Any, *at: str
    ) -> np.ndarray:
        """Compute matrix A (6, n) of equation 10; `at` as in `deflect`."""
        coordinates = self.extend(angles)
        torques = self.jacobian(coordinates, *at).T @ wrench
        return (self.jacobian(coordinates, target) * torques)[:, : self.joints]

    def extend(self, joint_angles: np.ndarray) -> np.ndarray:
        """Return coordinates of joint angles with all other springs at rest."""
        return np.concatenate([joint_angles, np.zeros(self.coordinates - self.joints)])

    def order(self, coordinates: np.ndarray) -> np.ndarray:
        """Return coordinates in the order and with the sign of the model's joints."""
        return np.array(
            [element.sign * coordinates[element.coordinate] for element in self._moving]
        )

    def collect(self, columns: np.ndarray) -> np.ndarray:
        """Sum columns (..., joints of the model) for each coordinate, which may move
        several joints of the model."""
        collected = np.zeros((*columns.shape[:-1], self.coordinates))
        for number, element in enumerate(self._moving):
            column = element.sign * columns[..., number]
            collected[..., element.coordinate] += column
        return collected

    def _build_stated_springs(self) -> np.ndarray:
        """Build the springs that the file states; links without tubes are rigid until
        the caller states their compliance."""
        material = self.document.get("links") or {"tubes": []}
        tubes = material["tubes"]
        links = {}
        for number, vector in enumerate(self.links if tubes else ()):
            tube = tubes[number if len(tubes) > 1 else 0]
            outer = tube["outer_diameter_m"]
            inner = outer - 2 * tube["wall_m"]
            area = np.pi * (outer**2 - inner**2) / 4
            second_moment = np.pi * (outer**4 - inner**4) / 64
            youngs_modulus = 1e9 * material["youngs_modulus_GPa"]
            shear_modulus = 1e9 * material["shear_modulus_GPa"]
            links[number] = compute_link_compliance(
                vector,
                1 / (youngs_modulus * second_moment),
                1 / (shear_modulus * 2 * second_moment),
                0.0,
                1 / (youngs_modulus * area),
            )
        return self.build_springs(self.compliance, links)


def compute_link_compliance(
    vector: np.ndarray, bending: float, torsion: float, taper: float, axial: float = 0.0
) -> np.ndarray:
    """Compute the compliance (6, 6) of a link at its far end by integration along it
    (Castigliano's theorem).

    Parameters
    ----------
    vector : (3,) array, from the near to the far end, m
    bending, torsion, axial : 1/EI, 1/GJ and 1/EA of a uniform link
        The tapered link has the same deflection by a lateral force and the same twist.
    taper : share by which the diameter decreases along the link
    """
    length = float(np.linalg.norm(vector))
    axial_projection = np.outer(vector, vector) / length**2
    positions = 0.5 * (1 + _NODES)
    softness = 0.5 * length * _WEIGHTS / (1 - taper * positions) ** 3
    bending_scale = bending * length / 3 / (softness @ (1 - positions) ** 2)
    section = np.zeros((6, 6))
    section[:3, :3] = axial * axial_projection
    section[3:, 3:] = bending_scale * (np.eye(3) - axial_projection)
    section[3:, 3:] += torsion * length / softness.sum() * axial_projection
    compliance = np.zeros((6, 6))
    transport = np.eye(6)
    for position, weight in zip(positions, softness, strict=True):
        transport[3:, :3] = pin.skew((1 - position) * vector)
        compliance += weight * transport.T @ section @ transport
    return compliance
