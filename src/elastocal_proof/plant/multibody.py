"""The arm as a MuJoCo model: each drive a commanded hinge and, in series, a hinge that springs; links cut into segments.

Structural springs (foot, bearings, link segments) are joints of the same tree. The springs' stiffnesses stand in the model too,
so that MuJoCo's own inverse dynamics can judge an equilibrium that was found without them.

The tree moves by the kinematics of MuJoCo [1]; elastic links are Timoshenko beams [2] lumped into segments.

[1] Todorov, E., Erez, T. and Tassa, Y., MuJoCo: a physics engine for model-based control, IEEE/RSJ International Conference on
    Intelligent Robots and Systems, 2012.
[2] Timoshenko, S. P., On the correction for shear of the differential equation for transverse vibrations of prismatic bars,
    Philosophical Magazine 41, 1921.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, tostring

import mujoco
import numpy as np

from elastocal.errors import InputError
from elastocal_proof.plant.arm import Arm, Stretch, turned

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal_proof.plant.structure import Compensator, Structure, TaperedTube

# MuJoCo wants mass in each moving body; this weighs nothing beside a load of newtons.
_NO_MASS, _NO_INERTIA = "1e-12", "1e-12 1e-12 1e-12"


@dataclass(frozen=True)
class Machine:
    """A compiled model and where in it what is.

    `drive`, `gear` (n,) of int: coordinates that are commanded, and those that spring behind them. `springs`: structural
    coordinates by name, such as ``base_x``, ``tilt2_0``, ``link3_4_bend0``. `compliance` (coordinates,): of structural springs,
    m/N or rad/(N m); zero elsewhere. `sites`: measuring points. `links` (n + 1,) of int: bodies of the foot and of the links
    behind the drives. `beyond` (coordinates, bodies) of bool: which bodies each coordinate moves: all from its own on, for the
    tree is a chain. `slides` (coordinates,) of bool: which coordinates are lengths; the others are angles. `body_stretch`,
    `site_stretch` (bodies,) of int, (sites,): stretch of whose vector the place of each body and site is a part.
    """

    model: mujoco.MjModel
    drive: np.ndarray
    gear: np.ndarray
    springs: dict[str, int]
    compliance: np.ndarray
    sites: dict[str, int]
    links: np.ndarray
    beyond: np.ndarray
    slides: np.ndarray
    body_stretch: np.ndarray
    site_stretch: np.ndarray
    flange: str
    compensator: Compensator | None
    xml: str


class _Tree:
    """Bodies so far; the frame in which the next one is placed."""

    inertial: Element

    def __init__(self, world: Element) -> None:
        self.body, self.position, self.rotation = world, np.zeros(3), np.eye(3)
        self.compliance: dict[str, float] = {}

    def descend(self, name: str) -> None:
        """New body at the current frame."""
        self.body = SubElement(self.body, "body", name=name, pos=_text(self.position), quat=_quaternion(self.rotation))
        # In front of all else in the body, as MuJoCo's schema has it.
        self.inertial = SubElement(self.body, "inertial", pos="0 0 0", mass=_NO_MASS, diaginertia=_NO_INERTIA)
        self.position, self.rotation = np.zeros(3), np.eye(3)

    def joint(self, name: str, kind: str, axis: np.ndarray, compliance: float | None = None) -> None:
        """Joint of the current body; `compliance` None for one that is commanded."""
        added = SubElement(self.body, "joint", name=name, type=kind, axis=_text(axis), armature="1")
        if compliance:
            added.set("stiffness", _text([1.0 / compliance]))
        if compliance is not None:
            self.compliance[name] = compliance

    def six_springs(self, name: str, compliances: Iterable[float] | None) -> None:
        """Along and about x, y and z of the current body; none where `compliances` is None."""
        names = [f"{name}_{kind}{axis}" for kind in ("", "r") for axis in "xyz"]
        for number, compliance in enumerate(compliances or ()):
            self.joint(names[number], "slide" if number < 3 else "hinge", np.eye(3)[number % 3], compliance)

    def weigh(self, mass: float, position: np.ndarray) -> None:
        """Put a mass on the current body; masses add up at their common centre."""
        old, where = float(self.inertial.attrib["mass"]), np.array(self.inertial.attrib["pos"].split(), float)
        self.inertial.set("pos", _text((old * where + mass * np.asarray(position)) / (old + mass)))
        self.inertial.set("mass", _text([old + mass]))


def machine_of(arm: Arm, structure: Structure, gear_compliance: np.ndarray | None = None) -> Machine:
    """Build the model of an arm.

    `gear_compliance` (n,): rad/(N m), written into the model as the stiffness of the gears for checks by `mujoco.mj_inverse`.
    """
    root = Element("mujoco", model="plant")
    SubElement(root, "compiler", angle="radian", autolimits="false")
    SubElement(root, "option", gravity=_text(structure.gravity_m_s2))
    tree = _Tree(SubElement(root, "worldbody"))
    tree.descend("foot")
    tree.six_springs("base", structure.base)
    stiffness = np.zeros(arm.joints) if gear_compliance is None else gear_compliance
    for number, stretch in enumerate(arm.stretches):
        _add_stretch(tree, number, stretch, structure, arm.points[-1] if structure.flange else None)
        if number < arm.joints:
            tree.descend(f"arm{number + 1}")
            axis = arm.axes[number]
            tree.joint(f"drive{number + 1}", "hinge", axis)
            tree.joint(f"gear{number + 1}", "hinge", axis, stiffness[number])
            across = [e for e in np.eye(3) if abs(e @ axis) < 0.5]
            for which in range(2 if number + 1 in structure.loose else 0):
                tree.joint(f"shift{number + 1}_{which}", "slide", across[which], 0.0)
            for which, compliance in enumerate(structure.tilt.get(number + 1, ())):
                tree.joint(f"tilt{number + 1}_{which}", "hinge", across[which], compliance)
    if structure.flange is not None:
        tree.descend("flange")
        tree.six_springs("flange", structure.flange)
        _add_site(tree, arm.points[-1], np.zeros(3), np.eye(3))
    if structure.payload is not None:
        load = structure.payload
        tree.weigh(load.mass_kg, tree.position + tree.rotation @ np.array(load.aside_m))
    if structure.compensator is not None:
        _add_compensator(root, arm, structure.compensator)
    xml = tostring(root, encoding="unicode")
    return _indexed(arm, structure, tree, xml)


def _indexed(arm: Arm, structure: Structure, tree: _Tree, xml: str) -> Machine:
    model = _compiled(xml)
    place = {model.joint(j).name: int(model.jnt_qposadr[j]) for j in range(model.njnt)}
    compliance = np.zeros(model.nq)
    for name, value in tree.compliance.items():
        if not name.startswith("gear"):
            compliance[place[name]] = value
    numbers = range(1, arm.joints + 1)
    return Machine(
        model,
        np.array([place[f"drive{j}"] for j in numbers]),
        np.array([place[f"gear{j}"] for j in numbers]),
        {name: index for name, index in place.items() if not name.startswith(("drive", "gear"))},
        compliance,
        {name: model.site(name).id for name in arm.points},
        np.array([model.body(name).id for name in ("foot", *(f"arm{j}" for j in numbers))]),
        np.arange(model.nbody) >= model.jnt_bodyid[:, None],
        model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE,
        *_stretches_of(model),
        arm.points[-1],
        structure.compensator,
        xml,
    )


def _stretches_of(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Stretches of all bodies and of all sites: a body behind a drive is placed by the stretch before it."""
    behind_drive = np.array([model.body(number).name.startswith("arm") for number in range(model.nbody)], int)
    within = behind_drive.cumsum()
    return within - behind_drive, within[model.site_bodyid]


