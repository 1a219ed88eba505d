"""A campaign of any robot as any program may write it: what stands in the file, and the options that it leaves to be stated."""

import csv
import io
from dataclasses import dataclass, field

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from elastocal.exchange.csv_dialect import SEPARATORS

SCALES = {"m": 1.0, "mm": 1e-3, "in": 0.0254, "rad": 1.0, "deg": np.pi / 180, "mrad": 1e-3, "N": 1.0, "kN": 1e3, "Nm": 1.0}
# How joints are called, by their number from 1.
JOINTS = {
    "q1": lambda j: f"q{j}",
    "J1": lambda j: f"J{j}",
    "Axis 1": lambda j: f"Axis {j}",
    "joint_1": lambda j: f"joint_{j}",
    "q[1]": lambda j: f"q[{j}]",
    "J(1)": lambda j: f"J({j})",
    "q[0]": lambda j: f"q[{j - 1}]",
    "actual_q_0": lambda j: f"actual_q_{j - 1}",
    "rax_1": lambda j: f"rax_{j}",
    "as a topic": lambda j: f"/joint_states/J{j}/position",
}
POSITIONS = {
    "x": lambda marker, axis: f"{marker}{'_' if marker else ''}{axis}",
    "X": lambda marker, axis: f"{axis.upper()}{'_' if marker else ''}{marker}",
    "Position X": lambda marker, axis: f"{marker}{' ' if marker else ''}Position {axis.upper()}",
    "tcp/position/x": lambda marker, axis: f"/{marker or 'tcp'}/pose/position/{axis}",
    "A.x": lambda marker, axis: f"{marker}{'.' if marker else ''}{axis}",
}
ROTATIONS = ("none", "vector", "quaternion", "matrix", "homogeneous", "euler:ZYX", "euler:xyz", "euler:ZYZ")
TIMES = ("none", "s", "ms", "iso", "clock")
UNIT_STYLES = ("bracket", "parenthesis", "ending", "row", "none")


@dataclass
class Written:
    """A file's bytes, what it means, and the options that it leaves open.

    `rows`: expected columns of measurements.csv. `options`: fields of `ImportOptions`. `joint_names`: of the robot, empty where
    it has none. `prismatic`: of each joint. `headers`: names of all columns, as messages have them.
    """

    content: bytes
    rows: dict
    options: dict
    joint_names: tuple
    prismatic: tuple
    headers: list
    dialect: dict = field(default_factory=dict)


