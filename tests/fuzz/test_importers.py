"""For any file of another program, an importer returns a valid robot or campaign, or
refuses the file in one line."""

import warnings

import numpy as np
import pytest
from fuzzed import (
    BYTES,
    CELLS,
    SCALARS,
    any_document,
    assert_read_or_refused,
    assert_read_or_refused_from,
    damaged,
    tables,
)
from hypothesis import given
from hypothesis import strategies as st
from made_urdf import joint, link, robot

from elastocal.campaigns.measurements import write_measurements
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.tables import DECIMALS, SEPARATORS
from elastocal.exchange.dh import DhOptions, robot_from_dh
from elastocal.exchange.measurement_table import ImportOptions, read_measurement_table
from elastocal.exchange.robot_text import write_robot
from elastocal.exchange.target_path import read_target_path
from elastocal.exchange.urdf import robot_from_urdf

LINKS = link("a"), link("b", 4.0, (0, 0, 0.1)), link("c", 2.0), link("d")
URDF = robot(
    *LINKS,
    joint("j1", "a", "b"),
    joint("j2", "b", "c", "continuous"),
    joint("j3", "c", "d", "prismatic"),
)
NUMBERS = st.floats().map(repr) | st.sampled_from(
    ["1e308", "-1e-320", "1e12", "1e16", "1_0", "٣", "inf", "9" * 400]
)
# Values of attributes in files of people and of attackers.
NAMES = [
    "a",
    "d",
    "j1",
    "fixed",
    "planar",
    "0 0 1",
    "1e308 0 0",
    "0 0 1e-320",
    "${x}",
    "٣ 0 0",
]
ATTRIBUTE_VALUES = SCALARS.map(str) | CELLS | NUMBERS | st.sampled_from(NAMES)
ELEMENTS = (
    '<mimic joint="j1" multiplier="-1" offset="1e9"/>',
    '<axis xyz="1 1 1"/>',
    '<limit lower="-1e99" upper="1e99"/>',
    '<inertial><mass value="1e12"/><origin xyz="0 0 1e12" rpy="1 2 3"/></inertial>',
    '<joint name="k" type="fixed"><parent link="d"/><child link="a"/></joint>',
    '<link name="e"/>',
    '<!DOCTYPE robot [<!ENTITY a "b">]>',
    "&a;",
    '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="/etc/passwd"/>',
    "<![CDATA[",
)
DH = (
    "joint,theta_offset_deg,d_mm,a_m,alpha,type\n"
    "base,0,250,0,90,R\n"
    ",5,0,0,0,F\n"
    "elbow,-3.5,0,0.4,1,R\n"
)
ANGLE_CELLS = st.sampled_from(
    [
        "pi/0",
        "1e9*pi",
        "-pi/2",
        "0*pi/0",
        "9" * 200 + "pi",
        "1e308",
        "P",
        "F",
        "-1e-320",
    ]
)
KINEMATICS = {
    "kinematics": {
        "hash": "a",
        "shoulder": {
            "x": 0,
            "y": 0.1,
            "z": "1e-05",
            "roll": 1.5,
            "pitch": 0,
            "yaw": -9e-06,
        },
    }
}
TRACKER = (
    "Tracker 7;;\nPose;J1;J2 [deg];q3;X [mm];Y;Z;Target;qw;qx;qy;qz;fz [kN];time\n"
    + "".join(
        f"{n};{n},5;{-n};{2 * n};{100 + n};{200 - n},25;{n};A;1;0;0;0;"
        f"{-n % 3};{10 * n}\n"
        for n in range(1, 7)
    )
)
TIMES = [
    "10:20",
    "2023-05-04",
    "9999-12-31T23:59:59+00:01",
    "0001-01-01",
    "01.01.0001 00:00",
    "1e18",
    "24:00:00",
]
HEADERS = [
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
]
HEADERS += [
    "Axis 2",
    "q[0]",
    "J(2)",
    "Load [kg]",
    "E1",
    "/arm/J1/position",
    "Config",
    "Timestamp",
]
UNITS = {"angles": "deg", "lengths": "mm"}
WANTED = (
    "x,y,z,rx,ry,rz,fx,fy,fz,mx,my,mz,q1,q2\n"
    + "1.0,0.2,-0.5,0.1,0.2,0.3,0,0,-100,0,0,0,0.5,-1\n" * 3
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("imports")


def assert_quietly_read_or_refused(path, content, read):
    """Check a reader of a file with some content; it must not warn either, because a
    warning of numpy would appear on the terminal next to the message."""

    def read_without_warnings():
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert_read_or_refused(read)

    path.touch()
    assert_read_or_refused_from(path, content, read_without_warnings)


def write_and_read_robot(folder, imported):
    """Check that an imported robot can be written to a file and read from it."""
    write_robot(imported, folder / "robot.yaml")
    robot = read_robot(folder / "robot.yaml")
    assert robot.joints == imported.robot.joints
    assert robot.name == imported.robot.name
    assert np.isfinite(robot.joint_limits).all()
    for mass in robot.masses:
        assert np.isfinite(mass.centre_m).all()


@st.composite
def urdf_files(draw):
    """Draw a URDF with attributes changed, elements inserted or bytes damaged."""
    text = URDF
    for _ in range(draw(st.integers(1, 3))):
        pieces = text.split('"')
        if len(pieces) > 2 and draw(st.booleans()):
            # Every second piece is between quotes.
            index = 2 * draw(st.integers(0, len(pieces) // 2 - 1)) + 1
            pieces[index] = (
                draw(ATTRIBUTE_VALUES).replace('"', "&quot;").replace("<", "&lt;")
            )
            text = '"'.join(pieces)
        else:
            tags = text.split(">")
            index = draw(st.integers(0, len(tags) - 1))
            tags[index] += ">" + draw(st.sampled_from(ELEMENTS))
            text = ">".join(tags)
    content = text.encode(
        draw(st.sampled_from(["utf-8", "utf-8", "utf-8", "utf-16"])), "surrogatepass"
    )
    return draw(damaged(content)) if draw(st.integers(0, 3)) == 0 else content


@given(
    urdf_files() | BYTES,
    st.sampled_from([("a", "d"), ("a", "c"), ("b", "a"), ("", "x\n")]),
)
def test_a_urdf_is_imported_or_refused(folder, content, ends):
    path = folder / "arm.urdf"
    assert_quietly_read_or_refused(
        path,
        content,
        lambda: write_and_read_robot(folder, robot_from_urdf(path, *ends)),
    )


@given(
    BYTES
    | tables(DH.encode())
    | tables(DH.encode(), cells=ANGLE_CELLS)
    | damaged(DH.encode())
    | any_document(KINEMATICS),
    st.booleans(),
    st.sampled_from(["deg", "rad"]),
    st.sampled_from(["arm.csv", "calib.yaml"]),
)
def test_dh_tables_and_kinematics_of_ros_drivers_are_imported_or_refused(
    folder, content, modified, angles, name
):
    path = folder / name
    assert_quietly_read_or_refused(
        path,
        content,
        lambda: write_and_read_robot(
            folder, robot_from_dh(path, DhOptions(angles, "m"), modified=modified)
        ),
    )


def import_twice(folder, path, options):
    """Check that an imported table is finite and can be written, and that an import
    with the detected options returns the same table."""
    imported = read_measurement_table(path, options)
    for name, column in imported.table.items():
        assert name == "target" or np.isfinite(column).all()
        if name in ("pose", "load", "repeat", "session"):
            assert np.abs(column).max() < 2**31
    write_measurements(
        str(folder / "measurements.csv"), imported.table, imported.joints
    )
    again = read_measurement_table(path, imported.options)
    for name, column in imported.table.items():
        np.testing.assert_array_equal(column, again.table[name])


@st.composite
def changed_table(draw):
    """Draw the table of the tracker with other column names and another cell."""
    first, names, *rows = (line.split(";") for line in TRACKER.splitlines())
    for _ in range(draw(st.integers(0, 2))):
        names[draw(st.integers(0, len(names) - 1))] = draw(st.sampled_from(HEADERS))
    rows[0][draw(st.integers(0, len(names) - 1))] = draw(
        CELLS | st.sampled_from(TIMES) | SCALARS.map(str)
    )
    lines = [";".join(row) for row in (first, names, *rows)]
    return "\n".join(lines).encode("utf-8", "surrogatepass")


@given(st.data())
def test_measurements_of_other_programs_are_imported_or_refused(folder, data):
    def pick(*values):
        return data.draw(st.sampled_from(values))

    content = TRACKER.encode()
    path = folder / "tracker.csv"
    content = data.draw(
        BYTES | damaged(content) | tables(content, ";") | changed_table()
    )
    if data.draw(st.integers(0, 5)) == 0:
        content = content.decode("utf-8", "replace").encode("utf-16")
    options = ImportOptions(
        separator=pick(None, None, *SEPARATORS),
        decimal=pick(None, None, *DECIMALS),
        header=pick(None, None, 1, 2, 3),
        encoding=pick(None, None, "utf-8", "cp1252", "utf-16-le", "shift_jis"),
        names=pick((), (), [f"q{n}" for n in range(12)], ["q1", "x", "y", "z"]),
        ignore=pick((), (), ["time"], ["Z"]),
        units=UNITS | {"angles": pick("deg", "rad", "mm")},
        rotation=pick(None, None, "none", "vector", "euler:ZYX", "matrix", "euler:"),
        target=pick(None, "A"),
        skip_empty=data.draw(st.booleans()),
    )
    assert_quietly_read_or_refused(
        path, content, lambda: import_twice(folder, path, options)
    )


@given(BYTES | damaged(WANTED.encode()) | tables(WANTED.encode()))
def test_wanted_poses_are_read_or_refused(folder, content):
    path = folder / "wanted.csv"

    def read():
        targets = read_target_path(path, 2)
        assert np.isfinite(targets.position).all()
        assert np.isfinite(targets.rotation).all()
        assert len(targets.lines) == len(targets)

    assert_quietly_read_or_refused(path, content, read)
