"""MuJoCo finds the robot at rest where the package does."""

from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from analysed_robots import analysed
from made_loop_tables import CAMPAIGNS
from made_models import FOLLOWING, calibrate_exactly, equip, make_calibrated
from synthetic import make_states

from elastocal.application.calibrated import predict_poses
from elastocal.application.mjcf import build_mjcf
from elastocal.application.model_file import describe_model

# Effects that rigid bodies and springs have. The law of a payload loads the joints alone.
GEOMETRY = ("joint_offset@2", "link_geometry@3", "link_geometry@6")
SPRINGS = (*GEOMETRY, "base_compliance", "joint_tilt@2", "flange_flexibility")
PAYLOAD = (*GEOMETRY, "payload")
STEPS = 30


def describe(calibrated):
    return describe_model(calibrated, CAMPAIGNS["named"])


def come_to_rest(model, command, wrench, site):
    """Pose of a site at rest under a wrench at the origin of its body, by Newton's
    method on the forces that MuJoCo computes."""
    data = mujoco.MjData(model)
    data.ctrl[:] = command
    motors = model.actuator_trnid[:, 0]
    data.qpos[motors] = command
    stiffness = model.jnt_stiffness.copy()
    stiffness[motors] = model.actuator_gainprm[:, 0]
    body = model.site(site).bodyid[0]
    for _ in range(STEPS):
        mujoco.mj_forward(model, data)
        # The wrench acts at the origin of the last frame, which is the site without
        # offset, and xfrc_applied at the centre of mass.
        at = data.site(site).xpos
        jacobian = np.zeros((6, model.nv))
        mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], at, body)
        force = data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias
        data.qpos[:] += (force + jacobian.T @ wrench) / stiffness
    mujoco.mj_forward(model, data)
    return data.site(site).xpos.copy(), data.site(site).xmat.reshape(3, 3).copy()


@pytest.mark.parametrize("effects", [SPRINGS, PAYLOAD], ids=["springs", "payload"])
@pytest.mark.parametrize("name", ["kuka", "gp180"])
def test_mujoco_comes_to_rest_where_the_package_does(name, effects):
    """Loads are weights, forces and moments; both robots stand at random postures."""
    calibrated = calibrate_exactly(analysed(name), *effects)
    robot = calibrated.robot
    contents = describe(calibrated)
    exported = build_mjcf(contents)
    assert exported.left_out == ()
    model = mujoco.MjModel.from_xml_string(exported.text)
    states = make_states(robot.joints, 12, 4, force=300.0, span=0.8)
    low, high = robot.joint_limits.T
    middle = 0.5 * (low + high)
    angles = middle + 0.5 * (high - low) * states.joint_angles
    states = replace(states, joint_angles=angles)
    position, rotation = predict_poses(
        calibrated, robot.reported_angles(states.joint_angles), states.wrench
    )
    rigid = predict_poses(
        calibrated, robot.reported_angles(states.joint_angles), 0.0 * states.wrench
    )[0]
    assert np.linalg.norm(position - rigid, axis=1).max() > 1e-3
    for number in range(len(states)):
        reached, turned = come_to_rest(
            model,
            states.joint_angles[number],
            states.wrench[number],
            contents.kinematics.end_effector,
        )
        np.testing.assert_allclose(reached, position[number], atol=1e-9, rtol=0.0)
        np.testing.assert_allclose(turned, rotation[number], atol=1e-9, rtol=0.0)


def test_effects_that_no_spring_has_are_named():
    exported = build_mjcf(describe(make_calibrated("iiwa14")))
    assert "joint_offset@1" not in exported.left_out
    assert "declared_weight" not in exported.left_out
    assert {"lost_motion@1", "stiffening@1[two slopes]"} & {*exported.left_out}
    assert any(key.startswith("transmission_harmonic") for key in exported.left_out)


def test_joints_that_follow_are_named_beside_their_servos():
    """The constraint is not active: the joint yields by a spring of its own."""
    contents = describe(calibrate_exactly(equip(FOLLOWING)))
    model = mujoco.MjModel.from_xml_string(build_mjcf(contents).text)
    assert (model.nu, model.neq) == (7, 1) and not model.eq_active0[0]
    assert (model.eq_obj1id[0], model.eq_obj2id[0]) == (2, 1)
    robot = equip(FOLLOWING)
    offset, multiplier = model.eq_data[0, :2]
    angles = robot.model_angles(np.linspace(-0.5, 0.4, robot.commands))
    assert angles[2] == pytest.approx(multiplier * angles[1] + offset)


def test_servos_have_the_stiffness_of_the_gears_and_the_names_of_the_joints():
    calibrated = calibrate_exactly(analysed("kuka"))
    contents = describe(calibrated)
    root = ElementTree.fromstring(build_mjcf(contents).text)
    servos = root.findall("actuator/position")
    assert [servo.get("name") for servo in servos] == [f"joint{j}" for j in range(1, 7)]
    gains = [float(servo.get("kp")) for servo in servos]
    compliances = [term.value for term in contents.springs]
    np.testing.assert_allclose(gains, 1.0 / np.array(compliances))


def test_a_simulation_stays_where_the_robot_rests():
    """Every body has inertia enough for a step of two milliseconds."""
    calibrated = calibrate_exactly(analysed("gp180"), *SPRINGS)
    exported = build_mjcf(describe(calibrated))
    model = mujoco.MjModel.from_xml_string(exported.text)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    assert np.isfinite(data.qpos).all()
    assert np.abs(data.qpos).max() < 0.02
