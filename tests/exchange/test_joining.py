"""Positions are joined to a planned sheet and to another file; nothing is guessed."""

from dataclasses import replace

import numpy as np
import pytest
from imported_tables import PLAIN
from support import refused

from elastocal.exchange.measurement_table import (
    ImportOptions,
    OtherFile,
    read_measurement_table,
)

SHEET = """pose,load,repeat,target,done,q1_deg,q1,fx,fy,fz,mx,my,mz,x,y,z
1,0,0,A,,57.296,1.0,0,0,0,0,0,0,,,
1,0,1,A,,57.296,1.0,0,0,0,0,0,0,,,
1,1,0,A,,57.296,1.0,0,0,-200,0,0,0,,,
2,0,0,A,,114.592,2.0,0,0,0,0,0,0,,,
"""
# As a tracker writes it: spaces between thousands, decimal commas and the time of day.
TRACKER = """Pose;Load;Repeat;Target;X [mm];Y [mm];Z [mm];Time
2;0;0;A;4 203,114;-88,021;1\u00a0410,556;09:14:22
1;0;0;A;1 203,114;-88,021;1 410,556;09:15:22
1;0;1;A;2 203,114;-88,021;1 410,556;09:16:22
1;1;0;A;3 203,114;-88,021;1 410,556;09:17:22
"""


def join(folder, tracker, options=None, sheet=SHEET):
    (folder / "sheet.csv").write_text(sheet)
    (folder / "t.csv").write_text(tracker)
    other = OtherFile(folder / "sheet.csv", is_sheet=True)
    options = options or ImportOptions()
    return read_measurement_table(folder / "t.csv", options, None, other)


def change(tracker, line, text):
    lines = tracker.splitlines()
    lines[line - 1] = text
    return "\n".join(lines) + "\n"


def drop_columns(tracker, *numbers):
    lines = []
    for line in tracker.splitlines():
        cells = np.array(line.split(";"))
        lines.append(";".join(np.delete(cells, numbers)))
    return "\n".join(lines)


def test_positions_join_the_sheet_by_pose_load_repeat_and_target(tmp_path):
    table = join(tmp_path, TRACKER).table
    assert table["pose"].tolist() == [2, 1, 1, 1]
    assert table["q1"].tolist() == [2.0, 1.0, 1.0, 1.0]
    assert table["fz"].tolist() == [0.0, 0.0, 0.0, -200.0]
    assert table["repeat"].tolist() == [0, 0, 1, 0]
    np.testing.assert_allclose(table["x"], [4.203114, 1.203114, 2.203114, 3.203114])
    assert table["time_s"].tolist() == [33262.0, 33322.0, 33382.0, 33442.0]


def test_a_pose_may_be_the_number_in_a_name(tmp_path):
    tracker = TRACKER
    for pose in (1, 2):
        tracker = tracker.replace(f"\n{pose};", f"\nP0{pose};")
    imported = join(tmp_path, tracker)
    assert imported.table["pose"].tolist() == [2, 1, 1, 1]
    assert "pose by the number in 'Pose': 'P02' is 2" in imported.notes


@pytest.mark.parametrize(
    ("line", "row", "words"),
    [
        (
            2,
            "3;0;0;A;1;2;3;0",
            ["pose 3, load 0, repeat 0, target A, which"],
        ),
        (2, "2;0;0;B;1;2;3;0", ["target B, which", "--target"]),
        (2, "2.5;0;0;A;1;2;3;0", ["'2.5'", "the number of a pose"]),
        (2, "none;0;0;A;1;2;3;0", ["'none'", "the number of a pose"]),
    ],
)
def test_a_row_that_is_not_in_the_sheet_is_one_line(tmp_path, line, row, words):
    with refused(tmp_path / "t.csv", f"line {line}", *words):
        join(tmp_path, change(TRACKER, line, row).replace(",", "."))


def test_a_row_twice_is_one_line(tmp_path):
    row = TRACKER.splitlines()[1]
    with refused(
        tmp_path / "t.csv",
        "line 3",
        "pose 2, load 0, repeat 0, target A twice",
        "line 2",
    ):
        join(tmp_path, change(TRACKER, 3, row))


def test_a_row_of_the_sheet_without_a_position_is_left_out_if_the_user_says_so(
    tmp_path,
):
    tracker = "\n".join(TRACKER.splitlines()[:-1])
    with refused(tmp_path / "sheet.csv", "line 4", "no position of pose 1, load 1"):
        join(tmp_path, tracker)
    assert len(join(tmp_path, tracker, ImportOptions(skip_empty=True)).table["x"]) == 3


def test_an_order_is_shown_and_asked_for(tmp_path):
    tracker = drop_columns(TRACKER, 0, 1, 2, 3)
    shown = "line 2 is pose 1, load 0, repeat 0, target A; … line 5 is pose 2, load 0"
    with refused(tmp_path / "t.csv", "no column pose", "--join order", shown):
        join(tmp_path, tracker)
    imported = join(tmp_path, tracker, ImportOptions(join="order"))
    assert imported.table["pose"].tolist() == [1, 1, 1, 2]
    assert any(shown in note for note in imported.notes)


def test_an_order_needs_as_many_rows_as_the_sheet_has(tmp_path):
    tracker = drop_columns("\n".join(TRACKER.splitlines()[:-1]), 0, 1, 2, 3)
    with refused(tmp_path / "t.csv", "", "3 rows", "4, as"):
        join(tmp_path, tracker, ImportOptions(join="order"))


