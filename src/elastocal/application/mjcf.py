"""The calibrated robot as a model of MuJoCo.

Each joint has a position servo whose gain is the stiffness of its gear, so that it comes
to rest at its command plus its compliance times its load. Bases, bearings and flanges
that yield are passive joints with a stiffness. Constant errors of the geometry are part of
the bodies' poses, and weights are bodies. Other effects, such as gear waves, plays and
links that bend, have no counterpart among rigid bodies. They are left out, and their
names are returned.

MuJoCo composes the joints of a body in their order, as the chain does. Its hinges and
slides are about and along axes of the body, and its servos act as linear springs (MuJoCo
documentation, chapters Computation and XML reference).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.effects.gravity import DECLARED_WEIGHT
from elastocal.effects.protocol import effect_of
from elastocal.exchange.robot_text import make_elementary_transform
from elastocal.exchange.urdf_writing import (
    estimate_inertia,
    find_followed_joint,
    number_joints,
)
from elastocal.mechanics.chain import AXES
from elastocal.mechanics.robot_file import parse_robot

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.application.model_file import (
        ElementaryTransform,
        ModelEffect,
        ModelFile,
    )
    from elastocal.effects.formulas import Term

_PAYLOAD = "payload"
# Effects that are part of springs and bodies already.
_IN_SPRINGS_AND_BODIES = ("joint_compliance", DECLARED_WEIGHT)
# Compliance of a rigid joint, rad/(N m): a load of a kilonewton metre turns it by a
# microradian.
_RIGID = 1e-9
# MuJoCo asks for an inertia of every body. This one has no weight that could be noticed.
_NO_MASS_KG = 1e-9
_NO_INERTIA = 1e-9
# Period of a spring whose body has no inertia of its own, s, by an inertia of its motor,
# which has no weight. A simulation in steps of 2 ms resolves it.
_PERIOD_S = 0.05


@dataclass(frozen=True)
class MjcfModel:
    """A robot as a model of MuJoCo.

    Attributes
    ----------
    text : contents of the file. Joints and servos have the names of the robot's joints,
        or ``joint1`` and so on; their coordinates are the angles of the chain. The site
        with the name of the end effector has its pose. If joints follow others, the
        servo of each gets its own angle, and ``equality`` states which they are.
    left_out : keys of the effects that it does not contain.
    """

    text: str
    left_out: tuple[str, ...]


def build_mjcf(model: ModelFile) -> MjcfModel:
    """Build the model of MuJoCo from the contents of a model file."""
    expressed = [effect for effect in model.effects if _is_expressible(effect)]
    left_out = tuple(effect.key for effect in model.effects if effect not in expressed)
    terms = [*model.springs, *(term for effect in expressed for term in effect.terms)]
    arm = _Arm(model, terms)
    for number, transform in enumerate(model.kinematics.transforms):
        arm.add_bodies(number)
        arm.add_transform(transform)
    arm.add_bodies(len(model.kinematics.transforms))
    arm.add_payloads(
        [effect for effect in expressed if effect_of(effect.key) == _PAYLOAD]
    )
    arm.add_end_effector()
    arm.add_followers()
    ElementTree.indent(arm.root)
    text = ElementTree.tostring(arm.root, encoding="unicode") + "\n"
    return MjcfModel(text, left_out)


def _is_expressible(effect: ModelEffect) -> bool:
    """Whether rigid bodies and springs have the effect."""
    if effect_of(effect.key) in (*_IN_SPRINGS_AND_BODIES, _PAYLOAD):
        return True
    return all(_is_constant(term) or _is_spring(term) for term in effect.terms)


def _is_constant(term: Term) -> bool:
    factors = (term.orders, term.angles, term.loads, term.limited, term.weight)
    return not any(factors)


def _is_spring(term: Term) -> bool:
    """Whether a coordinate yields to its own load."""
    further_factors = (term.orders, term.angles, term.limited, term.weight)
    yields = term.loads == (term.coordinate,) and term.value > 0.0
    return yields and not any(further_factors)


class _Arm:
    """The bodies of an arm, added from the base to the end effector.

    Attributes
    ----------
    root : the file's root element.
    """

    def __init__(self, model: ModelFile, terms: Sequence[Term]) -> None:
        self._model = model
        self._names = model.robot.get("joint_names") or number_joints(
            model.kinematics.joints
        )
        self._constants = np.zeros(model.kinematics.coordinates)
        self._compliances = np.zeros(model.kinematics.coordinates)
        for term in terms:
            if _is_constant(term):
                self._constants[term.coordinate] += term.value
            elif _is_spring(term):
                self._compliances[term.coordinate] += term.value
        self.root = ElementTree.Element("mujoco", model=model.robot["name"])
        ElementTree.SubElement(
            self.root, "compiler", angle="radian", inertiafromgeom="false"
        )
        gravity = _format(model.kinematics.gravity_m_s2)
        ElementTree.SubElement(
            self.root, "option", gravity=gravity, integrator="implicitfast"
        )
        self._body = ElementTree.SubElement(self.root, "worldbody")
        self._actuators = ElementTree.SubElement(self.root, "actuator")
        # Pose of the next transform in the body so far.
        self._pose = np.eye(4)
        self._count = 0

    def add_transform(self, transform: ElementaryTransform) -> None:
        """Add a transform of the chain: a joint, a spring, or a constant displacement."""
        axis = AXES.index(transform.axis)
        coordinate = transform.coordinate
        if coordinate is None:
            self._displace(transform.kind, axis, transform.sign * transform.constant)
            return
        self._displace(
            transform.kind, axis, transform.sign * self._constants[coordinate]
        )
        compliance = self._compliances[coordinate]
        if coordinate < self._model.kinematics.joints:
            self._add_joint(transform, max(compliance, _RIGID))
        elif compliance:
            self._add_spring(transform, compliance)

    def add_bodies(self, after: int) -> None:
        """Add the weights in the frame behind the first `after` transforms."""
        for body in self._model.kinematics.bodies:
            if body.after == after and body.loads_joints and body.mass_kg:
                centre = np.array(body.moment_kg_m) / body.mass_kg
                self._add_weight(body.mass_kg, centre)

    def add_payloads(self, effects: Sequence[ModelEffect]) -> None:
        """Add payloads that were found to the last body, in the frame of the end
        effector."""
        for effect in effects:
            values = {name: value for name, _, value in effect.parameters}
            moment = [values.get(f"moment_{axis}", 0.0) for axis in AXES]
            mass_kg = values["mass"]
            if mass_kg > 0.0:
                self._add_weight(mass_kg, np.array(moment) / mass_kg)

    def add_end_effector(self) -> None:
        """Add the site whose pose is that of the end effector."""
        kinematics = self._model.kinematics
        for axis, length in enumerate(kinematics.end_effector_offset_m):
            self._displace("T", axis, length)
        ElementTree.SubElement(
            self._body, "site", self._take_pose(), name=kinematics.end_effector
        )

    def add_followers(self) -> None:
        """State which joints follow others, as constraints that are not active: each
        joint yields by its own compliance, and its servo gets its own command."""
        robot = parse_robot(self._model.robot)
        equality = ElementTree.Element("equality")
        for number in range(robot.joints):
            follower = find_followed_joint(robot, number)
            if follower is None:
                continue
            ElementTree.SubElement(
                equality,
                "joint",
                joint1=self._names[number],
                joint2=self._names[follower.joint],
                polycoef=_format([follower.offset, follower.multiplier, 0.0, 0.0, 0.0]),
                active="false",
            )
        if len(equality):
            self.root.append(equality)

    def _displace(self, kind: str, axis: int, amount: float) -> None:
        if amount:
            self._pose = self._pose @ make_elementary_transform(kind, axis, amount)

    def _take_pose(self) -> dict[str, str]:
        """Return the pose of the next transform as attributes."""
        quaternion = Rotation.from_matrix(self._pose[:3, :3]).as_quat(scalar_first=True)
        return {"pos": _format(self._pose[:3, 3]), "quat": _format(quaternion)}

    def _add_body(self) -> None:
        """Go on in a new body."""
        self._count += 1
        name = f"body{self._count}"
        self._body = ElementTree.SubElement(
            self._body, "body", self._take_pose(), name=name
        )
        self._pose = np.eye(4)
        ElementTree.SubElement(
            self._body,
            "inertial",
            pos="0 0 0",
            mass=_format([_NO_MASS_KG]),
            diaginertia=_format([_NO_INERTIA] * 3),
        )

    def _add_joint(self, transform: ElementaryTransform, compliance: float) -> None:
        number = transform.coordinate
        assert number is not None
        name = self._names[number]
        low, high = self._model.kinematics.joint_limits[number]
        span = _format([low, high])
        self._add_motion(transform, name, compliance, range=span)
        ElementTree.SubElement(
            self._actuators,
            "position",
            name=name,
            joint=name,
            kp=_format([1.0 / compliance]),
            dampratio="1",
            ctrlrange=span,
        )

    def _add_spring(self, transform: ElementaryTransform, compliance: float) -> None:
        name = f"spring{transform.coordinate}"
        stiffness = _format([1.0 / compliance])
        self._add_motion(transform, name, compliance, stiffness=stiffness)

    def _add_motion(
        self,
        transform: ElementaryTransform,
        name: str,
        compliance: float,
        **attributes: str,
    ) -> None:
        """Add a body that moves along or about an axis."""
        self._add_body()
        axis = transform.sign * np.eye(3)[AXES.index(transform.axis)]
        ElementTree.SubElement(
            self._body,
            "joint",
            attributes,
            name=name,
            type="hinge" if transform.kind == "R" else "slide",
            axis=_format(axis),
            armature=_format([(_PERIOD_S / (2.0 * math.pi)) ** 2 / compliance]),
        )

    def _add_weight(self, mass_kg: float, centre: np.ndarray) -> None:
        """Add a body that is fixed to the body so far."""
        self._count += 1
        name = f"weight{self._count}"
        body = ElementTree.SubElement(self._body, "body", self._take_pose(), name=name)
        ElementTree.SubElement(
            body,
            "inertial",
            pos=_format(centre),
            mass=_format([mass_kg]),
            diaginertia=_format([estimate_inertia(mass_kg)] * 3),
        )


def _format(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
