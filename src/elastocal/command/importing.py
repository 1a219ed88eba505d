"""`elastocal import`: converts robots and measurements to the files that elastocal
reads."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer import Argument, Option

from elastocal.command.terminal import (
    MOST_ROWS,
    AnglesOption,
    ColumnOption,
    DecimalOption,
    IgnoreOption,
    LengthsOption,
    RotationOption,
    UnitOption,
    find_robots_folder,
    format_command,
    format_example,
    parse_pairs,
    parse_units,
    print_lines,
)
from elastocal.counting import format_count
from elastocal.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from elastocal.exchange.measurement_table import ImportedMeasurements, OtherFile
    from elastocal.exchange.robot_text import ImportedRobot
    from elastocal.mechanics.robot import Robot

importing = typer.Typer(name="import", no_args_is_help=True)
_Output = Annotated[Path, Option("--output", "-o", help="The robot file to write.")]
# A printed tool is smaller; a larger number is in millimetres.
_LARGEST_DISTANCE_M = 1.0
_Force = Annotated[bool, Option("--force", help="Replace an existing file.")]
_ForceCampaign = Annotated[
    bool, Option("--force", help="Replace an existing campaign.")
]
_RobotFile = Annotated[
    Path | None, Option(help="Robot file to copy into a folder without one.")
]


@importing.callback()
def import_() -> None:
    """Import a robot (URDF, DH table) or measurements (CSV, printed sockets, a board)."""


@importing.command(
    epilog=format_example(
        "elastocal import urdf arm.urdf --base base_link --tip tool0 -o robot.yaml"
    )
)
def urdf(
    file: Annotated[
        Path, Argument(help="The URDF, for a xacro file the output of xacro.")
    ],
    *,
    base: Annotated[str, Option(help="Link whose frame is the robot's base frame.")],
    tip: Annotated[
        str, Option(help="Link at the end; its frame is the last measuring point.")
    ],
    output: _Output,
    point: Annotated[
        list[str] | None,
        Option(help="A link between them that targets may sit on; any number."),
    ] = None,
    force: _Force = False,
) -> None:
    """Make a robot file of the chain between two links of a URDF.

    It has the lengths, the joint limits and the masses of that chain.
    """
    from elastocal.exchange.robot_text import refuse_existing
    from elastocal.exchange.urdf import robot_from_urdf

    refuse_existing(output, force=force)
    _write_robot(robot_from_urdf(file, base, tip, point or ()), output)


@importing.command(epilog=format_example("elastocal import dh arm.csv -o robot.yaml"))
def dh(
    file: Annotated[
        Path,
        Argument(
            help="The table, .csv; or the kinematics file of the ROS driver, .yaml."
        ),
    ],
    *,
    output: _Output,
    modified: Annotated[
        bool,
        Option(
            "--modified", help="Craig's notation: alpha and a come before the joint."
        ),
    ] = False,
    angles: Annotated[
        Literal["deg", "rad"] | None,
        Option(help="Unit of angle columns without a stated unit."),
    ] = None,
    lengths: Annotated[
        Literal["m", "mm"] | None,
        Option(help="Unit of length columns without a stated unit."),
    ] = None,
    decimal: Annotated[
        Literal["point", "comma"] | None,
        Option(help="Decimal mark of a CSV table. Default: detected."),
    ] = None,
    ignore: Annotated[
        list[str] | None, Option(help="Column to leave out; as often as needed.")
    ] = None,
    name: Annotated[
        str | None, Option(help="Maker and model. Default: the name of the file.")
    ] = None,
    force: _Force = False,
) -> None:
    """Make a robot file of a Denavit-Hartenberg table.

    The table has one row for each joint. Columns: theta_offset_deg, d_m, a_m,
    alpha_deg; optionally joint, type (R revolute, P prismatic, F fixed) and the limits
    lower_deg and upper_deg, of a prismatic joint in the unit of d. The first two rows of
    a UR5e, standard notation:

    joint, theta_offset_deg, d_m, a_m, alpha_deg, type

    1, 0, 0.1625, 0, 90, R

    2, 0, 0, -0.425, 0, R
    """
    from elastocal.exchange.dh import DhOptions, robot_from_dh
    from elastocal.exchange.robot_text import refuse_existing

    refuse_existing(output, force=force)
    options = DhOptions(angles, lengths, decimal, tuple(ignore or ()))
    _write_robot(robot_from_dh(file, options, modified=modified, name=name), output)


@importing.command(
    epilog=format_example("elastocal import arms left.yaml right.yaml -o robot.yaml")
)
def arms(
    carrier: Annotated[
        Path, Argument(help="Robot file of the arm whose flange becomes the base.")
    ],
    arm: Annotated[
        Path, Argument(help="Robot file of the other arm, with the same base frame.")
    ],
    *,
    output: _Output,
    force: _Force = False,
) -> None:
    """Make one robot file of two arms that touch each other.

    Its chain begins at the flange of the first arm, passes the common base and ends at
    the flange of the second arm. Measurements state the joint angles of the first arm,
    then those of the second.
    """
    from elastocal.campaigns.reading import read_robot
    from elastocal.exchange.robot_text import check_imported, refuse_existing
    from elastocal.mechanics.robot_file import describe_robot
    from elastocal.mechanics.two_arms import join_arms

    refuse_existing(output, force=force)
    document = describe_robot(join_arms(read_robot(carrier), read_robot(arm)))
    note = "weights are not modelled, because gravity turns in the frame of a flange"
    seen_from = f"seen from the flange of {carrier.name}"
    _write_robot(check_imported(document, arm, seen_from, [note]), output)


@importing.command(
    epilog=format_example(
        "elastocal import csv tracker.csv --folder campaigns/cell --target SMR1"
    )
)
def csv(
    files: Annotated[
        list[Path],
        Argument(
            help="The table: CSV, tabs, semicolons, spaces, .xlsx, .mat. Each of several"
            " tables is a session with its own placement of the tracker."
        ),
    ],
    *,
    folder: Annotated[
        Path, Option(help="Folder of the campaign; measurements.csv goes there.")
    ],
    angles: AnglesOption = None,
    lengths: LengthsOption = None,
    rotation: RotationOption = None,
    names: Annotated[
        str | None,
        Option(
            "--columns",
            help="Names of the columns of a table without a header, q1,q2,…; none leaves"
            " a column out.",
        ),
    ] = None,
    column: ColumnOption = None,
    ignore: IgnoreOption = None,
    unit: UnitOption = None,
    target: Annotated[
        list[str] | None,
        Option(
            help="Name of the target if no column has it. For several targets in a row:"
            " NAME=X,Y,Z, the columns of each."
        ),
    ] = None,
    wrench: Annotated[
        Literal["on-robot", "by-robot"], Option(help="Forces on the robot, or by it.")
    ] = "on-robot",
    skip_empty: Annotated[
        bool, Option("--skip-empty", help="Leave out rows without a position.")
    ] = False,
    decimal: DecimalOption = None,
    encoding: Annotated[
        str | None,
        Option(help="Such as cp1252. Default: UTF-8, or UTF-16 by its mark."),
    ] = None,
    sheet: Annotated[
        str | None,
        Option(help="Sheet of a workbook, or variable of a MATLAB file, of several."),
    ] = None,
    header: Annotated[
        int | None,
        Option(min=1, max=MOST_ROWS, help="Line with the names. Default: detected."),
    ] = None,
    joints: Annotated[
        Path | None,
        Option(help="File with the joint angles, if the table has positions alone."),
    ] = None,
    join: Annotated[
        str | None,
        Option(
            help="How positions are joined to joint angles: COLUMN that both have, time,"
            " or order. Default: by pose, load, repeat and target, or the only column"
            " that both have."
        ),
    ] = None,
    robot: Annotated[
        Path | None,
        Option(
            help="Its joint_names are names of columns. Default: the campaign's robot."
        ),
    ] = None,
    force: Annotated[
        bool, Option("--force", help="Replace a measurements.csv that is filled in.")
    ] = False,
) -> None:
    """Make measurements.csv of another program's table.

    Columns are found by their usual names (q1 or J1 or Axis 1, x, y, z, qw .. qz, r11
    .. r33, t11 .. t34, fx .. mz, pose, load, repeat, target, time) or as the robot's
    file calls its joints, units by brackets or endings ("X [mm]", x_mm). What is
    ambiguous is asked for. Positions without joint angles are joined to the sheet that
    `elastocal plan` wrote into the folder, or to the file of --joints. Poses, loads and
    repeats are counted where no column numbers them. The end of the output states what
    was read, how, and what was left out.
    """
    from rich.console import Console

    from elastocal.campaigns.campaign import ROBOT_FILE
    from elastocal.campaigns.measurements import CSV, write_measurements
    from elastocal.campaigns.reading import read_robot
    from elastocal.exchange.measurement_table import ImportOptions, OtherFile
    from elastocal.exchange.sessions import read_sessions
    from elastocal.io.atomic_writes import write_together

    _check_replaceable(folder, force=force)
    target_name, target_columns = _parse_targets(target or [])
    options = ImportOptions(
        decimal=decimal,
        header=header,
        encoding=encoding,
        sheet=sheet,
        columns=parse_pairs("--column", column),
        units=parse_units(unit, angles, lengths),
        rotation=rotation,
        target=target_name,
        wrench=wrench,
        skip_empty=skip_empty,
        ignore=ignore or [],
        targets=target_columns,
        join=join,
        names=[name.strip() for name in names.split(",")] if names else (),
    )
    declared_targets, declared_robot = _read_declared(folder)
    robot_file = robot or declared_robot
    imported = read_sessions(
        files,
        options,
        read_robot(robot_file) if robot_file else None,
        OtherFile(joints) if joints else _find_sheet(folder),
    )
    with write_together(folder, (CSV,)) as partial:
        write_measurements(partial / CSV, imported.table, imported.joints)
    lines = [*_describe_import(imported), f"written: {(folder / CSV).as_posix()}"]
    unknown = sorted({*imported.table["target"].tolist()} - declared_targets)
    if declared_targets and unknown:
        lines.append(
            f"! campaign.yaml there has no target {', '.join(unknown)}:"
            " name it there, or in place of one of its own"
        )
    next_step = format_command("check", folder)
    if not declared_targets:
        robot_file = robot_file or Path(ROBOT_FILE)
        next_step = format_command("init", folder, "--robot", robot_file)
    print_lines([*lines, f"next: {next_step}"], Console())


@importing.command(
    epilog=format_example(
        "elastocal import sockets data/panda_1 --folder campaigns/arm --robot robot.yaml"
    )
)
def sockets(
    recordings: Annotated[
        Path,
        Argument(
            help="Folder with a folder for each place of the printed tool, and in it a"
            " file hole_0.csv, hole_1.csv … of joint angles for each socket."
        ),
    ],
    *,
    folder: Annotated[Path, Option(help="Folder of the campaign.")],
    distance: Annotated[
        float, Option(help="Distance between the centres of neighbouring sockets, m.")
    ] = 0.05,
    robot: _RobotFile = None,
    force: _ForceCampaign = False,
) -> None:
    """Make a campaign of a ball in printed sockets (MUKCa): joint angles alone.

    Each place of the tool is a session with a frame of its own. Files of poses that the
    controller computed, hole_0_pose.csv, are left aside.
    """
    from elastocal.campaigns.campaign import ROBOT_FILE
    from elastocal.campaigns.socket_recordings import (
        describe_sockets,
        find_recordings,
        read_recording,
        tabulate_recordings,
    )

    _refuse_distance(distance)
    arm = _read_robot_for(folder, robot, force=force)
    paths = find_recordings(recordings)
    files = [read_recording(path) for path in paths]
    table = tabulate_recordings(files)
    if files[0].angles.shape[1] != arm.commands:
        count = f"{files[0].angles.shape[1]} angles in a line"
        allowed = f"{arm.commands}, the joints of {arm.name}"
        raise InputError(paths[0], "", count, allowed)
    document = describe_sockets(
        folder.resolve().name,
        ROBOT_FILE,
        files,
        arm.chain.end_effector.name,
        distance,
    )
    stands = len({recording.stand for recording in files})
    size = (
        f"{format_count(len(table['pose']), 'pose')} in {format_count(len(paths), 'socket')}"
        f" at {format_count(stands, 'place')}, {1e3 * distance:g} mm apart"
    )
    _write_campaign_folder(folder, document, table, arm.joints, robot, [size])


@importing.command(
    epilog=format_example(
        "elastocal import board samples.yaml --joints joints.yaml --folder campaigns/arm"
    )
)
def board(
    file: Annotated[
        Path,
        Argument(
            help="A table of elastocal detect, samples of MoveIt or easy_handeye (YAML),"
            " arrays rvecs and tvecs of OpenCV (.npz), or data of robot_calibration"
            " (CSV of its bag)."
        ),
    ],
    *,
    folder: Annotated[Path, Option(help="Folder of the campaign.")],
    joints: Annotated[
        Path | None,
        Option(
            help="File of joint angles, a row for each sample: a table, or MoveIt's."
        ),
    ] = None,
    camera: Annotated[
        Literal["on-robot", "beside-robot"],
        Option(help="Where the camera is; the board is at the other place."),
    ] = "on-robot",
    angles: AnglesOption = None,
    lengths: Annotated[
        Literal["m", "mm"], Option(help="Unit of the board's positions.")
    ] = "m",
    sensor: Annotated[
        str, Option(help="Camera among the sensors of robot_calibration.")
    ] = "camera",
    robot: _RobotFile = None,
    force: _ForceCampaign = False,
) -> None:
    """Make a campaign of poses of a board that a camera saw.

    Which program wrote the file is found out. Poses are those of the board in the
    camera's optical frame; the robot's own poses in the file are not used, because they
    have the robot's error.
    """
    from elastocal.exchange.board_poses import (
        describe_board_campaign,
        tabulate_board_poses,
    )
    from elastocal.exchange.board_programs import BoardOptions, read_board_poses

    arm = _read_robot_for(folder, robot, force=force)
    options = BoardOptions(joints, angles, lengths, sensor)
    poses = read_board_poses(file, arm, options)
    place = camera.replace("-", "_")
    table = tabulate_board_poses(poses, place)
    document = describe_board_campaign(
        folder.resolve().name, arm.chain.end_effector.name, place, poses.noise
    )
    size = f"{format_count(len(table['pose']), 'pose')} of a board, camera {camera}"
    _write_campaign_folder(folder, document, table, arm.joints, robot, [size])


def _refuse_distance(distance: float) -> None:
    """Refuse a distance that no printed tool has, such as one in millimetres."""
    if not 0.0 < distance < _LARGEST_DISTANCE_M:
        allowed = f"more than 0 and less than {_LARGEST_DISTANCE_M:g} m"
        raise InputError("--distance", "", f"{distance:g}", allowed)


def _read_robot_for(folder: Path, robot: Path | None, *, force: bool) -> Robot:
    """Read the robot of a new campaign, and refuse a campaign that is there already."""
    from elastocal.campaigns.campaign import DOCUMENT, ROBOT_FILE
    from elastocal.campaigns.campaign_folder import check_campaign_name
    from elastocal.campaigns.reading import read_robot
    from elastocal.io.atomic_writes import check_places

    check_campaign_name(folder)
    check_places(folder / DOCUMENT, folder / ROBOT_FILE)
    _check_replaceable(folder, force=force)
    if (folder / DOCUMENT).exists() and not force:
        problem = "a campaign that is there already"
        raise InputError(folder / DOCUMENT, "", problem, "another folder, or --force")
    file = robot or folder / ROBOT_FILE
    if not file.is_file():
        allowed = "--robot FILE; elastocal import urdf makes one"
        raise InputError(file, "", "no robot file", allowed)
    return read_robot(file)


def _write_campaign_folder(
    folder: Path,
    document: dict[str, Any],
    table: dict[str, np.ndarray],
    joints: int,
    robot: Path | None,
    lines: list[str],
) -> None:
    """Write a campaign with its robot file, and print what was read."""
    from rich.console import Console

    from elastocal.campaigns.writing import copy_robot_file, write_campaign

    if robot is not None:
        copy_robot_file(robot, folder)
    write_campaign(folder, document, table, joints, kind="csv")
    next_step = format_command("check", folder)
    written = f"written: {folder.as_posix()}, campaign.yaml and measurements.csv"
    print_lines([*lines, written, f"next: {next_step}"], Console())


def _write_robot(result: ImportedRobot, output: Path) -> None:
    """Write the robot file, and print what was read."""
    from rich.console import Console

    from elastocal.exchange.robot_text import summarize_import, write_robot

    write_robot(result, output)
    next_step = format_command("plan", output, "--folder", "campaigns/cell")
    lines = [f"written: {output.as_posix()}", f"next: {next_step}"]
    print_lines([*summarize_import(result), *lines], Console())


def _check_replaceable(folder: Path, *, force: bool) -> None:
    """Refuse a folder whose measurements would be lost."""
    from elastocal.campaigns.measurements import CSV, PARQUET
    from elastocal.io.atomic_writes import check_places

    sheet = folder / CSV
    check_places(sheet, folder / PARQUET)
    is_lost = sheet.exists() and not force and _is_filled(sheet)
    if is_lost or (folder / PARQUET).exists():
        raise InputError(
            folder,
            "",
            "measurements that are there already",
            "another folder, or --force to replace measurements.csv",
        )


def _find_sheet(folder: Path) -> OtherFile | None:
    """Find the sheet of a plan in a folder; None if it has no rows."""
    from elastocal.campaigns.measurements import CSV, find_files
    from elastocal.exchange.measurement_table import OtherFile

    for path in find_files(folder, CSV):
        if _count_rows(path):
            return OtherFile(path, is_sheet=True)
    return None


def _count_rows(path: Path) -> int:
    """Count the lines of a table below its header and its comments."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    rows = [line for line in lines if line.strip() and not line.startswith("#")]
    return max(len(rows) - 1, 0)