def test_rows_of_a_pose_that_nothing_else_tells_apart_are_in_order(tmp_path):
    tracker = drop_columns(TRACKER, 2)
    with refused(tmp_path / "t.csv", "no column repeat", "--join order"):
        join(tmp_path, tracker)
    imported = join(tmp_path, tracker, ImportOptions(join="order"))
    assert imported.table["repeat"].tolist() == [0, 0, 1, 0]
    # All other rows have one partner, so that a row twice is refused all the same.
    twice = change(tracker, 5, tracker.splitlines()[1])
    with refused(tmp_path / "t.csv", "line 5", "pose 2, load 0, target A twice"):
        join(tmp_path, twice, ImportOptions(join="order"))


def test_a_single_target_needs_no_column(tmp_path):
    assert len(join(tmp_path, drop_columns(TRACKER, 3)).table["x"]) == 4
    named = ImportOptions(target="A")
    assert len(join(tmp_path, drop_columns(TRACKER, 3), named).table["x"]) == 4


def test_a_table_with_joint_angles_does_not_look_at_the_sheet(tmp_path):
    tracker = "q1;x;y;z;target\n5;1;2;3;A\n"
    imported = join(tmp_path, tracker, PLAIN)
    np.testing.assert_allclose(imported.table["q1"], np.radians([5.0]))


JOINTS = "Nr,J1,J2\n1,10.0,-40\n2,12.0,-42\n3,-8.0,-38\n"
POINTS = "3   2286.5   -23.7   52.2\n1   2153.7   159.3  81.1\n2  1954.4  433.4  -3.1\n"
TWO_FILES = replace(PLAIN, names=["Nr", "x", "y", "z"])


def join_two(folder, points=POINTS, joints=JOINTS, options=TWO_FILES):
    (folder / "joints.csv").write_text(joints)
    (folder / "t.txt").write_text(points)
    other = OtherFile(folder / "joints.csv")
    return read_measurement_table(folder / "t.txt", options, None, other)


def test_two_files_are_joined_by_their_common_column(tmp_path):
    imported = join_two(tmp_path)
    np.testing.assert_allclose(imported.table["q1"], np.radians([-8.0, 10.0, 12.0]))
    np.testing.assert_allclose(imported.table["x"], [2.2865, 2.1537, 1.9544])
    assert any("by 'Nr'" in note for note in imported.notes)


@pytest.mark.parametrize(
    ("points", "joints", "line", "words"),
    [
        (POINTS.replace("3 ", "4 "), JOINTS, "line 1", ["nr 4, which", "joints.csv"]),
        (POINTS.replace("3 ", "1 "), JOINTS, "line 2", ["nr 1 twice, in line 1"]),
        (POINTS, JOINTS.replace("3,-8", "2,-8"), "line 4", ["nr 2 twice, in line 3"]),
        (POINTS[POINTS.index("1 ") :], JOINTS, "line 4", ["no position of nr 3"]),
    ],
)
def test_a_missing_or_doubled_number_is_one_line(tmp_path, points, joints, line, words):
    with refused(tmp_path, line, *words):
        join_two(tmp_path, points, joints)


def test_two_files_without_a_common_column_are_joined_in_order_if_the_user_says_so(
    tmp_path,
):
    options = replace(TWO_FILES, names=["none", "x", "y", "z"])
    with refused(
        tmp_path / "t.txt", "", "3 rows here, 3 in", "--join order (line 1 to"
    ):
        join_two(tmp_path, options=options)
    imported = join_two(tmp_path, options=replace(options, join="order"))
    np.testing.assert_allclose(imported.table["q1"], np.radians([10.0, 12.0, -8.0]))
    with refused(tmp_path / "t.txt", "", "2 rows", "3, as"):
        join_two(
            tmp_path,
            POINTS[POINTS.index("1 ") :],
            options=replace(options, join="order"),
        )


def test_two_files_are_joined_by_the_nearest_time(tmp_path):
    joints = "time;J1;J2\n0.0;1;1\n1.0;2;2\n2.0;3;3\n3.0;4;4\n"
    points = "x;y;z;time\n1;2;3;1.4\n1;2;3;2.9\n"
    options = replace(PLAIN, join="time")
    imported = join_two(tmp_path, points, joints, options)
    np.testing.assert_allclose(imported.table["q1"], np.radians([2.0, 4.0]))
    with refused(tmp_path / "t.txt", "line 3", "a time 4.5 s from any", "1 s at most"):
        join_two(tmp_path, points.replace("2.9", "7.5"), joints, options)
    with refused(tmp_path / "t.txt", "", "no column of times"):
        join_two(tmp_path, "x;y;z\n1;2;3\n", joints, options)


def test_a_column_that_only_one_file_has_joins_nothing(tmp_path):
    with refused("--join", "", "no column 'Name' in both files", "nr"):
        join_two(tmp_path, options=replace(TWO_FILES, join="Name"))


def test_columns_of_either_file_can_be_left_out(tmp_path):
    joints = JOINTS.replace("J2\n", "J2,Comment\n", 1)
    joints = "\n".join(
        line if "Comment" in line else f"{line},a" for line in joints.splitlines()
    )
    options = replace(TWO_FILES, ignore=["Comment"])
    assert "Comment" in join_two(tmp_path, joints=joints, options=options).ignored
    with refused("--ignore", "", "no column 'Remark'"):
        join_two(tmp_path, options=replace(TWO_FILES, ignore=["Remark"]))
