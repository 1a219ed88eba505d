"""Helpers of several test files: the check of a refusal, chains in one line, and models
of them that do not depend on the package."""

import signal
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from elastocal.errors import InputError
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.robot import Robot
from elastocal.study.simulation import Experiments

UR10 = (
    "Tz(0.1273) Rz(q1) Ty(0.1639) Ry(q2) Tx(0.612) Ry(q3) Tx(0.5723) Ry(q4) Rz(q5)"
    " Tz(-0.1157) Ry(q6) Ty(0.0922) [flange]"
)
THREE_JOINTS = "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.7) [elbow] Ry(q3) Tx(0.6) [hand]"
SEVEN_JOINTS = (
    "Tz(0.34) Rz(q1) Ry(q2) [shoulder] Tz(0.4) Rz(q3) Ry(-q4) Tz(0.4) [elbow] Rz(q5)"
    " Ry(q6) Tz(0.126) Rz(-q7) Tx(0.05) [flange]"
)
TURNED = (
    "Rx(90deg) Ty(0.3) Rz(-q1) Rx(-90deg) Tx(0.2) Rz(30deg) Ry(-q2) [A] Tx(-0.5)"
    " Rx(45.5deg) Rz(q3) Ty(0.4) Rx(-q4) [B]"
)
OTHER_CHAINS = {
    "ur10": UR10,
    "three joints": THREE_JOINTS,
    "seven joints": SEVEN_JOINTS,
    "fixed rotations": TURNED,
}
# A robot on a track.
TRACK = "Tz(0.3) Tx(-q1) Tz(0.5) Rz(q2) Tx(0.3) Ry(q3) Tx(0.7) [elbow] Ry(q4) Tx(0.6) [hand]"
ODD_CHAINS = {"track": TRACK}


def chain_of(text, **lengths_m):
    """Parse a chain from one line."""
    return parse_chain(text, lengths_m, "test")


def robot_of(text, compliance=None, links=()):
    """Make a robot from one line."""
    return robot_on(chain_of(text), compliance, links)


def robot_on(chain, compliance=None, links=()):
    """Make a robot of a chain, with joint limits that no test depends on."""
    n = chain.coordinates
    if compliance is None:
        compliance = 1e-6 * np.arange(1, n + 1)
    return Robot(
        "test",
        chain,
        np.asarray(compliance),
        np.tile([-1.0, 1.0], (n, 1)),
        links,
        np.eye(n),
        np.zeros(n),
    )


@contextmanager
def refused(source, key, *phrases):
    """Check that the block raises an InputError of one line, which names the source and
    the key and contains all phrases."""
    with pytest.raises(InputError) as raised:
        yield
    message = str(raised.value)
    assert len(message.splitlines()) == 1, message
    assert message.startswith(str(source)), message
    fault, allowed = message.split("; allowed: ")
    assert key in fault, message
    assert "found" in fault, message
    assert allowed.strip(), message
    for phrase in phrases:
        assert str(phrase) in message, (phrase, message)


def random_angles(rng, chain, *batch):
    """Draw joint angles over the full turn."""
    return rng.uniform(-np.pi, np.pi, (*batch, chain.coordinates))


def random_loads(
    robot, sets, configurations, seed=0, force=1000.0, offset=(0.0, 0.5, 0.0)
):
    """Draw experiments like those of the paper, without the package."""
    rng = np.random.default_rng(seed)
    normal = rng.standard_normal((sets, configurations, 3))
    forces = force * normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    wrench = np.concatenate([forces, np.cross(np.array(offset), forces)], axis=-1)
    return Experiments(random_angles(rng, robot.chain, sets, configurations), wrench)


class PinocchioPoint:
    """A measuring point of a chain in pinocchio: every coordinate is a revolute or
    prismatic joint model, with fixed placements between them."""

    def __init__(self, chain, point):
        self.chain = chain
        self.model = pin.Model()
        self.order = []
        turns = {"R": (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)}
        turns["T"] = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ)
        parent = 0
        placement = pin.SE3.Identity()
        for transform in chain.transforms[: point.after]:
            unit = np.eye(3)[transform.axis]
            if transform.kind == "T":
                placement = placement * pin.SE3(np.eye(3), transform.constant * unit)
            else:
                placement = placement * pin.SE3(
                    pin.exp3(transform.constant * unit), np.zeros(3)
                )
            if transform.coordinate is not None:
                # Half a turn about another axis, before and after the joint, reverses
                # its direction.
                flip = pin.SE3(
                    pin.exp3(np.pi * np.eye(3)[transform.axis - 1]), np.zeros(3)
                )
                flip = flip if transform.sign < 0 else pin.SE3.Identity()
                joint = turns[transform.kind][transform.axis]()
                parent = self.model.addJoint(
                    parent,
                    joint,
                    placement * flip,
                    f"coordinate {transform.coordinate}",
                )
                self.order.append(transform.coordinate)
                placement = flip.inverse()
        placement = placement * pin.SE3(np.eye(3), np.array(point.offset_m, float))
        self.frame = self.model.addFrame(
            pin.Frame("point", parent, placement, pin.FrameType.OP_FRAME)
        )
        self.data = self.model.createData()

    def pose_and_jacobian(self, coordinates):
        """Return position, rotation and Jacobian (linear over angular, base axes) at one
        configuration."""
        configuration = np.array(coordinates, float)[self.order]
        aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = np.zeros((6, self.chain.coordinates))
        columns = pin.computeFrameJacobian(
            self.model, self.data, configuration, self.frame, aligned
        )
        # The Jacobian of a single joint is a plain vector.
        jacobian[:, self.order] = np.reshape(columns, (6, -1))
        pin.framesForwardKinematics(self.model, self.data, configuration)
        placement = self.data.oMf[self.frame]
        return placement.translation.copy(), placement.rotation.copy(), jacobian


def homogeneous(kind, axis, amount):
    """Return an elementary homogeneous transformation of the paper, such as T_z^l or
    R_y^q."""
    matrix = np.eye(4)
    if kind == "T":
        matrix[axis, 3] = amount
    else:
        i = (axis + 1) % 3
        j = (axis + 2) % 3
        matrix[[i, j], [i, j]] = np.cos(amount)
        matrix[j, i] = np.sin(amount)
        matrix[i, j] = -np.sin(amount)
    return matrix


def without_tool(point):
    """Return the point itself, without the offset of a target."""
    return replace(point, offset_m=(0.0, 0.0, 0.0))


def changed(document, path, value):
    """Return a copy with the value at a path of keys replaced, or removed if the new
    value is None."""
    copy = deepcopy(document)
    *parents, last = path
    inner = copy
    for key in parents:
        inner = inner[key]
    if value is None:
        del inner[last]
    else:
        inner[last] = value
    return copy


def heed_interrupts():
    """Heed interrupts in a new process, also if the tests run in the background, where
    a shell has them ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