@lru_cache(maxsize=4)
def _compiled(xml: str) -> mujoco.MjModel:
    """A case asks for the same few models again and again."""
    return mujoco.MjModel.from_xml_string(xml)


def _add_stretch(tree: _Tree, number: int, stretch: Stretch, structure: Structure, elsewhere: str | None) -> None:
    """Walk from the near to the far end of a stretch and leave the tree there; one measuring point may be put elsewhere."""
    vector = stretch.vector_m + np.array(structure.wrong_vectors_m.get(number, (0.0, 0.0, 0.0)))
    turn = turned(np.array(structure.wrong_turns.get(number, (0.0, 0.0, 0.0))))
    rotation = stretch.rotation @ turn
    weights = [(mass.mass_kg, mass.along, np.array(mass.aside_m)) for mass in structure.masses if mass.stretch == number]
    points = [point for point in stretch.points if point.name != elsewhere]
    tube = structure.tubes.get(number)
    if tube is None:
        for mass, along, aside in weights:
            tree.weigh(mass, tree.position + tree.rotation @ (along * vector + aside))
        for point in points:
            # What is wrong about a stretch is wrong at its far end.
            at_end = np.allclose(point.position_m, stretch.vector_m, atol=1e-12)
            where, facing = (vector, point.rotation @ turn) if at_end else (point.position_m, point.rotation)
            _add_site(tree, point.name, tree.position + tree.rotation @ where, tree.rotation @ facing)
        tree.position, tree.rotation = tree.position + tree.rotation @ vector, tree.rotation @ rotation
        return
    _add_segments(tree, number, vector, tube, structure.segments, weights)
    for point in points:
        if not np.allclose(point.position_m, stretch.vector_m, atol=1e-12):
            raise InputError("structure", f"tubes[{number}]", f"[{point.name}] inside it", "points at the far end of a link")
        _add_site(tree, point.name, tree.position, point.rotation @ turn)
    tree.rotation = rotation


