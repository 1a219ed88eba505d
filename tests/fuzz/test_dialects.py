"""Campaigns of any robot in any dialect of measurement tables: the reader returns the
same numbers, or asks in one line about an ambiguity, but never returns other numbers."""

import csv
import io
from dataclasses import dataclass, field

import numpy as np
import pytest
from fuzzed import assert_read_or_refused_from
from hypothesis import event, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support import robot_of

from elastocal.campaigns.tables import SEPARATORS
from elastocal.errors import InputError
from elastocal.exchange.measurement_table import ImportOptions, read_measurement_table

SCALES = {
    "m": 1.0,
    "mm": 1e-3,
    "in": 0.0254,
    "rad": 1.0,
    "deg": np.pi / 180,
    "mrad": 1e-3,
    "N": 1.0,
    "kN": 1e3,
    "Nm": 1.0,
}
# Headers of joint columns; the joints count from 1.
JOINT_HEADERS = (
    "q{0}",
    "J{0}",
    "Axis {0}",
    "joint_{0}",
    "q[{0}]",
    "J({0})",
    "actual_q_{0}",
    "rax_{0}",
)
# Headers of position columns: of a table with one target a line, and of a table with
# all targets in one line.
POSITION_HEADERS = {
    "x": ("{x}", "{marker}_{x}"),
    "X": ("{X}", "{X}_{marker}"),
    "Position X": ("Position {X}", "{marker} Position {X}"),
    "A.x": ("{x}", "{marker}.{x}"),
}
# The measurements of a campaign with dates begin here, in seconds since 1970.
START_S = 1683195633
WRENCH_HEADERS = ("fx", "fy", "fz", "mx", "my", "mz")


def pick(draw, *values):
    """Draw one of some values."""
    return draw(st.sampled_from(values))


def flip(draw):
    """Draw a yes or no."""
    return draw(st.sampled_from([False, True]))


@dataclass(frozen=True)
class Dialect:
    """How a program writes a campaign.

    Attributes
    ----------
    poses : int
    separator, decimal : str
        Names of the separator of cells and of the decimal mark.
    is_quoted : bool
        Every cell is quoted.
    length, angle, force : str
        Units; without a force the campaign is unloaded.
    is_wide : bool
        All targets of a pose are in one line.
    position_header : str
        Key of `POSITION_HEADERS`.
    targets : tuple of str
    rotation, time : str
        Representation of orientations and of times.
    is_prismatic : tuple of bool
        For each joint.
    """

    poses: int
    separator: str
    decimal: str
    is_quoted: bool
    length: str
    angle: str
    force: str
    is_wide: bool
    position_header: str
    targets: tuple
    rotation: str
    time: str
    is_prismatic: tuple

    @property
    def has_blank_separator(self):
        """Whether no cell or header may contain a blank."""
        return self.separator == "space"


def draw_targets(draw, *, is_wide, is_blank):
    """Draw the names of the targets."""
    if is_wide:
        return pick(draw, ("A", "B"), ("T1", "T2", "T3"))
    return pick(draw, ("SMR",), ("SMR",) if is_blank else ("A", "B"))


def draw_rotation(draw, *, is_wide):
    """Draw the representation of orientations; a wide table has none."""
    if is_wide:
        return "none"
    return pick(
        draw,
        "none",
        "vector",
        "quaternion",
        "matrix",
        "euler:ZYX",
        "euler:xyz",
        "euler:ZYZ",
    )


def draw_quoting(draw, separator, decimal):
    """Draw whether cells are quoted; a decimal comma in a comma-separated table needs
    it, and a table that is separated by blanks has no quotes."""
    if decimal == separator == "comma":
        return True
    return separator != "space" and flip(draw)