@st.composite
def written_campaigns(draw):
    """One campaign in one dialect."""
    pick = lambda *values: draw(st.sampled_from(values))  # noqa: E731
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    joints, rail = pick(1, 2, 3, 5, 6, 7, 8, 9), pick(False, True)
    separator, decimal = pick(*SEPARATORS), pick("point", "comma")
    quotes = pick(False, True) if separator != "space" else False
    if decimal == "comma" and separator == "comma":
        quotes = True
    length, angle, force = pick("m", "mm", "in"), pick("rad", "deg", "mrad"), pick("none", "N", "kN")
    shape = pick("one target", "a column", "wide") if separator != "space" else "one target"
    targets = ("SMR",) if shape == "one target" else pick(("A", "B"), ("T1", "T2", "T3"))
    rotation, time = "none" if shape == "wide" else pick(*ROTATIONS), pick(*TIMES)
    poses = int(rng.integers(3, 7))
    # What is measured.
    prismatic = tuple(bool(rail and j == 0) for j in range(joints))
    q = rng.uniform(-2.8, 2.8, (poses, joints))
    position = rng.uniform(-3, 3, (poses, len(targets), 3))
    turns = Rotation.random(poses * len(targets), rng=rng)
    wrench = rng.uniform(-900, 900, (poses, 6)) if force != "none" else np.zeros((poses, 6))
    columns: list[tuple[str, str, list]] = []  # header, unit, cells
    per_pose = shape == "wide"
    options: dict = {"units": {}}

    def rounded(values, scale, digits):
        """As written, and what that means in SI units."""
        cells = np.round(np.asarray(values) / scale, digits)
        return cells, cells * scale

    # Joints.
    style = pick(*JOINTS, "robot") if joints != 4 else "q1"
    q_written = np.empty_like(q)
    names = tuple(f"axis_of_{letter}" for letter in "kjihgfedc"[:joints])
    joint_names = names if style == "robot" else ()
    joint_units = [length if slides else angle for slides in prismatic]
    for j in range(joints):
        q_written[:, j], q[:, j] = rounded(q[:, j], SCALES[joint_units[j]], 6)
    each = {"robot": lambda j: names[j - 1]}.get(style) or JOINTS[style]
    columns += [(each(j + 1), joint_units[j], [*q_written[:, j]]) for j in range(joints)]
    # Positions and orientations, of each marker in a row or of each row.
    called = pick(*POSITIONS) if separator != "space" else pick("x", "X", "tcp/position/x", "A.x")
    p_written, position = rounded(position, SCALES[length], 5)
    matrices = turns.as_matrix().reshape(poses, len(targets), 3, 3)
    own: list[tuple[str, str, np.ndarray]] = []  # quantity, unit, (poses, targets)
    if rotation == "homogeneous":
        whole = np.concatenate([np.round(matrices, 12), p_written[..., None]], axis=-1).reshape(poses, len(targets), 12)
        own += [(f"t{i}{j}", length if j == 4 else "", whole[..., 4 * i + j - 5]) for i in (1, 2, 3) for j in (1, 2, 3, 4)]
    else:
        own += [(axis, length, p_written[..., k]) for k, axis in enumerate("xyz")]
    if rotation == "vector":
        cells, vectors = rounded(turns.as_rotvec(), SCALES[angle], 8)
        matrices = Rotation.from_rotvec(vectors).as_matrix().reshape(poses, len(targets), 3, 3)
        own += [(f"r{axis}", angle, cells[:, k].reshape(poses, -1)) for k, axis in enumerate("xyz")]
    elif rotation == "quaternion":
        quaternions = np.round(turns.as_quat()[:, [3, 0, 1, 2]], 9)
        own += [(name, "", quaternions[:, k].reshape(poses, -1)) for k, name in enumerate(("qw", "qx", "qy", "qz"))]
    elif rotation == "matrix":
        own += [(f"r{i}{j}", "", np.round(matrices[..., i - 1, j - 1], 12)) for i in (1, 2, 3) for j in (1, 2, 3)]
    elif rotation.startswith("euler:"):
        letters = rotation.removeprefix("euler:")
        cells, angles = rounded(turns.as_euler(letters), SCALES[angle], 8)
        matrices = Rotation.from_euler(letters, angles).as_matrix().reshape(poses, len(targets), 3, 3)
        by_axis = len({*letters.lower()}) == 3 and pick(False, True)
        names_of = [f"r{letter}" for letter in letters.lower()] if by_axis else ["e1", "e2", "e3"]
        own += [(name, angle, cells[:, k].reshape(poses, -1)) for k, name in enumerate(names_of)]
    heads = POSITIONS[called]
    if per_pose:
        # Topics of one end are one column to the import: of several targets they are called otherwise.
        heads = POSITIONS["x" if called == "tcp/position/x" else called]
        for t, target in enumerate(targets):
            columns += [(heads(target, axis), unit, [*cells[:, t]]) for axis, unit, cells in own]
    rows = poses if per_pose else poses * len(targets)
    if not per_pose:
        # Long: every row one target, robots' columns repeated.
        columns = [(header, unit, [cell for cell in cells for _ in targets]) for header, unit, cells in columns]
        for quantity, unit, cells in own:
            columns.append((heads("", quantity) if quantity in "xyz" else quantity, unit, [*cells.reshape(-1)]))
        if shape == "a column":
            columns.append((pick("target", "Reflector", "SMR"), "", [*targets] * poses))
    each_row = 1 if per_pose else len(targets)
    # Loads.
    by_robot = force != "none" and pick(False, True)
    if force != "none":
        for k, name in enumerate(("fx", "fy", "fz", "mx", "my", "mz")):
            unit = force if k < 3 else "Nm"
            cells, wrench[:, k] = rounded(wrench[:, k], SCALES[unit], 7)
            columns.append((name, unit, [cell for cell in cells for _ in range(each_row)]))
        if by_robot:
            options["wrench"], wrench = "by-robot", -wrench
    # Time, a pose's number or label, and what nobody needs.
    start, step = 1683195633, 60 * np.arange(poses)
    forms = {
        "s": lambda s: f"{s}", "ms": lambda s: f"{1000 * s}",
        "iso": lambda s: str(np.datetime64(start + s, "s")), "clock": lambda s: str(np.datetime64(start + s, "s"))[11:],
    }  # fmt: skip
    seconds = None
    if time != "none":
        cells = [forms[time](int(s)) for s in step for _ in range(each_row)]
        columns.append(("Time", "ms" if time == "ms" else "", cells))
        zero = {"s": 0, "ms": 0, "clock": start % 86400}.get(time, start)
        seconds = np.repeat(step + zero, len(targets)).astype(float)
        if time == "ms":
            options["units"]["time_s"] = "ms"
    numbered = pick("none", "number", "label")
    if numbered != "none":
        cells = [(f"P{p}" if numbered == "label" else str(10 * p)) for p in range(1, poses + 1) for _ in range(each_row)]
        columns.append((pick("pose", "Pose ID"), "", cells) if separator != "space" else ("pose", "", cells))
    beside = pick(False, True)
    if beside:
        velocity = np.round(rng.uniform(-1, 1, rows), 4)
        columns += [("velocity", "", [*velocity]), ("operator", "", ["somebody"] * rows), ("x_cmd", "", [*velocity])]
    if pick(False, True):
        columns = [columns[k] for k in rng.permutation(len(columns))]
    # Units.
    units = pick(*UNIT_STYLES)
    if units == "row" and separator == "space":
        units = "none"

    def with_unit(header, unit):
        if not unit or units in ("row", "none") or header.startswith("/") or header == "Time":
            return header
        gap = "" if separator == "space" else " "
        styles = {"bracket": f"{header}{gap}[{unit}]", "parenthesis": f"{header}{gap}({unit})", "ending": f"{header}_{unit}"}
        return styles[units]

    stated = units not in ("none",)
    topics = units != "row" and any(header.startswith("/") for header, unit, _ in columns if unit)
    if not stated or topics or units == "ending":
        options["units"] |= {"angles": angle, "lengths": length}
        if force == "kN" and not stated:
            options["units"] |= {name: "kN" for name in ("fx", "fy", "fz")}
    if rail and (not stated or topics) and prismatic[0]:
        options["units"] |= {"q1": length}
    headers = [with_unit(header, unit) for header, unit, _ in columns]
    # Cells.

    def text(cell):
        if isinstance(cell, str):
            return cell
        plain = f"{cell:.12f}".rstrip("0")
        plain = plain + "0" if plain.endswith(".") else plain
        return plain.replace(".", "," if decimal == "comma" else ".")

    if decimal == "comma":
        options["decimal"] = decimal
    body = [[text(cells[row]) for _, _, cells in columns] for row in range(rows)]
    buffer = io.StringIO()
    writer = csv.writer(
        buffer, delimiter=SEPARATORS[separator], quoting=csv.QUOTE_ALL if quotes else csv.QUOTE_MINIMAL, lineterminator="\n"
    )
    preamble = draw(st.integers(0, 3))
    buffer.write("".join(f"Recorded by program {k}\n" for k in range(preamble)))
    comment = pick("", "", "#", "%", "//") if not quotes and units != "row" else ""
    if comment:
        buffer.write(comment + " ")
    writer.writerow(headers)
    if units == "row":
        writer.writerow([unit if not header.startswith("/") or unit else "" for header, unit, _ in columns])
    writer.writerows(body)
    if pick(False, True):
        writer.writerow([""] * len(columns))
    content = buffer.getvalue().replace("\n", pick("\n", "\r\n", "\r"))
    encoding = pick("utf-8", "utf-8-sig", "utf-16", "cp1252")
    if rotation.startswith("euler:") or rotation == "vector":
        options["rotation"] = rotation
    if shape == "one target":
        options["target"] = "SMR"
    elif per_pose:
        written_as = dict(zip((header for header, _, _ in columns), headers, strict=True))
        options["targets"] = {target: [written_as[heads(target, axis)] for axis in "xyz"] for target in targets}
    if pick(False, True):
        options["separator"] = separator
    expected = {f"q{j + 1}": np.repeat(q[:, j], len(targets)) for j in range(joints)}
    expected |= {axis: position[..., k].reshape(-1) for k, axis in enumerate("xyz")}
    expected["target"] = np.array([*targets] * poses)
    if force != "none":
        expected |= dict(zip(("fx", "fy", "fz", "mx", "my", "mz"), np.repeat(wrench, len(targets), axis=0).T, strict=True))
    if seconds is not None:
        expected["time_s"] = seconds
    if rotation != "none":
        expected["rotation"] = matrices.reshape(-1, 3, 3)
    dialect = {
        "joints": style, "positions": called, "shape": shape, "rotation": rotation, "time": time, "units": units,
        "separator": separator, "decimal": decimal, "quotes": quotes, "encoding": encoding,
        "comment": comment, "poses": numbered, "beside": beside,
    }  # fmt: skip
    return Written(content.encode(encoding), expected, options, joint_names, prismatic, headers, dialect)
