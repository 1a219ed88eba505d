"""Positions count for the joint that the cells beside them name."""

import numpy as np
import pytest
from support import refused, robot_of

from elastocal.exchange.measurement_table import ImportOptions, read_measurement_table

PLAIN = ImportOptions(units={"angles": "rad", "lengths": "m"}, target="a")
NAMES = ("shoulder_pan", "shoulder_lift", "elbow")


def table(folder, text, robot=None):
    (folder / "t.csv").write_text(text)
    return read_measurement_table(folder / "t.csv", PLAIN, robot)


def three_joints():
    from dataclasses import replace

    return replace(robot_of("Rz(q1) Tx(1) Ry(q2) Tx(1) Ry(q3) [A]"), joint_names=NAMES)


HEADS = {
    "rosbag": ("field.name{}", "field.position{}"),
    "PlotJuggler": ("/joint_states/name[{}]", "/joint_states/position[{}]"),
    "a list": ("names_{}", "positions_{}"),
    "points": ("/joint_states/name.{}", "/joint_states/position.{}"),
}


@pytest.mark.parametrize("program", HEADS)
def test_positions_are_of_the_joints_that_names_say_in_whatever_order(tmp_path, program):
    names, positions = ([head.format(number) for number in range(4)] for head in HEADS[program])
    velocities = [position.replace("position", "velocity") for position in positions]
    head = ",".join(["%time", *names, *positions, *velocities, "x", "y", "z"])
    rows = "".join(f"{row},elbow,gripper,shoulder_lift,shoulder_pan,3,9,2,1,7,7,7,7,1,2,3\n" for row in range(2))
    found = table(tmp_path, f"{head}\n{rows}", three_joints())
    assert [found.table[f"q{joint}"][0] for joint in (1, 2, 3)] == [1.0, 2.0, 3.0]
    assert set(found.ignored) == {*names, positions[1], *velocities}
    # The columns that were found out need no robot.
    again = read_measurement_table(tmp_path / "t.csv", found.options)
    np.testing.assert_array_equal(again.table["q2"], found.table["q2"])
    with refused(tmp_path / "t.csv", "header", "elbow, gripper", "--robot FILE", "--column q1="):
        table(tmp_path, f"{head}\n{rows}")


def test_names_that_count_joints_need_no_robot(tmp_path):
    found = table(tmp_path, "name0,name1,position0,position1,x,y,z\njoint_2,joint_1,2,1,1,2,3\n")
    assert [found.table[f"q{joint}"][0] for joint in (1, 2)] == [1.0, 2.0]


def test_a_name_that_changes_is_refused_with_its_line(tmp_path):
    text = "name0,name1,name2,position0,position1,position2,x,y,z\n" + "elbow,shoulder_pan,shoulder_lift,3,1,2,1,2,3\n" * 2
    text += "shoulder_pan,elbow,shoulder_lift,3,1,2,1,2,3\n"
    with refused(tmp_path / "t.csv", "line 4, column name0", "'shoulder_pan'", "'elbow' in line 2"):
        table(tmp_path, text, three_joints())


def test_positions_without_names_are_a_question(tmp_path):
    with refused(tmp_path / "t.csv", "header", "no joint angles", "position0"):
        table(tmp_path, "position0,position1,x,y,z\n1,2,1,2,3\n")