def draw_dialect(draw):
    """Draw everything that holds for a whole table."""
    joints = pick(draw, 1, 2, 3, 5, 6, 7, 9)
    poses = pick(draw, 3, 5, 6)
    separator = pick(draw, *SEPARATORS)
    decimal = pick(draw, "point", "comma")
    is_blank = separator == "space"
    is_quoted = draw_quoting(draw, separator, decimal)
    length = pick(draw, "m", "mm", "in")
    angle = pick(draw, "rad", "deg", "mrad")
    force = pick(draw, "", "N", "kN")
    is_wide = not is_blank and flip(draw)
    position_headers = ("x", "X", "A.x") if is_blank else POSITION_HEADERS
    return Dialect(
        poses,
        separator,
        decimal,
        is_quoted,
        length,
        angle,
        force,
        is_wide,
        position_header=pick(draw, *position_headers),
        targets=draw_targets(draw, is_wide=is_wide, is_blank=is_blank),
        rotation=draw_rotation(draw, is_wide=is_wide),
        time=pick(draw, "", "s", "iso"),
        is_prismatic=tuple(joint == 0 and flip(draw) for joint in range(joints)),
    )


def round_in_unit(values, unit, digits):
    """Return values in SI units as rounded numbers of a unit, and the SI values that
    these numbers mean."""
    cells = np.round(values / SCALES[unit], digits)
    return cells, cells * SCALES[unit]


@dataclass(frozen=True)
class Column:
    """A column of a table; `target` names the target in a wide table."""

    name: str
    unit: str
    cells: list
    target: str = ""

    def format_header(self, unit_style):
        """Return the header, with the unit if the style puts it there."""
        if not self.unit or unit_style in ("row", "none"):
            return self.name
        return unit_style.format(self.name, self.unit)


@dataclass
class Table:
    """A table to which columns are added, one quantity after the other.

    Attributes
    ----------
    dialect : Dialect
    rng : numpy.random.Generator
        Source of the measured values.
    columns : list of Column
    meaning : dict of str to ndarray
        Columns that the reader has to return.
    options : dict
        Import options that the table needs, because it does not state them.
    """

    dialect: Dialect
    rng: np.random.Generator
    columns: list = field(default_factory=list)
    meaning: dict = field(default_factory=dict)
    options: dict = field(default_factory=lambda: {"units": {}})

    def add_pose_column(self, name, unit, cells):
        """Add a column with one value a pose; a table with one target a line repeats
        the value for each target."""
        lines = 1 if self.dialect.is_wide else len(self.dialect.targets)
        self.columns.append(Column(name, unit, list(np.repeat(cells, lines))))

    def expect_pose_column(self, name, values):
        """Expect the reader to return a column with one value a pose."""
        self.meaning[name] = np.repeat(values, len(self.dialect.targets))


def add_joint_angles(draw, table):
    """Add a column for each joint."""
    dialect = table.dialect
    headers = [
        header
        for header in JOINT_HEADERS
        if not dialect.has_blank_separator or " " not in header
    ]
    header = pick(draw, *headers)
    for number, is_prismatic in enumerate(dialect.is_prismatic, 1):
        unit = dialect.length if is_prismatic else dialect.angle
        values = table.rng.uniform(-2.8, 2.8, dialect.poses)
        cells, meaning = round_in_unit(values, unit, 6)
        table.add_pose_column(header.format(number), unit, cells)
        table.expect_pose_column(f"q{number}", meaning)


def add_positions(table):
    """Add the positions of all targets."""
    dialect = table.dialect
    shape = dialect.poses, len(dialect.targets), 3
    cells, meaning = round_in_unit(table.rng.uniform(-3, 3, shape), dialect.length, 5)
    long_header, wide_header = POSITION_HEADERS[dialect.position_header]
    for number, axis in enumerate("xyz"):
        table.meaning[axis] = meaning[..., number].ravel()
        if not dialect.is_wide:
            name = long_header.format(x=axis, X=axis.upper())
            values = list(cells[..., number].ravel())
            table.columns.append(Column(name, dialect.length, values))
            continue
        for target_number, target in enumerate(dialect.targets):
            name = wide_header.format(x=axis, X=axis.upper(), marker=target)
            values = list(cells[:, target_number, number])
            table.columns.append(Column(name, dialect.length, values, target))
    table.meaning["target"] = np.array([*dialect.targets] * dialect.poses)