def _is_filled(path: Path) -> bool:
    """Whether a sheet holds a measurement. One of `init` or `plan` without a position in
    any row may be replaced."""
    import pandas as pd

    try:
        sheet = pd.read_csv(path, comment="#", dtype=str, skipinitialspace=True)
    except ValueError:
        return True
    cells = sheet.filter(regex=r"^r?[xyz] *$")
    if cells.empty:
        # A file with rows but without these columns may hold anything.
        return len(sheet) > 0
    return bool(cells.fillna("").map(str.strip).any(axis=None))


def _parse_targets(texts: list[str]) -> tuple[str | None, dict[str, list[str]]]:
    """Parse the option --target: one name for all rows, or the columns ``NAME=X,Y,Z`` of
    each of several targets in a row."""
    if len(texts) == 1 and "=" not in texts[0]:
        return texts[0], {}
    targets = {}
    for name, columns in parse_pairs("--target", texts).items():
        headers = [header.strip() for header in columns.split(",")]
        if len({*headers}) != 3:
            raise InputError(
                "--target",
                "",
                f"{name}={','.join(headers)}",
                "NAME=X,Y,Z, the columns of its position",
            )
        targets[name] = headers
    return None, targets


def _read_declared(folder: Path) -> tuple[set[str], Path | None]:
    """Read the targets and the robot file of a campaign.yaml that is there already."""
    from elastocal.campaigns.campaign import DOCUMENT
    from elastocal.campaigns.campaign_folder import read_campaign_folder

    if not (folder / DOCUMENT).is_file():
        return set(), None
    campaign = read_campaign_folder(folder, find_robots_folder())
    return {*campaign.document["targets"]}, campaign.robot_file