def _add_segments(
    tree: _Tree,
    number: int,
    vector: np.ndarray,
    tube: TaperedTube,
    count: int,
    weights: Sequence[tuple[float, float, np.ndarray]],
) -> None:
    """Rigid pieces with springs at the middle of each: the midpoint rule for the integral of M / EI along the link."""
    along = vector / np.linalg.norm(vector)
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first /= np.linalg.norm(first)
    across = (first, np.cross(along, first))
    piece, step = float(np.linalg.norm(vector)) / count, vector / count
    tree.position = tree.position + tree.rotation @ (0.5 * step)
    for segment in range(count):
        tree.descend(f"link{number}_{segment}")
        width = 1.0 - tube.taper * (segment + 0.5) / count
        name = f"link{number}_{segment}_"
        for which, axis in enumerate(across):
            if np.isfinite(tube.shear_N):
                tree.joint(f"{name}shear{which}", "slide", axis, piece / (tube.shear_N * width))
        if np.isfinite(tube.axial_N):
            tree.joint(f"{name}axial", "slide", along, piece / (tube.axial_N * width))
        for which, axis in enumerate(across):
            tree.joint(f"{name}bend{which}", "hinge", axis, piece / (tube.bending_Nm2 * width**3))
        tree.joint(f"{name}twist", "hinge", along, piece / (tube.torsion_Nm2 * width**3))
        for mass, share, aside in weights:
            # On the segment that holds its place; the body's origin is the middle of the segment.
            if min(int(share * count), count - 1) == segment:
                tree.weigh(mass, (share - (segment + 0.5) / count) * vector + aside)
        tree.position = step if segment < count - 1 else 0.5 * step


def _add_site(tree: _Tree, name: str, position: np.ndarray, rotation: np.ndarray) -> None:
    """A measuring point, in the frame of the current body."""
    SubElement(tree.body, "site", name=name, pos=_text(position), quat=_quaternion(rotation))


def _add_compensator(root: Element, arm: Arm, spring: Compensator) -> None:
    """Two sites and the tendon between them: from the body before the shoulder's drive to the body behind it."""
    bodies, before = {body.get("name"): body for body in root.iter("body")}, arm.stretches[1]
    anchor = before.vector_m + before.rotation @ np.array(spring.anchor_m)
    for body, name, place in (("arm1", "anchor", anchor), ("arm2", "crank", np.array(spring.crank_m))):
        SubElement(bodies[body], "site", name=name, pos=_text(place))
    tendon = SubElement(root, "tendon")
    stiffness, length = _text([spring.stiffness_N_per_m]), _text([spring.free_length_m])
    path = SubElement(tendon, "spatial", name="compensator", stiffness=stiffness, springlength=length)
    for name in ("anchor", "crank"):
        SubElement(path, "site", site=name)


def _text(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def _quaternion(rotation: np.ndarray) -> str:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return _text(quaternion)
