"""Campaigns of any robot in any dialect: the same numbers come back, or one line asks
what is ambiguous; no other number."""

import csv
import io
from dataclasses import dataclass

import numpy as np
import pytest
from fuzzed import over
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
# How joints are called, by their number from 1; positions, without a marker's name and
# with one; when measurements began.
JOINTS = (
    "q{0}",
    "J{0}",
    "Axis {0}",
    "joint_{0}",
    "q[{0}]",
    "J({0})",
    "actual_q_{0}",
    "rax_{0}",
)
POSITIONS = {
    "x": ("{x}", "{marker}_{x}"),
    "X": ("{X}", "{X}_{marker}"),
    "Position X": ("Position {X}", "{marker} Position {X}"),
    "A.x": ("{x}", "{marker}.{x}"),
}
START = 1683195633
FORCES = ("fx", "fy", "fz", "mx", "my", "mz")


@dataclass
class Written:
    """A file's bytes, the columns of measurements.csv that it means, the options that
    it leaves open, and its headers."""

    content: bytes
    rows: dict
    options: dict
    prismatic: tuple
    headers: list


@st.composite
def written_campaigns(draw):
    """One campaign in one dialect."""
    pick = lambda *values: draw(st.sampled_from(values))  # noqa: E731
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    joints = pick(1, 2, 3, 5, 6, 7, 9)
    poses = pick(3, 5, 6)
    separator = pick(*SEPARATORS)
    decimal = pick("point", "comma")
    blank = separator == "space"
    quotes = decimal == separator == "comma" or (not blank and pick(False, True))
    length = pick("m", "mm", "in")
    angle = pick("rad", "deg", "mrad")
    force = pick("", "N", "kN")
    wide = not blank and pick(False, True)
    called = pick("x", "X", "A.x") if blank else pick(*POSITIONS)
    targets = (
        pick(("A", "B"), ("T1", "T2", "T3"))
        if wide
        else pick(("SMR",), ("SMR",) if blank else ("A", "B"))
    )
    rotation = (
        "none"
        if wide
        else pick(
            "none",
            "vector",
            "quaternion",
            "matrix",
            "euler:ZYX",
            "euler:xyz",
            "euler:ZYZ",
        )
    )
    time = pick("", "s", "iso")
    prismatic = tuple(j == 0 and pick(False, True) for j in range(joints))
    options = {"units": {}}
    columns = []
    rows = {}
    places = {}

    def rounded(values, unit, digits):
        """As written, and what that means in SI units."""
        cells = np.round(values / SCALES[unit], digits)
        return cells, cells * SCALES[unit]

    def per_pose(header, unit, cells):
        columns.append(
            (header, unit, list(np.repeat(cells, 1 if wide else len(targets))))
        )

    style = pick(*(name for name in JOINTS if not blank or " " not in name))
    for j, slides in enumerate(prismatic):
        cells, meant = rounded(
            rng.uniform(-2.8, 2.8, poses), length if slides else angle, 6
        )
        per_pose(style.format(j + 1), length if slides else angle, cells)
        rows[f"q{j + 1}"] = np.repeat(meant, len(targets))
    cells, position = rounded(rng.uniform(-3, 3, (poses, len(targets), 3)), length, 5)
    turns = Rotation.random(poses * len(targets), rng=rng)
    own = [(axis, length, cells[..., k]) for k, axis in enumerate("xyz")]
    if rotation == "quaternion":
        turned = np.round(turns.as_quat(scalar_first=True), 9)
        own += [
            (name, "", turned[:, k]) for k, name in enumerate(("qw", "qx", "qy", "qz"))
        ]
    elif rotation == "matrix":
        turned = np.round(turns.as_matrix(), 12)
        own += [
            (f"r{i + 1}{j + 1}", "", turned[:, i, j])
            for i in range(3)
            for j in range(3)
        ]
    elif rotation != "none":
        letters = rotation.removeprefix("euler:")
        turned, meant = rounded(
            turns.as_rotvec() if rotation == "vector" else turns.as_euler(letters),
            angle,
            8,
        )
        turns = (
            Rotation.from_rotvec(meant)
            if rotation == "vector"
            else Rotation.from_euler(letters, meant)
        )
        names = ["rx", "ry", "rz"] if rotation == "vector" else ["e1", "e2", "e3"]
        own += [(name, angle, turned[:, k]) for k, name in enumerate(names)]
        options["rotation"] = rotation
    for quantity, unit, values in own:
        values = np.reshape(values, (poses, len(targets)))
        for t, marker in enumerate(targets if wide else [""]):
            words = POSITIONS[called][wide]
            header = (
                words.format(x=quantity, X=quantity.upper(), marker=marker)
                if quantity in "xyz"
                else quantity
            )
            if wide:
                places.setdefault(marker, []).append(len(columns))
            columns.append(
                (header, unit, list(values[:, t] if wide else values.ravel()))
            )
    rows |= {axis: position[..., k].ravel() for k, axis in enumerate("xyz")} | {
        "target": np.array([*targets] * poses)
    }
    if rotation != "none":
        rows["rotation"] = turns.as_matrix()
    if not wide and len(targets) > 1:
        columns.append((pick("target", "Reflector", "SMR"), "", [*targets] * poses))
    elif not wide:
        options["target"] = "SMR"
    if force:
        sign = pick(1, -1)
        options |= {"wrench": "by-robot"} if sign < 0 else {}
        for name in FORCES:
            unit = force if name[0] == "f" else "Nm"
            cells, meant = rounded(rng.uniform(-900, 900, poses), unit, 7)
            per_pose(name, unit, cells)
            rows[name] = sign * np.repeat(meant, len(targets))
    if time:
        seconds = 60 * np.arange(poses)
        per_pose(
            "Time",
            "",
            [
                f"{s}" if time == "s" else str(np.datetime64(START + int(s), "s"))
                for s in seconds
            ],
        )
        rows["time_s"] = np.repeat(
            seconds + (0 if time == "s" else START), len(targets)
        ).astype(float)
    if numbered := pick("", "{}0", "P{}"):
        per_pose(
            "pose" if blank else pick("pose", "Pose ID"),
            "",
            [numbered.format(p) for p in range(1, poses + 1)],
        )
    if pick(False, True):
        per_pose("velocity", "", np.round(rng.uniform(-1, 1, poses), 4))
        per_pose("operator", "", ["somebody"] * poses)
    order = (
        list(rng.permutation(len(columns)))
        if pick(False, True)
        else list(range(len(columns)))
    )
    columns = [columns[k] for k in order]

    # Units stand in headers, in a row of their own, or nowhere.
    style = pick("{} [{}]", "{} ({})", "{}_{}", "none", *([] if blank else ["row"]))
    style = style.replace(" ", "") if blank else style
    bare = style in ("row", "none")
    headers = [h if not u or bare else style.format(h, u) for h, u, _ in columns]
    if wide:
        options["targets"] = {
            marker: [headers[order.index(place)] for place in three]
            for marker, three in places.items()
        }
    if rotation.startswith("euler:"):
        options["columns"] = {
            name: headers[[h for h, _, _ in columns].index(name)]
            for name in ("e1", "e2", "e3")
        }
    if style in ("none", "{}_{}"):
        options["units"] |= {"angles": angle, "lengths": length} | (
            {"q1": length} if prismatic[0] else {}
        )
    if force == "kN" and style == "none":
        options["units"] |= {name: "kN" for name in FORCES[:3]}
    if decimal == "comma":
        options["decimal"] = decimal
    if pick(False, True):
        options["separator"] = separator

    def text(cell):
        return (
            cell
            if isinstance(cell, str)
            else f"{cell:.12f}".replace(".", "," if decimal == "comma" else ".")
        )

    file = io.StringIO()
    file.write(
        "".join(f"Recorded by program {k}\n" for k in range(draw(st.integers(0, 3))))
    )
    file.write("" if quotes or style == "row" else pick("", "", "# ", "% ", "// "))
    quoting = csv.QUOTE_ALL if quotes else csv.QUOTE_MINIMAL
    writer = csv.writer(
        file, delimiter=SEPARATORS[separator], quoting=quoting, lineterminator="\n"
    )
    writer.writerow(headers)
    if style == "row":
        writer.writerow([unit for _, unit, _ in columns])
    writer.writerows(
        [
            [text(cells[row]) for _, _, cells in columns]
            for row in range(len(columns[0][2]))
        ]
    )
    content = file.getvalue().replace("\n", pick("\n", "\r\n", "\r"))
    encoding = pick("utf-8", "utf-8-sig", "utf-16", "cp1252")
    return Written(content.encode(encoding), rows, options, prismatic, headers)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    made = tmp_path_factory.mktemp("dialects") / "table.csv"
    made.touch()
    return made