def _describe_import(imported: ImportedMeasurements) -> list[str]:
    """Describe what was read, how, and what was left out."""
    from elastocal.mechanics.components import WRENCH_NAMES

    options = imported.options
    columns = options.columns
    header = f"in line {options.header}" if options.header else "as stated"
    descriptions = []
    for name, column in columns.items():
        unit = f" in {options.units[name]}" if name in options.units else ""
        descriptions.append(f"{name} from {column!r}{unit}")
    skipped = []
    if imported.skipped:
        skipped.append(f"{format_count(imported.skipped, 'row')} without a position")
    lists = {
        "left out": skipped,
        "counted, as no column has it": [
            name for name in ("pose", "load", "repeat") if name not in columns
        ],
        "taken for zero, as no column has it": [
            name for name in WRENCH_NAMES if name not in columns
        ],
        "not used": imported.ignored,
    }
    lines = [
        _describe_size(imported),
        f"file: names of columns {header}, separator {options.separator},"
        f" decimal {options.decimal}, encoding {options.encoding}",
        f"read: {'; '.join(descriptions)}",
        f"orientations: {options.rotation}",
    ]
    for title, names in lists.items():
        if names:
            lines.append(f"{title}: {', '.join(names)}")
    return lines + [f"note: {note}" for note in imported.notes]


def _describe_size(imported: ImportedMeasurements) -> str:
    """Count measurements, poses and joints, and name the targets."""
    import numpy as np

    pose = imported.table["pose"]
    session = imported.table.get("session", np.zeros_like(pose))
    poses = len(np.unique(np.column_stack([session, pose]), axis=0))
    targets = ", ".join(sorted(set(imported.table["target"].tolist())))
    return (
        f"{format_count(len(pose), 'measurement')} of {targets}"
        f" at {format_count(poses, 'pose')}, {format_count(imported.joints, 'joint')}"
    )