def write_rotations(rotations, representation, angle):
    """Write rotations in one representation.

    Returns the columns by their names, their unit, and the rotations that they mean.
    """
    unit = angle
    if representation == "quaternion":
        names = ["qw", "qx", "qy", "qz"]
        cells = np.round(rotations.as_quat(scalar_first=True), 9)
        unit = ""
    elif representation == "matrix":
        names = ["r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"]
        cells = np.round(rotations.as_matrix(), 12).reshape(-1, 9)
        unit = ""
    elif representation == "vector":
        names = ["rx", "ry", "rz"]
        cells, meaning = round_in_unit(rotations.as_rotvec(), angle, 8)
        rotations = Rotation.from_rotvec(meaning)
    else:
        names = ["e1", "e2", "e3"]
        axes = representation.removeprefix("euler:")
        cells, meaning = round_in_unit(rotations.as_euler(axes), angle, 8)
        rotations = Rotation.from_euler(axes, meaning)
    return dict(zip(names, cells.T, strict=True)), unit, rotations


def add_rotations(table):
    """Add the orientations of all targets, if the dialect has any."""
    dialect = table.dialect
    count = dialect.poses * len(dialect.targets)
    rotations = Rotation.random(count, rng=table.rng)
    if dialect.rotation == "none":
        return
    columns, unit, rotations = write_rotations(
        rotations, dialect.rotation, dialect.angle
    )
    for name, cells in columns.items():
        table.columns.append(Column(name, unit, list(cells)))
    table.meaning["rotation"] = rotations.as_matrix()
    if dialect.rotation not in ("quaternion", "matrix"):
        table.options["rotation"] = dialect.rotation


def add_targets(draw, table):
    """Add the names of the targets, if a line has one of several."""
    dialect = table.dialect
    if dialect.is_wide:
        return
    if len(dialect.targets) == 1:
        table.options["target"] = "SMR"
        return
    name = pick(draw, "target", "Reflector", "SMR")
    table.columns.append(Column(name, "", [*dialect.targets] * dialect.poses))


def add_wrench(draw, table):
    """Add forces and moments on the robot or by the robot."""
    dialect = table.dialect
    if not dialect.force:
        return
    sign = pick(draw, 1, -1)
    if sign < 0:
        table.options["wrench"] = "by-robot"
    for name in WRENCH_HEADERS:
        unit = dialect.force if name[0] == "f" else "Nm"
        values = table.rng.uniform(-900, 900, dialect.poses)
        cells, meaning = round_in_unit(values, unit, 7)
        table.add_pose_column(name, unit, cells)
        table.expect_pose_column(name, sign * meaning)


def add_times(table):
    """Add times in seconds or as dates."""
    dialect = table.dialect
    if not dialect.time:
        return
    seconds = 60 * np.arange(dialect.poses)
    cells = [f"{second}" for second in seconds]
    if dialect.time == "iso":
        dates = [np.datetime64(START_S + int(second), "s") for second in seconds]
        cells = [str(date) for date in dates]
        seconds = seconds + START_S
    table.add_pose_column("Time", "", cells)
    table.expect_pose_column("time_s", seconds.astype(float))


def add_pose_names(draw, table):
    """Add names of the poses, or none."""
    poses = table.dialect.poses
    pattern = pick(draw, "", "{}0", "P{}")
    if not pattern:
        return
    is_blank = table.dialect.has_blank_separator
    name = "pose" if is_blank else pick(draw, "pose", "Pose ID")
    names = [pattern.format(number) for number in range(1, poses + 1)]
    table.add_pose_column(name, "", names)


def add_ignored_columns(draw, table):
    """Add columns that no campaign has, or none."""
    poses = table.dialect.poses
    if flip(draw):
        velocities = np.round(table.rng.uniform(-1, 1, poses), 4)
        table.add_pose_column("velocity", "", velocities)
        table.add_pose_column("operator", "", ["somebody"] * poses)


