"""Whatever other people's files hold, an importer gives what robot files and campaigns may hold, or one line."""

import warnings

import numpy as np
import pytest
from fuzzed import BYTES, CELLS, SCALARS, any_document, damaged, holds, over, tables
from hypothesis import given
from hypothesis import strategies as st
from made_urdf import joint, link, robot

from elastocal.campaigns.measurements import write_measurements
from elastocal.campaigns.reading import read_robot
from elastocal.exchange.csv_dialect import DECIMALS, SEPARATORS
from elastocal.exchange.dh import DhOptions, robot_from_dh
from elastocal.exchange.measurement_table import (
    ImportOptions,
    import_options_text,
    read_import_options,
    read_measurement_table,
)
from elastocal.exchange.robot_text import write_robot
from elastocal.exchange.target_path import read_target_path
from elastocal.exchange.urdf import robot_from_urdf

URDF = robot(
    link("a"),
    link("b", 4.0, (0, 0, 0.1)),
    link("c", 2.0),
    link("d"),
    joint("j1", "a", "b"),
    joint("j2", "b", "c", "continuous"),
    joint("j3", "c", "d", "prismatic"),
)
# What stands in attributes of people and of those who mean harm.
WORDS = st.one_of(
    SCALARS.map(str),
    CELLS,
    st.sampled_from(
        ["a", "d", "j1", "fixed", "planar", "0 0 1", "1e308 0 0", "0 0 1e-320", "1_0", "-1", "1e16", "${x}", "٣ 0 0"]
    ),
)
ELEMENTS = (
    '<mimic joint="j1" multiplier="-1" offset="1e9"/>',
    '<mimic joint="j2"/>',
    '<axis xyz="1 1 1"/>',
    '<limit lower="-1e99" upper="1e99"/>',
    '<inertial><mass value="1e12"/><origin xyz="0 0 1e12" rpy="1 2 3"/></inertial>',
    '<joint name="k" type="fixed"><parent link="d"/><child link="a"/></joint>',
    '<link name="e"/>',
    '<!DOCTYPE robot [<!ENTITY a "b">]>',
    "&a;",
    '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="/etc/passwd"/>',
    "<![CDATA[",
    "<!--",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("imports")


def quietly(read):
    """As `holds`; a warning of numpy would stand on the terminal beside the line."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        holds(read)


def imported(folder, make):
    """A robot is imported: its file, once written, is one that is read."""
    result = make()
    write_robot(result, folder / "robot.yaml")
    again = read_robot(folder / "robot.yaml")
    assert again.joints == result.robot.joints and again.name == result.robot.name
    assert np.isfinite(again.joint_limits).all() and all(np.isfinite(mass.centre_m).all() for mass in again.masses)


@st.composite
def urdf_files(draw):
    """A URDF with attributes changed, elements put in or bytes damaged."""
    text = URDF
    for _ in range(draw(st.integers(1, 3))):
        pieces = text.split('"')
        if len(pieces) > 2 and draw(st.booleans()):
            # Every second piece stands between quotes.
            place = 2 * draw(st.integers(0, len(pieces) // 2 - 1)) + 1
            pieces[place] = draw(WORDS).replace('"', "&quot;").replace("<", "&lt;")
            text = '"'.join(pieces)
        else:
            parts = text.split(">")
            place = draw(st.integers(0, len(parts) - 1))
            text = ">".join([*parts[:place], parts[place] + ">" + draw(st.sampled_from(ELEMENTS)), *parts[place + 1 :]])
    content = text.encode(draw(st.sampled_from(["utf-8", "utf-8", "utf-8", "utf-16"])), "surrogatepass")
    return draw(damaged(content)) if draw(st.integers(0, 3)) == 0 else content


@given(urdf_files() | BYTES, st.sampled_from([("a", "d"), ("a", "c"), ("b", "a"), ("", "x\n")]))
def test_robots_as_urdf(folder, content, ends):
    path = folder / "arm.urdf"
    path.touch()
    over(path, content, lambda: quietly(lambda: imported(folder, lambda: robot_from_urdf(path, *ends))))


NUMBERS = st.floats().map(repr) | st.sampled_from(["1e308", "-1e-320", "1e12", "1e16", "1_0", "٣", "inf", "9" * 400])


@given(st.sampled_from(["xyz", "rpy", "lower", "upper", "value"]), st.lists(NUMBERS, min_size=3, max_size=3))
def test_numbers_of_robots_as_urdf(folder, name, numbers):
    """In each place where one of a name stands, one after another."""
    path = folder / "arm.urdf"
    path.touch()
    parts = URDF.split(f' {name}="')
    for place in range(1, len(parts)):
        old, rest = parts[place].split('"', 1)
        new = f'{" ".join(numbers[: len(old.split())])}"{rest}'
        content = f' {name}="'.join([*parts[:place], new, *parts[place + 1 :]])
        over(path, content.encode(), lambda: quietly(lambda: imported(folder, lambda: robot_from_urdf(path, "a", "d"))))


DH = (
    "joint,theta_offset_deg,d_mm,a_m,alpha,type,lower_deg,upper_deg,point\n"
    "A,0,162,0.1,90,R,-90,90,elbow\nB,-90,0,-0.4,0,F,,,\nC,0,0.1,0,1.5,R,,,\n"
)
# A row more is added.
ANGLES = "d,theta_offset,a,alpha\n0.1,0,0.1,1.5\n"
ANGLE_CELLS = ("pi/2", "9" * 200, "1e308", "P", "F", "-1e-320")


def robot_of_table(folder, content, modified=False, angles="rad"):
    path = folder / "arm.csv"
    path.touch()
    over(
        path, content, lambda: quietly(lambda: imported(folder, lambda: robot_from_dh(path, modified, DhOptions(angles, "m"))))
    )


@given(BYTES | tables(DH.encode()) | damaged(DH.encode()), st.booleans(), st.sampled_from(["deg", "rad"]))
def test_denavit_hartenberg_tables(folder, content, modified, angles):
    robot_of_table(folder, content, modified, angles)


KINEMATICS = {
    "kinematics": {"hash": "a", "shoulder": {"x": 0, "y": 0.1, "z": "1e-05", "roll": 1.5, "pitch": 0, "yaw": -9.6e-06}}
}


@given(any_document(KINEMATICS))
def test_kinematics_of_ros_drivers(folder, content):
    path = folder / "calib.yaml"
    path.touch()
    over(path, content, lambda: quietly(lambda: imported(folder, lambda: robot_from_dh(path, options=DhOptions("deg", "m")))))


@given(st.lists(st.sampled_from(ANGLE_CELLS) | CELLS, min_size=4, max_size=4))
def test_numbers_of_denavit_hartenberg_tables(folder, cells):
    """One cell after another, so that a fault of the first hides none of the others."""
    for place, cell in enumerate(cells):
        row = ["0.1", "0", "0.1", "1.5"]
        row[place] = cell
        robot_of_table(folder, f"{ANGLES}{','.join(row)}\n".encode("utf-8", "surrogatepass"))


TRACKER = "Tracker 7;;\nPose;J1;J2 [deg];q3;X [mm];Y;Z;Target;qw;qx;qy;qz;fz [kN];time\n" + "".join(
    f"{n};{n},5;{-n};{2 * n};{100 + n};{200 - n},25;{n};A;1;0;0;0;{-n % 3};{10 * n}\n" for n in range(1, 7)
)
TIMES = st.sampled_from(
    ["10:20", "2023-05-04", "9999-12-31T23:59:59+00:01", "0001-01-01", "01.01.0001 00:00", "1e18", "24:00:00"]
)
HEADERS = (
    "q1",
    "J0",
    "q99",
    "q" + "9" * 30,
    "x",
    "rx",
    "r11",
    "t14",
    "load",
    "repeat",
    "session",
    "u95",
    "",
    "#",
    "٣",
    "Axis 2",
    "q[0]",
    "J(2)",
    "Load [kg]",
    "E1",
    "/arm/J1/position",
    "Config",
    "Timestamp",
)


@st.composite
def headed(draw, content):
    """Bytes of a table with other names of some columns."""
    lines = content.decode().splitlines()
    names = lines[1].split(";")
    for _ in range(draw(st.integers(1, 2))):
        names[draw(st.integers(0, len(names) - 1))] = draw(st.sampled_from(HEADERS))
    return "\n".join([lines[0], ";".join(names), *lines[2:]]).encode()


def imports_again(folder, path, options):
    """What is imported is finite, can be written, and comes out again with the options that were found out."""
    found = read_measurement_table(path, options)
    for name, column in found.table.items():
        assert name == "target" or np.isfinite(column).all()
        if name in ("pose", "load", "repeat", "session"):
            assert np.abs(column).max() < 2**31
    write_measurements(str(folder / "measurements.csv"), found.table, found.joints)
    (folder / "import.yaml").write_text(import_options_text(found.options, path), encoding="utf-8")
    again = read_measurement_table(path, read_import_options(folder / "import.yaml"))
    for name, column in found.table.items():
        np.testing.assert_array_equal(column, again.table[name])


def measurements_of(folder, content, options):
    path = folder / "tracker.csv"
    path.touch()
    over(path, content, lambda: quietly(lambda: imports_again(folder, path, options)))


UNITS = {"angles": "deg", "lengths": "mm"}


@given(st.data())
def test_measurements_of_other_programs(folder, data):
    content = TRACKER.encode()
    drawn = data.draw(BYTES | damaged(content) | tables(content, ";"))
    if data.draw(st.integers(0, 5)) == 0:
        drawn = drawn.decode("utf-8", "replace").encode("utf-16")
    options = ImportOptions(
        separator=data.draw(st.sampled_from([None, None, *SEPARATORS])),
        decimal=data.draw(st.sampled_from([None, None, *DECIMALS])),
        header=data.draw(st.sampled_from([None, None, 1, 2, 3])),
        encoding=data.draw(st.sampled_from([None, None, "utf-8", "cp1252", "utf-16-le", "shift_jis"])),
        names=data.draw(st.sampled_from([None, None, [f"q{n}" for n in range(12)], ["q1", "x", "y", "z"]])),
        ignore=data.draw(st.sampled_from([None, None, ["time"], ["Z"]])),
        units=UNITS | {"angles": data.draw(st.sampled_from(["deg", "rad", "mm"]))},
        rotation=data.draw(st.sampled_from([None, None, "none", "vector", "euler:ZYX", "matrix", "euler:"])),
        target=data.draw(st.sampled_from([None, "A"])),
        skip_empty=data.draw(st.booleans()),
    )
    measurements_of(folder, drawn, options)


@given(headed(TRACKER.encode()))
def test_headers_of_other_programs(folder, content):
    measurements_of(folder, content, ImportOptions(units=UNITS, target="A"))


@given(st.sampled_from(["Pose", "J1", "X [mm]", "Target", "qw", "fz [kN]", "time"]), CELLS | TIMES | SCALARS.map(str))
def test_cells_of_other_programs(folder, name, cell):
    lines = TRACKER.splitlines()
    row = lines[3].split(";")
    row[lines[1].split(";").index(name)] = cell
    content = "\n".join([*lines[:3], ";".join(row), *lines[4:]])
    measurements_of(folder, content.encode("utf-8", "surrogatepass"), ImportOptions(units=UNITS))


EARLIER = {
    "source": "a.csv",
    "separator": "semicolon",
    "header": 2,
    "columns": {"q1": "J1"},
    "units": {"fz": "kN"},
    "rotation": "none",
}


@given(any_document(EARLIER))
def test_options_of_an_earlier_import(folder, content):
    table, path = folder / "earlier.csv", folder / "options.yaml"
    table.write_text(TRACKER, encoding="utf-8")
    path.touch()
    over(path, content, lambda: quietly(lambda: imports_again(folder, table, read_import_options(path))))


WANTED = "x,y,z,rx,ry,rz,fx,fy,fz,mx,my,mz,q1,q2\n" + "1.0,0.2,-0.5,0.1,0.2,0.3,0,0,-100,0,0,0,0.5,-1\n" * 3


@given(st.data())
def test_wanted_poses(folder, data):
    content = WANTED.encode()
    drawn = data.draw(st.one_of(BYTES, damaged(content), tables(content)))
    path = folder / "wanted.csv"
    path.touch()

    def read():
        found = read_target_path(path, 2)
        assert np.isfinite(found.position).all() and np.isfinite(found.rotation).all() and len(found.lines) == len(found)

    over(path, drawn, lambda: quietly(read))