def robot_for(made):
    words = " Tx(0.3) ".join(
        f"{'Tz' if slides else 'Rz'}(q{j})"
        for j, slides in enumerate(made.prismatic, 1)
    )
    return robot_of(f"{words} Tx(0.2) [end]")


def assert_meant(found, made):
    """The numbers of the file, in SI units and base axes, and nothing else."""
    table = found.table
    for name, values in made.rows.items():
        if name == "target":
            assert table["target"].tolist() == values.tolist()
        elif name == "rotation":
            got = Rotation.from_rotvec(
                np.column_stack([table[each] for each in ("rx", "ry", "rz")])
            ).as_matrix()
            np.testing.assert_allclose(got, values, atol=1e-6)
        else:
            np.testing.assert_allclose(
                table[name], values, rtol=1e-9, atol=1e-9, err_msg=name
            )
    assert ("rx" in table) == ("rotation" in made.rows)
    assert set(table) <= {*made.rows, "rx", "ry", "rz", "pose", "load", "repeat"}
    # Nothing of the file is left unmentioned.
    words = " ".join(found.notes)
    mentioned = {*(found.options.columns or {}).values(), *found.ignored}
    assert [
        header
        for header in made.headers
        if header not in mentioned and repr(header) not in words
    ] == []
    poses = np.unique(
        np.column_stack([table[name] for name in table if name[0] == "q"]), axis=0
    )
    assert len(np.unique(table["pose"])) == len(poses)


@given(
    written_campaigns(),
    st.sets(
        st.sampled_from(
            ["units", "rotation", "target", "targets", "decimal", "separator"]
        )
    ),
    st.booleans(),
)
def test_a_campaign_is_read_as_it_was_measured_and_what_is_not_stated_found_out_rightly_or_asked_for(
    path, made, dropped, known
):
    try:
        path.write_bytes(made.content)
        found = read_measurement_table(
            path, ImportOptions(**made.options), robot_for(made)
        )
        assert_meant(found, made)
        again = read_measurement_table(path, found.options)
    except InputError as error:
        raise AssertionError(
            f"{error}\n{made.options}\n{made.content[:600]!r}"
        ) from error
    assert again.options == found.options
    assert all(
        np.array_equal(again.table[name], found.table[name]) for name in found.table
    )
    options = {key: value for key, value in made.options.items() if key not in dropped}
    outcome = []

    def read():
        found = read_measurement_table(
            path, ImportOptions(**options), robot_for(made) if known else None
        )
        assert_meant(found, made)
        outcome.append("read")

    over(path, made.content, read)
    event(outcome[0] if outcome else "asked")
