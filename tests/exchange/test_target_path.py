"""Files of target poses: their contents, and every fault with its row and column."""

import numpy as np
import pytest
from analysed_robots import analysed
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.exchange.pose_table import TableOptions
from elastocal.exchange.target_path import read_target_path, read_target_path_for

HEADER = "x,y,z,rx,ry,rz"
ROWS = ["1.0,0.2,0.5,0.1,0.2,0.3", "1.1,0.2,0.5,0.0,0.0,0.0"]


def write_path(folder, header=HEADER, rows=ROWS):
    path = folder / "path.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_poses_and_optional_loads_and_postures_are_read(tmp_path):
    targets = read_target_path(write_path(tmp_path), 6)
    np.testing.assert_array_equal(targets.position, [[1.0, 0.2, 0.5], [1.1, 0.2, 0.5]])
    np.testing.assert_allclose(
        Rotation.from_matrix(targets.rotation[0]).as_rotvec(), [0.1, 0.2, 0.3]
    )
    assert targets.start is None and targets.wrench is None and len(targets) == 2
    header = HEADER + ",fx,fy,fz,mx,my,mz,q1,q2"
    targets = read_target_path(
        write_path(tmp_path, header, [row + ",1,2,3,4,5,6,0.1,0.2" for row in ROWS]), 2
    )
    np.testing.assert_array_equal(targets.wrench[1], [1, 2, 3, 4, 5, 6])
    forces = read_target_path(
        write_path(tmp_path, HEADER + ",fx,fy,fz", [row + ",1,2,3" for row in ROWS]), 2
    )
    np.testing.assert_array_equal(forces.wrench, [[1, 2, 3, 0, 0, 0]] * 2)
    np.testing.assert_array_equal(targets.start[0], [0.1, 0.2])


@pytest.mark.parametrize(
    ("header", "row", "key", "fragments"),
    [
        ("x,y,z,rx,ry", "1,0,0,0,0", "line 1", ["no column 'rz'"]),
        (HEADER + ",q3", "1,0,0,0,0,0,1", "line 1", ["unknown column 'q3'"]),
        (HEADER + ",fx", "1,0,0,0,0,0,1", "line 1", ["fx without fy, fz"]),
        (
            HEADER + ",fx,fy,fz,mx",
            "1,0,0,0,0,0,1,2,3,4",
            "line 1",
            ["mx without my, mz"],
        ),
        (HEADER, "1,0,left,0,0,0", "line 2, column z", ["'left'"]),
        (
            "# made by hand\n" + HEADER,
            "1,0,1e999,0,0,0",
            "line 3, column z",
            ["'1e999'"],
        ),
        (HEADER, "1100,0,0,0,0,0", "line 2", ["1100", "metres"]),
        (
            HEADER,
            "1,0,0,0,0,90",
            "line 2",
            ["a turn of 90", "rad, not degrees, 9.42 at most"],
        ),
        (HEADER, "1,0,0,0,0,\x1b[2J", "line 2", [r"the character '\x1b'"]),
        (
            HEADER + ",temperature_c",
            "1,0,0,0,0,0,20",
            "line 1",
            ["unknown column 'temperature_c'"],
        ),
        (
            HEADER + ",fx,fy,fz,mx,my,mz",
            "1,0,0,0,0,0,0,0,-1e9,0,0,0",
            "line 2, column fz",
            ["'-1e9'", "1e+06 N"],
        ),
    ],
)
def test_a_fault_names_its_line_and_column(tmp_path, header, row, key, fragments):
    with refused((tmp_path / "path.csv").as_posix(), key, *fragments):
        read_target_path(write_path(tmp_path, header, [row]), 2)


def test_joint_angles_in_degrees_are_refused(tmp_path):
    header = HEADER + "".join(f",q{joint}" for joint in range(1, 7))
    path = write_path(
        tmp_path,
        header,
        [ROWS[0] + ",0.5,-1.2,1.4,0,0.6,0", ROWS[1] + ",45,-60,90,0,30,0"],
    )
    with refused(path, "line 3", "q1 looks like degrees: 45; allowed: rad"):
        read_target_path_for(path, analysed("kuka"))
    assert (
        read_target_path_for(
            write_path(tmp_path, header, [ROWS[0] + ",3.3,-1.2,1.4,0,0.6,0"]),
            analysed("kuka"),
        ).start[0, 0]
        == 3.3
    )


