"""Fixed transforms in words, beside pinocchio's rotations."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elastocal.exchange.fixed_transforms import (
    axis_rotation,
    displacement_words,
    express_axis,
    rotation_about,
    shift_word,
    turn_word,
    yaw_pitch_roll,
)
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.kinematics import poses

angles = st.one_of(st.floats(-np.pi, np.pi), st.sampled_from([np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, np.pi / 2 - 1e-13, 0.0]))


@given(angles, angles, angles)
def test_any_rotation_comes_back_at_a_right_pitch_too(roll, pitch, yaw):
    rotation = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    found = yaw_pitch_roll(rotation)
    np.testing.assert_allclose(pin.rpy.rpyToMatrix(*reversed(found)), rotation, rtol=0, atol=1e-11)


@given(angles, angles, angles, st.tuples(*[st.floats(-2, 2)] * 3))
def test_a_displacement_is_what_its_words_make(roll, pitch, yaw, shift):
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = pin.rpy.rpyToMatrix(roll, pitch, yaw), shift
    chain = parse_chain(" ".join(["Rz(q1)", *displacement_words(transform), "[E]"]), {}, "x")
    position, rotation = poses(chain, np.zeros((1, 1)), chain.end_effector)
    np.testing.assert_allclose(position[0], shift, rtol=0, atol=1e-11)
    np.testing.assert_allclose(rotation[0], transform[:3, :3], rtol=0, atol=1e-11)


def test_nothing_is_left_out_and_signs_stand_before_numbers():
    assert displacement_words(np.eye(4)) == []
    assert (shift_word("x", -0.25), turn_word("y", np.pi / 2), shift_word("z", 1e-14)) == ("Tx(-0.25)", "Ry(90deg)", None)
    assert shift_word("x", 1e-7) == "Tx(0.0000001)"


@pytest.mark.parametrize("axis", [(0, 0, 2.0), (0, -1, 0), (1, 1e-15, 0)])
def test_an_axis_of_the_frame_is_itself(axis):
    before, letter, sign, after = express_axis(np.array(axis))
    assert before == after == [] and letter == "xyz"[int(np.argmax(np.abs(axis)))] and (sign == "-") == (min(axis) < 0)
    np.testing.assert_array_equal(axis_rotation(np.array(axis)), np.eye(3))


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3), st.floats(-3, 3))
def test_a_turn_about_any_axis_is_between_a_rotation_and_its_inverse(axis, turn):
    unit = np.array(axis) / np.linalg.norm(axis)
    before, letter, sign, after = express_axis(np.array(axis))
    chain = parse_chain(" ".join([*before, f"R{letter}({sign}q1)", *after, "[E]"]), {}, "x")
    rotation = poses(chain, np.array([[turn]]), chain.end_effector)[1][0]
    np.testing.assert_allclose(rotation, pin.exp3(turn * unit), rtol=0, atol=1e-11)
    if before:
        np.testing.assert_allclose(axis_rotation(np.array(axis))[:, 2], unit, rtol=0, atol=1e-11)


@pytest.mark.parametrize("letter", "xyz")
def test_a_rotation_about_an_axis_is_pinocchios(letter):
    vector = 0.7 * np.eye(3)["xyz".index(letter)]
    np.testing.assert_allclose(rotation_about(letter, 0.7), pin.exp3(vector), rtol=0, atol=1e-15)
