"""A Denavit-Hartenberg table is read in its units, and every fault is one line with its line and column."""

import math

import pytest
from support import refused

from elastocal.exchange.dh_table import DhOptions, read_dh_table

PLAIN = DhOptions("deg", "m")
HEADER = "joint,theta_offset_deg,d_m,a_m,alpha_deg,type\n"


def table(folder, text, name="arm.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_row_is_in_si_units(tmp_path):
    text = "# maker's manual\njoint; theta_offset_deg; d_mm; a_m; alpha; lower; upper; mass_kg; cx; cy; cz_m; point; type\n"
    path = table(tmp_path, text + "\nbase;90;250;-0.1;-pi/2;-1;pi;3;10;0;0.2;elbow;R\n; ;0;0;2*pi; ; ;;;;;;f\n")
    (row, fixed), _ = read_dh_table(path, DhOptions("rad", "mm"))
    assert (row.joint, row.kind, row.point, row.where) == ("base", "R", "elbow", "line 4")
    assert (row.theta, row.d, row.a, row.alpha) == pytest.approx((math.pi / 2, 0.25, -0.1, -math.pi / 2))
    assert row.limits == pytest.approx((-1.0, math.pi)) and row.mass_kg == 3.0
    assert row.centre_m == pytest.approx((0.01, 0.0, 0.2))
    assert (fixed.kind, fixed.limits, fixed.mass_kg, fixed.alpha) == ("F", None, None, pytest.approx(2 * math.pi))


def test_yaml_says_the_same(tmp_path):
    csv = table(tmp_path, HEADER + "1,0,0.1625,0,90,R\n2,-90,0,-0.425,0,R\n")
    yaml = table(
        tmp_path,
        "- {joint: 1, theta_offset_deg: 0, d_m: 0.1625, a_m: 0, alpha_deg: 90}\n"
        "- {joint: 2, theta_offset_deg: -90, d_m: 0, a_m: -0.425, alpha_deg: 0, type: R}\n",
        "arm.yaml",
    )
    for one, other in zip(read_dh_table(csv)[0], read_dh_table(yaml)[0], strict=True):
        assert vars(one) | {"where": ""} == vars(other) | {"where": ""}
    assert [row.where for row in read_dh_table(yaml)[0]] == ["row 1", "row 2"]


FAULTS = {
    "no number": (HEADER + "1,0,0.1,0,90,R\n2,0,x,0,90,R\n", "line 3, d_m", ["'x'"]),
    "pi in degrees": (HEADER + "1,0,0.1,0,pi/2,R\n", "line 2, alpha_deg", ["'pi/2'"]),
    "not finite": (HEADER + "1,0,inf,0,90,R\n", "line 2, d_m", ["'inf'"]),
    "nothing": (HEADER + "1,0,,0,90,R\n", "line 2, d_m", ["nothing"]),
    "a type": (HEADER + "1,0,0,0,90,spherical\n", "line 2, type", ["'spherical'", "revolute"]),
    "too few cells": (HEADER + "1,0,0,0,90\n", "line 2", ["5 cells", "6"]),
    "no column": ("d_m,a_m\n0,0\n", "header", ["no column alpha"]),
    "unknown column": ("d_m,a_m,alfa_deg\n0,0,0\n", "header", ["'alfa_deg'", "'alpha_deg'?"]),
    "a column in two units": ("d_m,d_mm,a,alpha\n0,0,0,0\n", "header", ["d twice"]),
    "one limit": ("d,a,alpha,lower,upper\n0,0,0,1,\n", "line 2, lower and upper", ["both"]),
    "limits the wrong way": ("d,a,alpha,lower,upper\n0,0,0,9,-9\n", "line 2, lower and upper", ["9 to -9"]),
    "a mass without a centre": ("d,a,alpha,mass_kg\n0,0,0,9\n", "line 2, cx, cy, cz", ["three numbers"]),
    "a centre without a mass": ("d,a,alpha,cx\n0,0,0,9\n", "line 2, mass_kg", ["the mass"]),
    "a mass of nothing": ("d,a,alpha,mass_kg,cx,cy,cz\n0,0,0,0,0,0,0\n", "line 2, mass_kg", ["more than 0"]),
    "underscores": (HEADER + "1,0,0.1,0,9_0,R\n", "line 2, alpha_deg", ["'9_0'"]),
    "more turns than a joint counts": (HEADER + "1,0,0.1,0,1e9,R\n", "line 2, alpha_deg", ["'1e9'", "1000 turns at most"]),
    "an endless cell": (HEADER + f"1,0,{'1' * 200_000},0,90,R\n", "line 2", ["field limit"]),
    "more rows than a chain has room for": ("d,a,alpha\n" + "0,0,90\n" * 501, "", ["501 rows", "at most 500"]),
    "no joint": ("d,a,alpha,type\n0,0,0,F\n", "", ["no joint"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_names_its_line_and_column(tmp_path, fault):
    text, key, words = FAULTS[fault]
    path = table(tmp_path, text)
    with refused(path, key, *words):
        read_dh_table(path, PLAIN)


def test_commas_are_decimal_marks_only_where_an_option_says_so(tmp_path):
    path = table(tmp_path, "theta_offset_deg;d_mm;a_mm;alpha_deg\n0;162,5;0;90\n-1,5;0;-1425,25;0\n")
    with refused(path, "", "commas", "--decimal comma"):
        read_dh_table(path, PLAIN)
    (first, second), _ = read_dh_table(path, DhOptions(decimal="comma"))
    assert (first.d, second.a, second.theta) == pytest.approx((0.1625, -1.42525, math.radians(-1.5)))
    for cell in ("1,425", "1.425,5", "1 425"):
        with refused(table(tmp_path, f"d;a;alpha\n{cell};0;90\n"), "line 2", repr(cell), "--"):
            read_dh_table(path, PLAIN)


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        ("# d_m,a_m,alpha_deg\n0.5,0,90\n", "utf-8"),
        ("% DH of the cell\nd_m\ta_m\talpha_deg\t\t\n0.5\t0\t90\t\t\n\t\t\t\t\n", "utf-16"),
        ("// größe\nd_m,a_m,alpha_deg\n0.5,0,90,,\n", "cp1252"),
    ],
)
def test_a_table_may_be_in_any_dialect(tmp_path, text, encoding):
    (tmp_path / "arm.csv").write_bytes(text.encode(encoding))
    (row,), _ = read_dh_table(tmp_path / "arm.csv")
    assert (row.d, row.a, row.alpha) == (0.5, 0.0, pytest.approx(math.pi / 2))


@pytest.mark.parametrize(("name", "text"), [("arm.yaml", "rows: 3"), ("arm.txt", "x"), ("arm.yaml", "[]"), ("arm.yaml", "- 3")])
def test_what_is_no_table_is_refused(tmp_path, name, text):
    with refused(tmp_path / name, ""):
        read_dh_table(table(tmp_path, text, name), PLAIN)


ROW = "0,0.1,0.2,90"


@pytest.mark.parametrize(
    ("text", "name", "option"),
    [
        ("theta_offset,d_m,a_m,alpha_deg\n", "theta_offset", "--angles"),
        ("theta_offset_deg,d_m,a,alpha_deg\n", "a", "--lengths"),
        ("theta_offset [deg],d [m],a [m],alpha\n", "alpha", "--angles"),
        ("theta_offset,d,a,alpha\ndeg,m,,deg\n", "a", "--lengths"),
    ],
)
def test_a_unit_that_nothing_states_is_asked_for(tmp_path, text, name, option):
    with refused(tmp_path / "arm.csv", "header", f"no unit of {name!r}", option):
        read_dh_table(table(tmp_path, f"{text}{ROW}\n"))


@pytest.mark.parametrize(
    "head",
    [
        "theta_offset_rad,d_mm,a_mm,alpha_rad",
        "theta_offset [rad],d [mm],a (mm),alpha(rad)",
        "theta_offset,d,a,alpha\nrad,mm,mm,rad",
        "theta_offset,d,a,alpha\n[rad],[mm],[mm],(rad)",
        "theta_offset_rad,d,a_mm,alpha\nrad,mm,mm,rad",
    ],
)
def test_units_stand_behind_names_in_brackets_or_in_a_row_of_their_own(tmp_path, head):
    (row,), notes = read_dh_table(table(tmp_path, f"{head}\n{ROW}\n"))
    assert (row.d, row.a, row.alpha) == pytest.approx((1e-4, 2e-4, 90.0))
    assert "d in mm" in notes[0] and "alpha in rad" in notes[0]


def test_units_that_contradict_each_other_or_are_of_something_else_are_refused(tmp_path):
    for head, words in (
        ("theta_offset_deg,d_mm,a_m,alpha_deg\ndeg,m,m,deg", "'d_mm' and 'm'"),
        ("theta_offset_deg,d_deg,a_m,alpha_deg", "'d_deg' in deg"),
    ):
        with refused(tmp_path / "arm.csv", "header", words):
            read_dh_table(table(tmp_path, f"{head}\n{ROW}\n"))


@pytest.mark.parametrize("name", ["arm.csv", "arm.yaml"])
def test_columns_that_nobody_needs_are_left_out_where_that_is_stated(tmp_path, name):
    text = {
        "arm.csv": "maker;d_m;a_m;alpha_deg;dynamics\nx;0.1;0;90;a,b\n",
        "arm.yaml": "- {maker: x, d_m: 0.1, a_m: 0, alpha_deg: 90, dynamics: 3}\n",
    }[name]
    path = table(tmp_path, text, name)
    with refused(path, "header", "'maker'", "--ignore 'maker'"):
        read_dh_table(path)
    (row,), notes = read_dh_table(path, DhOptions(ignore=("maker", "dynamics")))
    assert row.d == 0.1 and "not used: maker, dynamics" in notes
    with refused(path, "", "'serial'"):
        read_dh_table(path, DhOptions(ignore=("serial",)))


def test_a_limit_in_another_kind_of_unit_is_asked_for(tmp_path):
    path = table(tmp_path, "d_m,a_m,alpha_deg,type,lower_deg,upper_deg\n0,0,0,P,0,2\n")
    with refused(path, "line 2, lower_deg", "lengths", "--lengths"):
        read_dh_table(path)
