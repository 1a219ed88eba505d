"""Whatever other people's files hold, an importer gives what robot files and campaigns
may hold, or one line."""

import warnings

import numpy as np
import pytest
from fuzzed import BYTES, CELLS, SCALARS, any_document, damaged, holds, over, tables
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
# What stands in attributes of people and of those who mean harm.
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
WORDS = SCALARS.map(str) | CELLS | NUMBERS | st.sampled_from(NAMES)
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
DH = "joint,theta_offset_deg,d_mm,a_m,alpha,type\nbase,0,250,0,90,R\n,5,0,0,0,F\nelbow,-3.5,0,0.4,1,R\n"
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
        f"{n};{n},5;{-n};{2 * n};{100 + n};{200 - n},25;{n};A;1;0;0;0;{-n % 3};{10 * n}\n"
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


def quietly(path, content, read):
    """As `over`; a warning of numpy would stand on the terminal beside the line."""

    def without_warnings():
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            holds(read)

    path.touch()
    over(path, content, without_warnings)


def imported(folder, make):
    """A robot is imported: its file, once written, is one that is read."""
    result = make()
    write_robot(result, folder / "robot.yaml")
    again = read_robot(folder / "robot.yaml")
    assert again.joints == result.robot.joints and again.name == result.robot.name
    assert np.isfinite(again.joint_limits).all() and all(
        np.isfinite(mass.centre_m).all() for mass in again.masses
    )


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
            text = ">".join(
                [
                    *parts[:place],
                    parts[place] + ">" + draw(st.sampled_from(ELEMENTS)),
                    *parts[place + 1 :],
                ]
            )
    content = text.encode(
        draw(st.sampled_from(["utf-8", "utf-8", "utf-8", "utf-16"])), "surrogatepass"
    )
    return draw(damaged(content)) if draw(st.integers(0, 3)) == 0 else content


@given(
    urdf_files() | BYTES,
    st.sampled_from([("a", "d"), ("a", "c"), ("b", "a"), ("", "x\n")]),
)
def test_robots_as_urdf(folder, content, ends):
    path = folder / "arm.urdf"
    quietly(
        path, content, lambda: imported(folder, lambda: robot_from_urdf(path, *ends))
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
def test_denavit_hartenberg_tables_and_kinematics_of_ros_drivers(
    folder, content, modified, angles, name
):
    path = folder / name
    quietly(
        path,
        content,
        lambda: imported(
            folder,
            lambda: robot_from_dh(path, DhOptions(angles, "m"), modified=modified),
        ),
    )


def imports_again(folder, path, options):
    """What is imported is finite, can be written, and comes out again with the options
    that were found out."""
    found = read_measurement_table(path, options)
    for name, column in found.table.items():
        assert name == "target" or np.isfinite(column).all()
        if name in ("pose", "load", "repeat", "session"):
            assert np.abs(column).max() < 2**31
    write_measurements(str(folder / "measurements.csv"), found.table, found.joints)
    again = read_measurement_table(path, found.options)
    for name, column in found.table.items():
        np.testing.assert_array_equal(column, again.table[name])


@st.composite
def changed_table(draw):
    """The table with other names of columns and another cell."""
    first, names, *rows = (line.split(";") for line in TRACKER.splitlines())
    for _ in range(draw(st.integers(0, 2))):
        names[draw(st.integers(0, len(names) - 1))] = draw(st.sampled_from(HEADERS))
    rows[0][draw(st.integers(0, len(names) - 1))] = draw(
        CELLS | st.sampled_from(TIMES) | SCALARS.map(str)
    )
    return "\n".join(";".join(row) for row in (first, names, *rows)).encode(
        "utf-8", "surrogatepass"
    )


@given(st.data())
def test_measurements_of_other_programs(folder, data):
    def sampled(*values):
        return data.draw(st.sampled_from(values))

    content = TRACKER.encode()
    path = folder / "tracker.csv"
    drawn = data.draw(BYTES | damaged(content) | tables(content, ";") | changed_table())
    if data.draw(st.integers(0, 5)) == 0:
        drawn = drawn.decode("utf-8", "replace").encode("utf-16")
    options = ImportOptions(
        separator=sampled(None, None, *SEPARATORS),
        decimal=sampled(None, None, *DECIMALS),
        header=sampled(None, None, 1, 2, 3),
        encoding=sampled(None, None, "utf-8", "cp1252", "utf-16-le", "shift_jis"),
        names=sampled((), (), [f"q{n}" for n in range(12)], ["q1", "x", "y", "z"]),
        ignore=sampled((), (), ["time"], ["Z"]),
        units=UNITS | {"angles": sampled("deg", "rad", "mm")},
        rotation=sampled(None, None, "none", "vector", "euler:ZYX", "matrix", "euler:"),
        target=sampled(None, "A"),
        skip_empty=data.draw(st.booleans()),
    )
    quietly(path, drawn, lambda: imports_again(folder, path, options))


@given(BYTES | damaged(WANTED.encode()) | tables(WANTED.encode()))
def test_wanted_poses(folder, content):
    path = folder / "wanted.csv"

    def read():
        found = read_target_path(path, 2)
        assert (
            np.isfinite(found.position).all()
            and np.isfinite(found.rotation).all()
            and len(found.lines) == len(found)
        )

    quietly(path, content, read)
