"""The text of a robot file, and its fixed transforms against rotations of pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from support import refused

from elastocal.exchange.robot_text import (
    check_imported,
    format_displacement,
    format_robot_file,
    refuse_existing,
    write_robot,
)
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.kinematics import compute_poses

DOCUMENT = {
    "masses": [
        {"link": 1, "mass_kg": 2.0, "centre_m": [1e-5, 0.0, 0.5], "relative_std": 0.2}
    ],
    "chain": "Tz(0.5) Rz(q1) "
    + " ".join(["Tx(0.1) Rx(90deg)"] * 20)
    + " Tz(q2) [flange]",
    "joint_limits_deg": [[-180.0, 180.0], [0.0, 0.5]],
    "joint_names": ["yes", "joint: 2"],
    "name": "arm #1: 'heavy'",
}


@pytest.fixture
def result(tmp_path):
    (tmp_path / "x.urdf").write_text("something")
    return check_imported(
        DOCUMENT, tmp_path / "x.urdf", "by hand", ["masses are guessed"]
    )


def test_the_text_of_a_robot_file_gives_back_its_document(tmp_path, result):
    lines = format_robot_file(result).splitlines()
    assert yaml.safe_load(format_robot_file(result)) == DOCUMENT
    assert (
        lines[0] == "# From x.urdf (sha256 3fc9b689459d738f), by hand."
        and "# Masses are guessed." in lines
    )
    assert any("No compliances" in line for line in lines) and any(
        "payload_kg" in line for line in lines
    )
    assert all(len(line) <= 128 for line in lines)
    path = tmp_path / "x\u2028payload_kg: 9"
    path.write_text("")
    assert (
        yaml.safe_load(format_robot_file(check_imported(DOCUMENT, path, "by hand", ())))
        == DOCUMENT
    )


def test_an_existing_file_is_replaced_only_with_force(tmp_path, result):
    path = tmp_path / "robot.yaml"
    refuse_existing(path, force=False)
    write_robot(result, path)
    assert yaml.safe_load(path.read_text()) == DOCUMENT
    with refused(path, "chain", "metres"):
        check_imported(
            DOCUMENT | {"chain": "Tz(500) Rz(q1) Tz(q2) [flange]"}, path, "by hand", ()
        )
    with refused(path, "", "already", "--force"):
        refuse_existing(path, force=False)
    refuse_existing(path, force=True)
    for path_without_folder in (tmp_path, tmp_path / "none" / "robot.yaml"):
        with refused(path_without_folder, "", "no place"):
            refuse_existing(path_without_folder, force=True)


angles = st.one_of(
    st.floats(-np.pi, np.pi),
    st.sampled_from([np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, np.pi / 2 - 1e-13, 0.0]),
)


@given(angles, angles, angles, st.tuples(*[st.floats(-2, 2)] * 3))
def test_the_tokens_of_a_displacement_give_back_the_displacement(
    roll, pitch, yaw, shift
):
    transform = np.eye(4)
    transform[:3, :3] = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    transform[:3, 3] = shift
    chain = parse_chain(
        " ".join(["Rz(q1)", *format_displacement(transform), "[E]"]), {}, "x"
    )
    position, rotation = compute_poses(chain, np.zeros((1, 1)), chain.end_effector)
    np.testing.assert_allclose(position[0], shift, rtol=0, atol=1e-11)
    np.testing.assert_allclose(rotation[0], transform[:3, :3], rtol=0, atol=1e-11)
