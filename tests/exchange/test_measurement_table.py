"""Measurements from tables of other programs; ambiguous tables are refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from imported_tables import PLAIN, table
from support import refused, robot_of

from elastocal.exchange.measurement_table import ImportOptions


def test_columns_are_converted_to_si_units_and_forces_by_the_robot_change_their_sign(
    tmp_path,
):
    text = "J1;J2;X;Y;Z;Fz [kN];Time [ms]\n90;-45;1000;2;3;0,5;2000\n"
    row = {name: values[0] for name, values in table(tmp_path, text).table.items()}
    assert (row["q1"], row["q2"], row["x"], row["fz"], row["fx"]) == (
        math.pi / 2,
        -math.pi / 4,
        1.0,
        500.0,
        0.0,
    )
    assert (row["time_s"], row["target"], row["pose"], row["load"], row["repeat"]) == (
        2.0,
        "smr",
        1,
        1,
        0,
    )
    imported = table(tmp_path, text, replace(PLAIN, wrench="by-robot"))
    assert (
        imported.table["fz"].tolist() == [-500.0]
        and not np.signbit(imported.table["fx"]).any()
    )


def test_poses_loads_and_repeats_without_a_column_are_counted(tmp_path):
    rows = ["0,0", "0,0", "0,9", "0,9", "10,0", "10,-9", "10,9", "0.001,9"]
    imported = table(
        tmp_path, "q1,fz,x,y,z\n" + "\n".join(f"{row},1,2,3" for row in rows)
    )
    # 0.001 degrees apart is the same pose; a repeat is the same state again.
    assert imported.table["pose"].tolist() == [1, 1, 1, 1, 2, 2, 2, 1]
    assert imported.table["load"].tolist() == [0, 0, 1, 1, 0, 1, 2, 1]
    assert imported.table["repeat"].tolist() == [0, 1, 0, 1, 0, 0, 0, 2]
    labelled = table(tmp_path, "Pose ID,q1,x,y,z\nB,1,1,2,3\nA,2,1,2,3\nB,1,1,2,3\n")
    assert labelled.table["pose"].tolist() == [1, 2, 1]


def test_the_resolved_options_give_the_same_result(tmp_path):
    text = (
        "made by\nq1 [rad];X [in];Y [in];Z [in];qw;qx;qy;qz;note\n"
        "0,5;1;2;3;1;0;0;0;a\n0,6;1;2;3;0;1;0;0;b\n"
    )
    imported = table(tmp_path, text, ImportOptions(target="smr"))
    assert imported.ignored == ("note",)
    assert (
        imported.options.separator,
        imported.options.decimal,
        imported.options.header,
    ) == (
        "semicolon",
        "comma",
        2,
    )
    assert imported.options.units == {"q1": "rad", "x": "in", "y": "in", "z": "in"}
    again = table(tmp_path, text, imported.options)
    assert again.options == imported.options
    for name, values in imported.table.items():
        np.testing.assert_array_equal(again.table[name], values)


@pytest.mark.parametrize(
    "empty", [",,", "nan,NaN,1", "1,-,–", "#N/A,1,2", "-nan(ind),null,None"]
)
def test_rows_without_a_position_are_left_out_only_on_request(tmp_path, empty):
    text = f"q1,x,y,z\n1,1,2,3\n2,{empty}\n3,1,2,3\n"
    with refused(
        (tmp_path / "t.csv").as_posix(),
        "line 3",
        "--skip-empty" if empty == ",," else "a number such as",
    ):
        table(tmp_path, text)
    imported = table(tmp_path, text, replace(PLAIN, skip_empty=True))
    assert (len(imported.table["x"]), imported.skipped) == (2, 1)


def test_a_table_without_a_header_has_the_stated_columns(
    tmp_path,
):
    names = ["q1", "q2", *(f"t{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4))]
    text = "90,1,0,-1,0,100,1,0,0,200,0,0,1,300\n-90,2,1,0,0,100,0,1,0,200,0,0,1,300\n"
    with refused(tmp_path / "t.csv", "line 1", "--columns q1,q2"):
        table(tmp_path, text)
    imported = table(tmp_path, text, replace(PLAIN, names=names))
    assert imported.table["q1"].tolist() == [math.pi / 2, -math.pi / 2]
    np.testing.assert_allclose(
        [imported.table[axis][0] for axis in "xyz"], [0.1, 0.2, 0.3]
    )
    np.testing.assert_allclose(imported.table["rz"], [math.pi / 2, 0.0])
    assert table(tmp_path, text, imported.options).options == imported.options


def test_several_targets_of_a_row_are_read_from_stated_columns(tmp_path):
    text = "q1,B_x,B_y,B_z,A x,A y,A z,fz\n90,1,2,3,4,5,6,-5\n7,1,2,3,4,5,6,0\n"
    options = replace(
        PLAIN,
        target=None,
        targets={"SMR": ["A x", "A y", "A z"], "B": ["B_x", "B_y", "B_z"]},
    )
    imported = table(tmp_path, text, options)
    assert imported.table["target"].tolist() == ["SMR", "B"] * 2 and imported.table[
        "pose"
    ].tolist() == [1, 1, 2, 2]
    assert imported.table["y"].tolist() == [0.005, 0.002] * 2 and imported.table[
        "fz"
    ].tolist() == [-5, -5, 0, 0]
    again = table(tmp_path, text, imported.options)
    assert (
        again.options == imported.options
        and (again.table["x"] == imported.table["x"]).all()
    )
    arm = replace(robot_of("Rz(q1) Tx(1) [A]"), joint_names=("turntable",))
    assert (
        table(tmp_path, text.replace("q1", "turntable"), options, arm)
        .table["y"]
        .tolist()
        == [0.005, 0.002] * 2
    )
    with refused(tmp_path / "t.csv", "header", "no column 'C'", "z of B"):
        table(tmp_path, text, replace(options, targets={"B": ["B_x", "B_y", "C"]}))
    with refused(tmp_path / "t.csv", "header", "several units"):
        targets = {"A": ["A x [m]", "A y", "A z"], "B": ["B_x", "B_y", "B_z"]}
        table(
            tmp_path, text.replace("A x", "A x [m]"), replace(options, targets=targets)
        )


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        ("2023-05-04 10:20:33|2023-05-04 10:21:33.5", [1683195633.0, 1683195693.5]),
        (
            "2023-05-04T12:20:33+02:00|2023-05-04T10:21:33+00:00",
            [1683195633.0, 1683195693.0],
        ),
        ("1600000000.0|1600000002.0", [1.6e9, 1600000002.0]),
        # Milliseconds since 1970 are no seconds; which of two dates it is nobody knows.
        *(
            (cells, None)
            for cells in (
                "1600000000000|1600000002000",
                "05/04/2023 10:20|06/04/2023 10:20",
                "10:20:33|2023-05-04",
            )
        ),
    ],
)
def test_times_are_numbers_or_dates_or_left_out_with_a_note(tmp_path, cells, seconds):
    text = "q1,x,y,z,Time\n" + "".join(
        f"{number},1,2,3,{cell}\n" for number, cell in enumerate(cells.split("|"))
    )
    imported = table(tmp_path, text)
    if seconds is None:
        assert (
            "time_s" not in imported.table
            and imported.ignored == ("Time",)
            and "'Time' not read" in imported.notes[0]
        )
        assert table(tmp_path, text, replace(PLAIN, ignore=["Time"])).notes == ()
        with refused(tmp_path / "t.csv", "column Time", "--ignore 'Time'"):
            table(tmp_path, text, replace(PLAIN, columns={"time_s": "Time"}))
        return
    np.testing.assert_allclose(imported.table["time_s"], seconds, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(
        table(tmp_path, text, imported.options).table["time_s"],
        imported.table["time_s"],
    )


@pytest.mark.parametrize(
    ("text", "options", "fragments"),
    [
        (
            "q1,x,y,z\n0,1,2,3\n",
            ImportOptions(target="a"),
            ["no unit of 'q1'", "--angles"],
        ),
        (
            "q1 [deg],x,y,z\n0,1,2,3\n",
            ImportOptions(target="a"),
            ["no unit of 'x'", "--lengths"],
        ),
        (
            "q1,x,y,z\n0,1,2,3\n",
            ImportOptions(units=PLAIN.units),
            ["no column target", "--target"],
        ),
        ("q1,x,y,z,rx,ry,rz\n0,1,2,3,0,0,0\n", PLAIN, ["rx, ry, rz", "euler:ZYX"]),
        ("q1,q3,x,y,z\n0,0,1,2,3\n", PLAIN, ["no column q2"]),
        ("x,y,z\n1,2,3\n", PLAIN, ["no joint angles", "--column q1"]),
        (
            "J1 [deg],J2 [deg],L [mm]\n0,1,400\n",
            PLAIN,
            ["'L [mm]' and no position", "distances alone"],
        ),
        ("q1,x,y,z\n0,1,nan,3\n", PLAIN, ["line 2, column y", "a number such as"]),
        ("q1,x,y,z\n0,1,1_0,3\n", PLAIN, ["line 2, column y", "'1_0'"]),
        (
            "q1,x,y,z,u95 [mm]\n0,1,2,3,1e-20\n",
            PLAIN,
            ["line 2, column u95 [mm]", "'1e-20'", "laser"],
        ),
        (
            "q1,x,y,z,pose\n0,1,2,3,99999999999\n",
            PLAIN,
            ["line 2, column pose", "an integer, up to"],
        ),
        (
            "q1,x,y,z,qw,qx,qy,qz\n0,1,2,3,1,1,0,0\n",
            PLAIN,
            ["line 2, column qw", "length 1"],
        ),
        ("q1,x [bananas],y,z\n0,1,2,3\n", PLAIN, ["unit of 'x [bananas]'", "mm"]),
        (
            "q1,x,y,z\n0,1,2,3\n",
            ImportOptions(columns={"qq": "x"}),
            ["--column", "'qq'"],
        ),
        ("q1,x,y,z\n0,1,2,3\n", ImportOptions(columns={"q1": "Q"}), ["no column 'Q'"]),
        (
            "q1,x,y,z\n0,1,2,3\n",
            ImportOptions(units=PLAIN.units, rotation="rpy"),
            ["--rotation", "'rpy'", "euler:"],
        ),
    ],
)
def test_an_error_states_the_option_that_resolves_it(
    tmp_path, text, options, fragments
):
    source = (
        fragments[0]
        if fragments[0].startswith("--")
        else (tmp_path / "t.csv").as_posix()
    )
    with refused(source, "", *fragments):
        table(tmp_path, text, options)


@pytest.mark.parametrize("name", ["=cmd", "@x", "a\u202eb"])
def test_a_target_name_that_is_a_formula_or_reverses_text_is_refused(tmp_path, name):
    with refused("", "", ""):
        table(
            tmp_path, f"q1,x,y,z,target\n1,1,2,3,{name}\n", replace(PLAIN, target=None)
        )
