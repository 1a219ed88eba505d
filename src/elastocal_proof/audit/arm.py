"""An arm of springs by pinocchio: poses, Jacobians, and where it yields to under a load
(equations 1 to 10)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

_WORD = re.compile(r"([TR])([xyz])\((-?)([^()]+)\)|\[([^\[\]]+)\]")
_JOINT = re.compile(r"q\d+")
_JOINTS = {
    "T": (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
    "R": (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
}
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


class ChainElement(NamedTuple):
    """One word of a chain: fixed by `amount` (m or rad), moved by a coordinate, or a
    measuring point; `kind`: T, R or point."""

    kind: str
    axis: int = 0
    amount: float = 0.0
    coordinate: int | None = None
    sign: float = 1.0
    point: str = ""


def parse_chain_elements(
    document: Mapping[str, Any],
) -> tuple[list[ChainElement], list[np.ndarray]]:
    """Words of a robot file's chain, and its rigid stretches as vectors (m).

    Behind each stretch of an arm with elastic links stand six springs (equation 5):
    their coordinates follow those of the joints. A point at the end of a link moves
    with it.
    """
    joints = len({*_JOINT.findall(document["chain"])})
    lengths = document.get("lengths_m", {})
    vector = np.zeros(3)
    found: list[ChainElement] = []
    points: list[ChainElement] = []
    links: list[np.ndarray] = []
    for kind, axis, minus, argument, point in [
        *_WORD.findall(document["chain"]),
        ("R", "x", "", "0", ""),
    ]:
        if point:
            points.append(ChainElement("point", point=point))
            continue
        moves = _JOINT.fullmatch(argument)
        sign = -1.0 if minus else 1.0
        place = "xyz".index(axis)
        if vector.any() and (kind == "R" or moves):
            springs = joints + 6 * len(links)
            found += [
                ChainElement("TR"[k // 3], k % 3, coordinate=springs + k)
                for k in range(6 * ("links" in document))
            ]
            links.append(vector)
            vector = np.zeros(3)
        found += points
        points.clear()
        if moves:
            found.append(
                ChainElement(kind, place, coordinate=int(argument[1:]) - 1, sign=sign)
            )
        elif kind == "R":
            found.append(
                ChainElement(
                    kind, place, sign * np.deg2rad(float(argument.removesuffix("deg")))
                )
            )
        else:
            found.append(
                ChainElement(kind, place, sign * float(lengths.get(argument, argument)))
            )
            vector[place] += found[-1].amount
    return found, links


class Arm:
    """An arm with a spring in each joint and, where its file has links, six at the end
    of each.

    `targets`: measuring point and offset (3,) in its frame, m, by the target's name; of
    all points at `tool_m` by default.
    """

    def __init__(
        self,
        document: Mapping[str, Any],
        targets: Mapping[Any, tuple[str, Any]] | None = None,
        tool_m: Any = (0.0, 0.0, 0.0),
    ) -> None:
        self.document, self.joints = document, len({*_JOINT.findall(document["chain"])})
        self.steps, self.links = parse_chain_elements(document)
        self.points = [step.point for step in self.steps if step.kind == "point"]
        targets = (
            {point: (point, tool_m) for point in self.points}
            if targets is None
            else targets
        )
        # The wrench acts at the last measuring point.
        self.frames = {"wrench": (self.points[-1], np.zeros(3))}
        self.frames |= {
            f"target {name}": (point, np.array(offset, float))
            for name, (point, offset) in targets.items()
        }
        self._model = pin.Model()
        self._numbers = {}
        self.moved = [step for step in self.steps if step.coordinate is not None]
        parent = 0
        placement = pin.SE3.Identity()
        for step in self.steps:
            if step.kind == "point":
                for name, (point, offset) in self.frames.items():
                    if point == step.point:
                        frame = pin.Frame(
                            name,
                            parent,
                            placement * pin.SE3(np.eye(3), offset),
                            pin.FrameType.OP_FRAME,
                        )
                        self._numbers[name] = self._model.addFrame(frame)
            elif step.coordinate is None:
                unit = step.amount * np.eye(3)[step.axis]
                turn = pin.exp3(unit) if step.kind == "R" else np.eye(3)
                placement = placement * pin.SE3(turn, unit * (step.kind == "T"))
            else:
                parent = self._model.addJoint(
                    parent,
                    _JOINTS[step.kind][step.axis](),
                    placement,
                    str(self._model.njoints),
                )
                placement = pin.SE3.Identity()
        self._data = self._model.createData()
        self.coordinates = 1 + max(step.coordinate or 0 for step in self.moved)
        # Where a campaign has to identify them, the file need not state any.
        self.compliance = 1e-6 * np.array(
            document.get("compliance_urad_per_Nm", [0.0] * self.joints), float
        )
        self.springs = self._stated_springs()

    def spring_matrix(
        self, joints: np.ndarray, links: Mapping[int, np.ndarray]
    ) -> np.ndarray:
        """Compliance (C, C) of all coordinates from that of the joints (n,) and of
        links (6, 6) by their number."""
        found = np.diag(self.extend(joints))
        for number, block in links.items():
            place = slice(self.joints + 6 * number, self.joints + 6 * number + 6)
            found[place, place] = block
        return found

    def pose(
        self, coordinates: np.ndarray, target: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """Position (m) and rotation of a target."""
        pin.framesForwardKinematics(self._model, self._data, self.ordered(coordinates))
        placed = self._data.oMf[self._numbers[f"target {target}"]]
        return placed.translation.copy(), placed.rotation.copy()

    def jacobian(self, coordinates: np.ndarray, *target: Any) -> np.ndarray:
        """Jacobian (6, coordinates), linear over angular, base axes, of a target or,
        without one, of the last point."""
        frame = self._numbers[f"target {target[0]}" if target else "wrench"]
        aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        columns = pin.computeFrameJacobian(
            self._model, self._data, self.ordered(coordinates), frame, aligned
        )
        return self.collected(np.reshape(columns, (6, -1)))

    def loaded(
        self,
        springs: np.ndarray,
        angles: np.ndarray,
        wrench: np.ndarray,
        passes: int,
        *at: str,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates to which springs (C, C) yield, and the generalized forces there;
        of one pass at the commanded pose.

        `at`: the target that the wrench acts on, where it is not the last point.
        """
        coordinates = commanded = self.extend(angles)
        for _ in range(passes):
            forces = self.jacobian(coordinates, *at).T @ wrench
            coordinates = commanded + springs @ forces
        return coordinates, forces

    def regressor(
        self, angles: np.ndarray, wrench: np.ndarray, target: Any, *at: str
    ) -> np.ndarray:
        """Matrix A (6, n) of equation 10."""
        torques = self.jacobian(self.extend(angles), *at).T @ wrench
        return (self.jacobian(self.extend(angles), target) * torques)[:, : self.joints]

    def extend(self, joint_angles: np.ndarray) -> np.ndarray:
        """Coordinates of joints with all other springs at rest."""
        return np.concatenate([joint_angles, np.zeros(self.coordinates - self.joints)])

    def ordered(self, coordinates: np.ndarray) -> np.ndarray:
        """Coordinates as the joints of the model have them."""
        return np.array(
            [step.sign * coordinates[step.coordinate] for step in self.moved]
        )

    def collected(self, columns: np.ndarray) -> np.ndarray:
        """Columns (..., joints of the model) as those of the coordinates, of which one
        may move several."""
        found = np.zeros((*columns.shape[:-1], self.coordinates))
        for number, step in enumerate(self.moved):
            found[..., step.coordinate] += step.sign * columns[..., number]
        return found

    def _stated_springs(self) -> np.ndarray:
        """Springs of the file; links that are named but not described yield as whoever
        asks for them says."""
        material = self.document.get("links") or {"tubes": []}
        links = {}
        for number, vector in enumerate(self.links if material["tubes"] else ()):
            tube = material["tubes"][number if len(material["tubes"]) > 1 else 0]
            outer = tube["outer_diameter_m"]
            inner = tube["outer_diameter_m"] - 2 * tube["wall_m"]
            area = np.pi * (outer**2 - inner**2) / 4
            second = np.pi * (outer**4 - inner**4) / 64
            young = 1e9 * material["youngs_modulus_GPa"]
            shear = 1e9 * material["shear_modulus_GPa"]
            links[number] = compute_link_compliance(
                vector,
                1 / (young * second),
                1 / (shear * 2 * second),
                0.0,
                1 / (young * area),
            )
        return self.spring_matrix(self.compliance, links)


def compute_link_compliance(
    vector: np.ndarray, bending: float, torsion: float, taper: float, axial: float = 0.0
) -> np.ndarray:
    """Compliance (6, 6) of a link at its far end: force and moment there integrated
    along it (Castigliano's theorem).

    `bending`, `torsion`, `axial`: 1/EI, 1/GJ and 1/EA of the uniform link that a force
    shifts and a moment along twists as far. `taper`: share by which the diameter falls
    along the link.
    """
    length = float(np.linalg.norm(vector))
    along = np.outer(vector, vector) / length**2
    places = 0.5 * (1 + _NODES)
    each = 0.5 * length * _WEIGHTS / (1 - taper * places) ** 3
    local = np.zeros((6, 6))
    local[:3, :3] = axial * along
    local[3:, 3:] = (
        bending * length / 3 / (each @ (1 - places) ** 2) * (np.eye(3) - along)
    )
    local[3:, 3:] += torsion * length / each.sum() * along
    total = np.zeros((6, 6))
    lever = np.eye(6)
    for place, softer in zip(places, each, strict=True):
        lever[3:, :3] = pin.skew((1 - place) * vector)
        total += softer * lever.T @ local @ lever
    return total