# The first pose of ROWS in millimetres and degrees, as controllers of these makers state
# it: moving axes z, y, x; fixed axes x, y, z; a quaternion.
FIRST = Rotation.from_rotvec([0.1, 0.2, 0.3])
ABC = FIRST.as_euler("ZYX", degrees=True)
WPR = FIRST.as_euler("xyz", degrees=True)
QUATERNION = FIRST.as_quat(scalar_first=True)


@pytest.mark.parametrize(
    ("header", "orientation", "options"),
    [
        ("X;Y;Z;A;B;C", ABC, {"rotation": "euler:ZYX"}),
        ("X;Y;Z;W;P;R", WPR, {"rotation": "euler:xyz"}),
        ("X;Y;Z;rz;ry;rx", ABC, {"rotation": "euler:ZYX"}),
        ("X;Y;Z;qw;qx;qy;qz", QUATERNION, {}),
        (
            "X;Y;Z;q1;q2;q3;q4",
            QUATERNION,
            {"columns": {f"q{axis}": f"q{i}" for i, axis in enumerate("wxyz", 1)}},
        ),
    ],
)
def test_a_path_in_millimetres_and_degrees_is_read_as_its_controller_states_it(
    tmp_path, header, orientation, options
):
    cells = [
        f"{value:.9f}".replace(".", ",") for value in (1000, 200, 500, *orientation)
    ]
    path = write_path(tmp_path, header, [";".join(cells)])
    stated = {"units": {"lengths": "mm", "angles": "deg"}} | options
    targets = read_target_path(path, 6, TableOptions(**stated))
    np.testing.assert_allclose(targets.position, [[1.0, 0.2, 0.5]])
    np.testing.assert_allclose(targets.rotation[0], FIRST.as_matrix(), atol=1e-9)
    assert targets.start is None


@pytest.mark.parametrize(
    ("header", "options", "words"),
    [
        ("X;Y;Z;A;B;C", {}, ["no orientation", "--rotation euler:ZYX"]),
        ("x;y;z;rx;ry;rz", {}, ["unknown notation", "--rotation vector"]),
        (
            "x;y;z;rx;ry;rz",
            {"rotation": "vector", "units": {"angles": "deg"}},
            ["no unit of 'x'", "--lengths mm"],
        ),
        (
            "x;y;z;rx;ry;rz",
            {"rotation": "vector", "units": {"lengths": "mm"}},
            ["no unit of 'rx'", "--angles deg"],
        ),
    ],
)
def test_units_and_notations_of_another_table_are_asked_for(
    tmp_path, header, options, words
):
    path = write_path(tmp_path, header, ["1000;200;500;1;2;3"])
    with refused(path, "", *words):
        read_target_path(path, 6, TableOptions(**options))


def test_a_column_that_no_target_has_can_be_left_out(tmp_path):
    path = write_path(tmp_path, HEADER + ",Nr", [row + ",1" for row in ROWS])
    with refused(path, "line 1", "the unknown column 'Nr'", "--ignore 'Nr'"):
        read_target_path(path, 6)
    assert len(read_target_path(path, 6, TableOptions(ignore=["Nr"]))) == 2


def test_poses_are_selected_with_their_loads_postures_and_lines(tmp_path):
    header = HEADER + ",fx,fy,fz,q1"
    rows = [f"{row},{load},0,0,{load}" for load, row in enumerate(ROWS, 1)]
    path = read_target_path(write_path(tmp_path, header, rows), 1)
    second = path.select(np.array([False, True]))
    assert second.position.tolist() == [[1.1, 0.2, 0.5]] and second.lines == (3,)
    assert second.start.tolist() == [[2.0]] and second.load[0, 0] == 2.0
    unloaded = read_target_path(write_path(tmp_path), 1).select(np.array([True, False]))
    assert unloaded.start is None and unloaded.load.tolist() == [[0.0] * 6]
