"""Fixed transforms in words, beside pinocchio's rotations."""

import numpy as np
import pinocchio as pin
from hypothesis import given
from hypothesis import strategies as st

from elastocal.exchange.fixed_transforms import displacement_words, express_axis
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.kinematics import poses

angles = st.one_of(st.floats(-np.pi, np.pi), st.sampled_from([np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, np.pi / 2 - 1e-13, 0.0]))


@given(angles, angles, angles, st.tuples(*[st.floats(-2, 2)] * 3))
def test_a_displacement_is_what_its_words_make(roll, pitch, yaw, shift):
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = pin.rpy.rpyToMatrix(roll, pitch, yaw), shift
    chain = parse_chain(" ".join(["Rz(q1)", *displacement_words(transform), "[E]"]), {}, "x")
    position, rotation = poses(chain, np.zeros((1, 1)), chain.end_effector)
    np.testing.assert_allclose(position[0], shift, rtol=0, atol=1e-11)
    np.testing.assert_allclose(rotation[0], transform[:3, :3], rtol=0, atol=1e-11)


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3), st.floats(-3, 3))
def test_a_turn_about_any_axis_is_between_a_rotation_and_its_inverse(axis, turn):
    unit = np.array(axis) / np.linalg.norm(axis)
    before, letter, sign, after, turned = express_axis(np.array(axis))
    chain = parse_chain(" ".join([*before, f"R{letter}({sign}q1)", *after, "[E]"]), {}, "x")
    rotation = poses(chain, np.array([[turn]]), chain.end_effector)[1][0]
    np.testing.assert_allclose(rotation, pin.exp3(turn * unit), rtol=0, atol=1e-11)
    if before:
        np.testing.assert_allclose(turned[:, 2], unit, rtol=0, atol=1e-11)
