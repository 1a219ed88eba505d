"""URDF files written by hand, and the poses of their links by pinocchio."""

from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin
from hypothesis import strategies as st

from elastocal.mechanics.kinematics import compute_poses

GRAVITY = np.array([0.0, 0.0, -9.80665])

direction = st.tuples(*[st.floats(-1, 1, allow_subnormal=False)] * 3).filter(
    lambda v: np.linalg.norm(v) > 0.1
)
along = st.sampled_from([(1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (-1, 0, 0)])
angle = st.one_of(
    st.floats(-3.2, 3.2),
    st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi, 1.5708, -1.57079632679]),
)
shift = st.tuples(*[st.one_of(st.just(0.0), st.floats(-0.3, 0.3))] * 3)
kinds = st.sampled_from(["revolute", "continuous", "prismatic", "fixed"])
# Chains: kind, origin, roll-pitch-yaw, axis, mass, centre, position of a side link.
segments = st.lists(
    st.tuples(
        kinds,
        shift,
        st.tuples(angle, angle, angle),
        st.one_of(direction, along),
        st.floats(0.1, 5),
        shift,
        shift,
    ),
    min_size=2,
    max_size=7,
).filter(lambda chain: any(segment[0] != "fixed" for segment in chain))


def numbers(values):
    return " ".join(repr(float(value)) for value in values)


def origin(xyz, rpy):
    return f'<origin xyz="{numbers(xyz)}" rpy="{numbers(rpy)}"/>'


def link(name, mass=None, centre=(0.0, 0.0, 0.0), rpy=(0.0, 0.0, 0.0)):
    if mass is None:
        return f"<link name={quoteattr(name)}/>"
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'{origin(centre, rpy)}<mass value="{mass!r}"/>{inertia}'
    return f"<link name={quoteattr(name)}><inertial>{inertial}</inertial></link>"


def joint(
    name,
    parent,
    child,
    kind="revolute",
    xyz=(0.0, 0.0, 0.0),
    rpy=(0.0, 0.0, 0.0),
    axis=(0, 0, 1),
    limits=(-2, 2),
    mimic=None,
):
    parts = [
        f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>",
        origin(xyz, rpy),
    ]
    if kind != "fixed":
        parts.append(f'<axis xyz="{numbers(axis)}"/>')
    if limits is not None and kind in ("revolute", "prismatic"):
        parts.append(
            f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="1" velocity="1"/>'
        )
    if mimic is not None:
        parts.append(
            '<mimic joint="{}" multiplier="{!r}" offset="{!r}"/>'.format(*mimic)
        )
    return (
        f"<joint name={quoteattr(name)} type={quoteattr(kind)}>{''.join(parts)}</joint>"
    )


def robot(*parts, name="made"):
    return (
        f'<?xml version="1.0"?>\n<robot name="{name}">\n'
        + "\n".join(parts)
        + "\n</robot>\n"
    )


def written(folder, *parts, **more):
    path = folder / "made.urdf"
    path.write_text(robot(*parts, **more), encoding="utf-8")
    return path


# An arm whose fourth joint keeps the forearm's angle to the upper arm, as linkages do: six
# joints are commanded.
HALF_PI = np.pi / 2
LINKAGE_COMMANDS = ("j1", "j2", "j3", "j4", "j5", "j6")
LINKAGE_JOINTS = ("j1", "j2", "j3", "linkage", "j4", "j5", "j6")


def write_linkage(folder, shift=(0.1, 0.0, 0.0), multiplier=-1.0, offset=0.1):
    """Write the URDF of this arm; the arguments are of the joint that follows."""
    links = ("base", "post", "arm", "beam", "plate", "forearm", "wrist", "hand", "tool")
    return written(
        folder,
        *map(link, links),
        joint("j1", "base", "post", xyz=(0, 0, 0.4), limits=(-3, 3)),
        joint(
            "j2",
            "post",
            "arm",
            xyz=(0.2, 0, 0.1),
            rpy=(-HALF_PI, 0, 0),
            limits=(-1.5, 1.5),
        ),
        joint("j3", "arm", "beam", xyz=(0.7, 0, 0), limits=(-1.4, 1.4)),
        joint(
            "linkage",
            "beam",
            "plate",
            xyz=shift,
            limits=(-3, 3),
            mimic=("j2", multiplier, offset),
        ),
        joint("j4", "plate", "forearm", xyz=(0.2, 0, 0), rpy=(0, HALF_PI, 0)),
        joint("j5", "forearm", "wrist", xyz=(0, 0, 0.5), rpy=(0, -HALF_PI, 0)),
        joint("j6", "wrist", "hand", xyz=(0.1, 0, 0), rpy=(0, HALF_PI, 0)),
        joint("flange", "hand", "tool", "fixed", xyz=(0.05, 0, 0.15)),
        name="linkage",
    )


class Pinocchio:
    """A URDF in pinocchio. Joints are set by name; all others are at zero, or follow with
    `mimic`."""

    def __init__(self, path, *, mimic=False):
        text = path.read_text(encoding="utf-8")
        self.model = pin.buildModelFromXML(text, mimic=mimic)
        self.model.gravity.linear = GRAVITY
        self.data = self.model.createData()

    def configuration(self, values):
        q = pin.neutral(self.model)
        for name, value in values.items():
            number = self.model.getJointId(name)
            index = self.model.joints[number].idx_q
            if self.model.joints[number].nq == 2:
                q[index : index + 2] = np.cos(value), np.sin(value)
            else:
                q[index] = value
        return q

    def pose(self, base, tip, values):
        """Return position (3,) and rotation (3, 3) of one link in the axes of another."""
        pin.framesForwardKinematics(self.model, self.data, self.configuration(values))
        base_placement, tip_placement = (
            self.data.oMf[self.model.getFrameId(name, pin.FrameType.BODY)]
            for name in (base, tip)
        )
        relative = base_placement.inverse() * tip_placement
        return relative.translation, relative.rotation

    def weight(self, values, names):
        """Return the load of joints by the weight of the links, N m or N."""
        torque = pin.computeGeneralizedGravity(
            self.model, self.data, self.configuration(values)
        )
        return np.array(
            [
                -torque[self.model.joints[self.model.getJointId(name)].idx_v]
                for name in names
            ]
        )


def assert_same_poses(
    robot,
    path,
    base,
    tip,
    set_joints=None,
    count=8,
    within=1e-9,
    names=None,
    *,
    mimic=False,
):
    """Check the poses of a robot against pinocchio, to a nanometre and a nanoradian by
    default, at random joint angles that a controller reports.

    `set_joints` maps the values of joints by name to those of further joints.
    """
    by_pinocchio = Pinocchio(path, mimic=mimic)
    rng = np.random.default_rng(5)
    angles = rng.uniform(-np.pi, np.pi, (count, robot.commands))
    position, rotation = compute_poses(
        robot.chain, robot.model_angles(angles), robot.chain.end_effector
    )
    for index, state in enumerate(angles):
        values = dict(zip(names or robot.command_names, state, strict=True))
        if set_joints:
            values |= set_joints(values)
        expected_position, expected_rotation = by_pinocchio.pose(base, tip, values)
        np.testing.assert_allclose(
            position[index], expected_position, rtol=0, atol=within
        )
        error = pin.log3(expected_rotation.T @ rotation[index])
        assert np.linalg.norm(error) < within