def draw_order(draw, table):
    """Draw the order of the columns: as added or at random."""
    if flip(draw):
        return list(table.rng.permutation(len(table.columns)))
    return list(range(len(table.columns)))


def draw_unit_style(draw, dialect):
    """Draw where the units are: in headers, in a row of their own, or nowhere."""
    if dialect.has_blank_separator:
        style = pick(draw, "{} [{}]", "{} ({})", "{}_{}", "none")
        return style.replace(" ", "")
    return pick(draw, "{} [{}]", "{} ({})", "{}_{}", "none", "row")


def add_column_options(table, headers):
    """State the columns that the reader cannot find by their headers.

    `headers` are those of `table.columns`, in their order.
    """
    dialect = table.dialect
    if dialect.is_wide:
        options = {target: [] for target in dialect.targets}
        for column, header in zip(table.columns, headers, strict=True):
            if column.target:
                options[column.target].append(header)
        table.options["targets"] = options
    if dialect.rotation.startswith("euler:"):
        table.options["columns"] = {
            column.name: header
            for column, header in zip(table.columns, headers, strict=True)
            if column.name in ("e1", "e2", "e3")
        }


def add_format_options(draw, table, unit_style):
    """State the units, the decimal mark and the separator where the table does not."""
    dialect = table.dialect
    units = table.options["units"]
    if unit_style in ("none", "{}_{}"):
        units |= {"angles": dialect.angle, "lengths": dialect.length}
        if dialect.is_prismatic[0]:
            units["q1"] = dialect.length
    if dialect.force == "kN" and unit_style == "none":
        units |= {name: "kN" for name in WRENCH_HEADERS[:3]}
    if dialect.decimal == "comma":
        table.options["decimal"] = dialect.decimal
    if flip(draw):
        table.options["separator"] = dialect.separator


def format_cell(cell, decimal):
    """Return the text of a cell."""
    if isinstance(cell, str):
        return cell
    return f"{cell:.12f}".replace(".", "," if decimal == "comma" else ".")


def write_table(draw, columns, headers, dialect, *, has_unit_row):
    """Write the lines of a file: remarks, headers, units, and rows of cells."""
    file = io.StringIO()
    for number in range(draw(st.integers(0, 3))):
        file.write(f"Recorded by program {number}\n")
    if not dialect.is_quoted and not has_unit_row:
        file.write(pick(draw, "", "", "# ", "% ", "// "))
    writer = csv.writer(
        file,
        delimiter=SEPARATORS[dialect.separator],
        quoting=csv.QUOTE_ALL if dialect.is_quoted else csv.QUOTE_MINIMAL,
        lineterminator="\n",
    )
    writer.writerow(headers)
    if has_unit_row:
        writer.writerow([column.unit for column in columns])
    for cells in zip(*(column.cells for column in columns), strict=True):
        writer.writerow([format_cell(cell, dialect.decimal) for cell in cells])
    return file.getvalue()


@dataclass(frozen=True)
class WrittenCampaign:
    """A campaign in a file.

    Attributes
    ----------
    content : bytes
    meaning : dict of str to ndarray
        Columns of measurements.csv that the file means.
    options : dict
        Import options that the file needs.
    is_prismatic : tuple of bool
        For each joint.
    headers : list of str
    """

    content: bytes
    meaning: dict
    options: dict
    is_prismatic: tuple
    headers: list

    def make_robot(self):
        """Make a robot with the joints of the campaign."""
        joints = [
            f"Tz(q{number})" if is_prismatic else f"Rz(q{number})"
            for number, is_prismatic in enumerate(self.is_prismatic, 1)
        ]
        return robot_of(f"{' Tx(0.3) '.join(joints)} Tx(0.2) [end]")


