"""Kinematics files of makers, read back by the rules of the makers' own descriptions and
by pinocchio, which shares no code with the package."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import yaml
from analysed_robots import analysed

from elastocal.errors import InputError
from elastocal.exchange.makers_kinematics import (
    FRANKA_JOINTS,
    UR_LINKS,
    correct_makers_file,
    find_deviation_m,
    read_makers_file,
)
from elastocal.mechanics.chain import Transform
from elastocal.mechanics.kinematics import compute_poses

# Nominal files, as the makers publish them: facts of the UR10 and of the Franka Panda.
HALF_PI = 1.570796327
UR10 = {
    "shoulder": (0, 0, 0.1273, 0, 0, 0),
    "upper_arm": (0, 0, 0, HALF_PI, 0, 0),
    "forearm": (-0.612, 0, 0, 0, 0, 0),
    "wrist_1": (-0.5723, 0, 0.163941, 0, 0, 0),
    "wrist_2": (0, -0.1157, 0, HALF_PI, 0, 0),
    "wrist_3": (0, 0.0922, 0, HALF_PI, np.pi, np.pi),
}
PANDA = {
    "joint1": (0, 0, 0.333, 0, 0, 0),
    "joint2": (0, 0, 0, -HALF_PI, 0, 0),
    "joint3": (0, -0.316, 0, HALF_PI, 0, 0),
    "joint4": (0.0825, 0, 0, HALF_PI, 0, 0),
    "joint5": (-0.0825, 0.384, 0, -HALF_PI, 0, 0),
    "joint6": (0, 0, 0, HALF_PI, 0, 0),
    "joint7": (0.088, 0, 0, HALF_PI, 0, 0),
    "joint8": (0, 0, 0.107, 0, 0, 0),
}
KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
HASH = "calib_209549117540498681"


def write_ur(path):
    entries = {n: dict(zip(KEYS, v, strict=True)) for n, v in UR10.items()}
    path.write_text(yaml.safe_dump({"kinematics": entries | {"hash": HASH}}), "utf-8")
    return path


def write_franka(path):
    document = {
        name: {"kinematic": dict(zip(KEYS, values, strict=True))}
        for name, values in PANDA.items()
    }
    path.write_text(yaml.safe_dump(document), "utf-8")
    return path


def build_urdf(origins, flange=None):
    """Build a URDF as the makers' descriptions do: each joint about z behind its origin,
    then the fixed flange."""
    parts = ['<robot name="arm"><link name="link0"/>']
    for number, (x, y, z, roll, pitch, yaw) in enumerate(origins, 1):
        moves = flange is None or number < len(origins)
        kind = "continuous" if moves else "fixed"
        parts.append(
            f'<link name="link{number}"/><joint name="joint{number}" type="{kind}">'
            f'<parent link="link{number - 1}"/><child link="link{number}"/>'
            f'<origin xyz="{x!r} {y!r} {z!r}" rpy="{roll!r} {pitch!r} {yaw!r}"/>'
            '<axis xyz="0 0 1"/></joint>'
        )
    return "".join([*parts, "</robot>"])


def compute_by_pinocchio(origins, angles, flange=None):
    """Poses of the last link."""
    model = pin.buildModelFromXML(build_urdf(origins, flange))
    data = model.createData()
    last = model.getFrameId(f"link{len(origins)}")
    poses = []
    for row in angles:
        # A continuous joint of pinocchio has the cosine and the sine of its angle.
        flat = np.column_stack([np.cos(row), np.sin(row)]).ravel()
        pin.framesForwardKinematics(model, data, flat)
        poses.append(data.oMf[last].homogeneous.copy())
    return np.array(poses)


def calibrate(robot):
    """A robot with small transforms before its joints and offsets of them."""
    stream = np.random.default_rng(1)
    errors = 1e-3 * stream.standard_normal((robot.joints, 6))
    offsets_rad = 2e-3 * stream.standard_normal(robot.joints)
    transforms = []
    for transform in robot.chain.transforms:
        if transform.coordinate is not None:
            transforms += [
                Transform("TR"[axis // 3], axis % 3, float(value))
                for axis, value in enumerate(errors[transform.coordinate])
            ]
        transforms.append(transform)
    after = len(transforms)
    points = (replace(robot.chain.end_effector, after=after),)
    chain = replace(robot.chain, transforms=tuple(transforms), points=points)
    return replace(
        robot, chain=chain, reported_offset=robot.reported_offset + offsets_rad
    )


def get_origins(path, is_franka):
    document = yaml.safe_load(path.read_text("utf-8"))
    if is_franka:
        entries = [document[name]["kinematic"] for name in FRANKA_JOINTS]
    else:
        entries = [document["kinematics"][name] for name in UR_LINKS]
    return [tuple(map(float, map(entry.get, KEYS))) for entry in entries]


@pytest.mark.parametrize(("name", "is_franka"), [("ur10", False), ("panda", True)])
def test_the_makers_own_rules_give_the_calibrated_poses(name, is_franka, tmp_path):
    nominal = analysed(name)
    calibrated = calibrate(nominal)
    original = (write_franka if is_franka else write_ur)(tmp_path / "nominal.yaml")
    path = tmp_path / "calibrated.yaml"
    path.write_text(
        correct_makers_file(read_makers_file(original), nominal, calibrated), "utf-8"
    )
    angles = np.random.default_rng(2).uniform(-2.0, 2.0, (20, nominal.joints))
    flange = is_franka or None
    poses = {}
    for which, robot, file in (
        ("before", nominal, original),
        ("after", calibrated, path),
    ):
        made = compute_by_pinocchio(get_origins(file, is_franka), angles, flange)
        position, rotation = compute_poses(
            robot.chain, robot.model_angles(angles), robot.chain.end_effector
        )
        poses[which] = (made, position, rotation)
    made, position, _ = poses["after"]
    np.testing.assert_allclose(made[:, :3, 3], position, atol=3e-9)
    assert np.linalg.norm(position - poses["before"][1], axis=1).min() > 1e-4
    # The last frames of the file and of the chain are turned by the same constant.
    turns = [r.transpose(0, 2, 1) @ m[:, :3, :3] for m, _, r in poses.values()]
    np.testing.assert_allclose(turns[1], turns[0], atol=3e-9)
    np.testing.assert_allclose(turns[1] - turns[1][0], 0.0, atol=3e-9)
    deviation_m = find_deviation_m(
        read_makers_file(path), read_makers_file(original), (nominal, calibrated)
    )
    assert deviation_m < 1e-8


def test_what_a_file_cannot_hold_is_stated_as_a_distance(tmp_path):
    """A ratio of joint 2, by a thousandth."""
    nominal = analysed("ur10")
    ratio = np.diag([1.0, 1.001, 1.0, 1.0, 1.0, 1.0])
    calibrated = replace(nominal, reported_matrix=ratio)
    original = read_makers_file(write_ur(tmp_path / "ur.yaml"))
    path = tmp_path / "calibrated.yaml"
    path.write_text(correct_makers_file(original, nominal, calibrated), "utf-8")
    deviation_m = find_deviation_m(
        read_makers_file(path), original, (nominal, calibrated)
    )
    assert 3e-3 < deviation_m < 9e-3


def test_the_hash_of_the_controller_is_kept(tmp_path):
    nominal = analysed("ur10")
    original = read_makers_file(write_ur(tmp_path / "ur.yaml"))
    document = yaml.safe_load(correct_makers_file(original, nominal, nominal))
    assert document["kinematics"]["hash"] == HASH
    for name, values in UR10.items():
        written = [document["kinematics"][name][key] for key in KEYS[:3]]
        np.testing.assert_allclose(written, values[:3], atol=2e-9)


def test_the_base_may_be_half_a_turn_from_that_of_the_controller(tmp_path):
    """A robot that was imported from a URDF begins at base_link."""
    nominal = analysed("ur10")
    turned = Transform("R", 2, np.pi)
    end = replace(nominal.chain.end_effector, after=len(nominal.chain.transforms) + 1)
    chain = replace(
        nominal.chain, transforms=(turned, *nominal.chain.transforms), points=(end,)
    )
    from_link = replace(nominal, chain=chain)
    original = read_makers_file(write_ur(tmp_path / "ur.yaml"))
    first = correct_makers_file(original, from_link, from_link)
    second = correct_makers_file(original, nominal, nominal)
    for name in UR_LINKS:
        np.testing.assert_allclose(
            [*yaml.safe_load(first)["kinematics"][name].values()][:3],
            [*yaml.safe_load(second)["kinematics"][name].values()][:3],
            atol=2e-9,
        )


@pytest.mark.parametrize("name", ["ur5", "kuka", "panda"])
def test_a_file_of_another_robot_is_refused(name, tmp_path):
    robot = analysed(name)
    original = read_makers_file(write_ur(tmp_path / "ur.yaml"))
    with pytest.raises(InputError, match="another robot"):
        correct_makers_file(original, robot, robot)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "kinematics: {shoulder: {x: 0, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}}",
            "wrist",
        ),
        ("joint1: {kinematic: {x: 0}}", "joint1"),
        ("joint1: {x: 0}", "joint1"),
        ("[]", "found"),
    ],
)
def test_another_file_is_refused_in_a_line(text, message, tmp_path):
    path = tmp_path / "wrong.yaml"
    path.write_text(text, "utf-8")
    with pytest.raises(InputError, match=message) as refusal:
        read_makers_file(path)
    assert "\n" not in str(refusal.value)