@st.composite
def written_campaigns(draw):
    """Draw one campaign in one dialect."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    dialect = draw_dialect(draw)
    table = Table(dialect, rng)
    add_joint_angles(draw, table)
    add_positions(table)
    add_rotations(table)
    add_targets(draw, table)
    add_wrench(draw, table)
    add_times(table)
    add_pose_names(draw, table)
    add_ignored_columns(draw, table)
    order = draw_order(draw, table)
    unit_style = draw_unit_style(draw, dialect)
    headers = [column.format_header(unit_style) for column in table.columns]
    add_column_options(table, headers)
    add_format_options(draw, table, unit_style)
    headers = [headers[index] for index in order]
    columns = [table.columns[index] for index in order]
    text = write_table(
        draw, columns, headers, dialect, has_unit_row=unit_style == "row"
    )
    text = text.replace("\n", pick(draw, "\n", "\r\n", "\r"))
    encoding = pick(draw, "utf-8", "utf-8-sig", "utf-16", "cp1252")
    return WrittenCampaign(
        text.encode(encoding),
        table.meaning,
        table.options,
        dialect.is_prismatic,
        headers,
    )


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("dialects") / "table.csv"
    file.touch()
    return file


def assert_columns_are_meant(table, meaning):
    """Check all columns that the file means, and that there are no others."""
    for name, values in meaning.items():
        if name == "target":
            assert table["target"].tolist() == values.tolist()
        elif name == "rotation":
            vectors = np.column_stack([table["rx"], table["ry"], table["rz"]])
            rotation = Rotation.from_rotvec(vectors).as_matrix()
            np.testing.assert_allclose(rotation, values, atol=1e-6)
        else:
            np.testing.assert_allclose(
                table[name], values, rtol=1e-9, atol=1e-9, err_msg=name
            )
    assert ("rx" in table) == ("rotation" in meaning)
    assert set(table) <= {*meaning, "rx", "ry", "rz", "pose", "load", "repeat"}


def assert_meant(imported, campaign):
    """Check that an import has the numbers of the file, in SI units and base axes, and
    nothing else."""
    table = imported.table
    assert_columns_are_meant(table, campaign.meaning)
    # Every header is used, ignored or mentioned in a note.
    notes = " ".join(imported.notes)
    used = {*(imported.options.columns or {}).values(), *imported.ignored}
    unmentioned = [
        header
        for header in campaign.headers
        if header not in used and repr(header) not in notes
    ]
    assert unmentioned == []
    joint_angles = [table[name] for name in table if name[0] == "q"]
    poses = np.unique(np.column_stack(joint_angles), axis=0)
    assert len(np.unique(table["pose"])) == len(poses)


def assert_imported_again(path, imported):
    """Check that an import with the options that were detected is the same."""
    again = read_measurement_table(path, imported.options)
    assert again.options == imported.options
    for name, column in imported.table.items():
        assert np.array_equal(again.table[name], column)


@given(
    written_campaigns(),
    st.sets(
        st.sampled_from(
            ["units", "rotation", "target", "targets", "decimal", "separator"]
        )
    ),
    st.booleans(),
)
def test_a_campaign_is_read_as_measured_and_a_missing_option_is_detected_or_asked_for(
    path, campaign, dropped_options, robot_is_known
):
    try:
        path.write_bytes(campaign.content)
        imported = read_measurement_table(
            path, ImportOptions(**campaign.options), campaign.make_robot()
        )
        assert_meant(imported, campaign)
        assert_imported_again(path, imported)
    except InputError as error:
        raise AssertionError(
            f"{error}\n{campaign.options}\n{campaign.content[:600]!r}"
        ) from error
    options = {
        key: value
        for key, value in campaign.options.items()
        if key not in dropped_options
    }
    outcomes = []

    def read():
        robot = campaign.make_robot() if robot_is_known else None
        imported = read_measurement_table(path, ImportOptions(**options), robot)
        assert_meant(imported, campaign)
        outcomes.append("read")

    assert_read_or_refused_from(path, campaign.content, read)
    event(outcomes[0] if outcomes else "asked")
