"""`elastocal import`: what people have, robots and measurements, to the files that
elastocal reads."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from elastocal.command.terminal import MOST_ROWS, example, print_lines, robots
from elastocal.counting import format_count
from elastocal.errors import InputError

if TYPE_CHECKING:
    from elastocal.exchange.measurement_table import ImportedMeasurements
    from elastocal.exchange.robot_text import Imported

importing = typer.Typer(name="import", no_args_is_help=True)
_Output = Annotated[Path, Option("--output", "-o", help="The robot file to write.")]
_Force = Annotated[bool, Option("--force", help="Replace the file that is there.")]


@importing.callback()
def import_() -> None:
    """Import a robot (URDF, DH table) or measurements (CSV)."""


@importing.command(
    epilog=example(
        "elastocal import urdf arm.urdf --base base_link --tip tool0 -o robot.yaml"
    )
)
def urdf(
    file: Annotated[
        Path, Argument(help="The URDF; of a xacro file, what xacro makes of it.")
    ],
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

    refuse_existing(output, force)
    _write(robot_from_urdf(file, base, tip, point or ()), output)


@importing.command(epilog=example("elastocal import dh arm.csv -o robot.yaml"))
def dh(
    file: Annotated[
        Path,
        Argument(
            help="The table, .csv; or the kinematics file of the ROS driver, .yaml."
        ),
    ],
    output: _Output,
    modified: Annotated[
        bool,
        Option(
            "--modified", help="Craig's notation: alpha and a come before the joint."
        ),
    ] = False,
    angles: Annotated[
        Literal["deg", "rad"] | None,
        Option(help="Unit of columns of angles that state none."),
    ] = None,
    lengths: Annotated[
        Literal["m", "mm"] | None,
        Option(help="Unit of columns of lengths that state none."),
    ] = None,
    decimal: Annotated[
        Literal["point", "comma"] | None,
        Option(help="Mark of a CSV table. Default: found out."),
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
    alpha_deg; optionally joint and type (R). The first two rows of a UR5e, standard
    notation:

    joint, theta_offset_deg, d_m, a_m, alpha_deg, type

    1, 0, 0.1625, 0, 90, R

    2, 0, 0, -0.425, 0, R
    """
    from elastocal.exchange.dh import DhOptions, robot_from_dh
    from elastocal.exchange.robot_text import refuse_existing

    refuse_existing(output, force)
    options = DhOptions(angles, lengths, decimal, tuple(ignore or ()))
    _write(robot_from_dh(file, modified, options, name), output)


@importing.command(
    epilog=example(
        "elastocal import csv tracker.csv --folder campaigns/cell --target SMR1"
    )
)
def csv(
    file: Annotated[Path, Argument(help="The table: CSV, tabs, semicolons, spaces.")],
    folder: Annotated[
        Path, Option(help="Folder of the campaign; measurements.csv goes there.")
    ],
    angles: Annotated[
        str | None, Option(help="Unit of angles whose header has none: deg, rad, mrad.")
    ] = None,
    lengths: Annotated[
        str | None, Option(help="Unit of lengths whose header has none: m, mm, um, in.")
    ] = None,
    rotation: Annotated[
        str | None,
        Option(
            help="none, vector, quaternion, matrix, homogeneous, euler:ZYX (moving axes), euler:xyz (fixed)."
        ),
    ] = None,
    names: Annotated[
        str | None,
        Option(
            "--columns",
            help="Of a table without a header: names in order, q1,q2,…; none to leave one out.",
        ),
    ] = None,
    column: Annotated[
        list[str] | None,
        Option(help="NAME=HEADER, such as q1=Axis_A1; as often as needed."),
    ] = None,
    ignore: Annotated[
        list[str] | None,
        Option(help="Header of a column to leave out; as often as needed."),
    ] = None,
    unit: Annotated[
        list[str] | None, Option(help="NAME=UNIT of one column, such as fx=kN.")
    ] = None,
    target: Annotated[
        list[str] | None,
        Option(
            help="Name of the target where no column has it; of each of several in a row NAME=X,Y,Z, its columns."
        ),
    ] = None,
    wrench: Annotated[
        Literal["on-robot", "by-robot"], Option(help="Forces on the robot, or by it.")
    ] = "on-robot",
    skip_empty: Annotated[
        bool, Option("--skip-empty", help="Leave out rows without a position.")
    ] = False,
    decimal: Annotated[
        Literal["point", "comma"] | None,
        Option(help="Mark of decimals. Default: found out."),
    ] = None,
    encoding: Annotated[
        str | None,
        Option(help="Such as cp1252. Default: UTF-8, or UTF-16 by its mark."),
    ] = None,
    header: Annotated[
        int | None,
        Option(min=1, max=MOST_ROWS, help="Line with the names. Default: found out."),
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
    ambiguous is asked for. Poses, loads and repeats are counted where no column numbers
    them. The end of the output states what was read, how, and what was left out.
    """
    from rich.console import Console

    from elastocal.campaigns.campaign import DOCUMENT
    from elastocal.campaigns.campaign_folder import read_campaign_folder
    from elastocal.campaigns.measurements import CSV, PARQUET, write_measurements
    from elastocal.campaigns.reading import read_robot
    from elastocal.exchange.measurement_table import (
        ImportOptions,
        read_measurement_table,
    )
    from elastocal.io.atomic_writes import check_places, write_together

    check_places(folder / CSV, folder / PARQUET)
    if (folder / PARQUET).exists() or (
        (folder / CSV).exists() and not force and _is_filled(folder / CSV)
    ):
        allowed = "another folder, or --force to replace measurements.csv"
        raise InputError(folder, "", "measurements that are there already", allowed)
    alone = target is not None and len(target) == 1 and "=" not in target[0]
    targets = {
        name: [header.strip() for header in headers.split(",")]
        for name, headers in _pairs("--target", None if alone else target).items()
    }
    if wrong := next(
        (name for name, headers in targets.items() if len({*headers}) != 3), None
    ):
        raise InputError(
            "--target",
            "",
            f"{wrong}={','.join(targets[wrong])}",
            "NAME=X,Y,Z, the columns of its position",
        )
    options = ImportOptions(
        decimal=decimal,
        header=header,
        encoding=encoding,
        columns=_pairs("--column", column),
        units=_pairs("--unit", unit)
        | {
            kind: word
            for kind, word in (("angles", angles), ("lengths", lengths))
            if word
        },
        rotation=rotation,
        target=target[0] if target and alone else None,
        wrench=wrench,
        skip_empty=skip_empty,
        ignore=ignore or [],
        targets=targets,
        names=[name.strip() for name in names.split(",")] if names else (),
    )
    known: set[str] = set()
    if (folder / DOCUMENT).is_file():
        campaign = read_campaign_folder(folder, robots())
        robot = robot or campaign.robot_file
        known = {*campaign.document["targets"]}
    found = read_measurement_table(
        file, options, None if robot is None else read_robot(robot)
    )
    with write_together(folder, (CSV,)) as partial:
        write_measurements(partial / CSV, found.table, found.joints)
    lines = [*_summary(found), f"written: {(folder / CSV).as_posix()}"]
    if known and (new := ", ".join(sorted({*found.table["target"].tolist()} - known))):
        lines.append(
            f"! campaign.yaml there has no target {new}: name it there, or in place of one of its own"
        )
    print_lines(lines, Console())


def _write(result: Imported, output: Path) -> None:
    """Write the robot file, and print what was read."""
    from rich.console import Console

    from elastocal.exchange.robot_text import summary, write_robot

    write_robot(result, output)
    print_lines([*summary(result), f"written: {output.as_posix()}"], Console())


def _pairs(option: str, texts: list[str] | None) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in texts or ():
        name, _, value = map(str.strip, text.partition("="))
        if not (name and value) or name in found:
            raise InputError(option, "", repr(text), "NAME=VALUE, each name once")
        found[name] = value
    return found


def _is_filled(path: Path) -> bool:
    """Whether a sheet holds a measurement: one of `init` or `plan`, without a position
    in any row, may be replaced."""
    import pandas as pd

    try:
        sheet = pd.read_csv(path, comment="#", dtype=str, skipinitialspace=True)
    except ValueError:
        return True
    places = sheet.filter(regex=r"^r?[xyz] *$")
    # Rows of a file without such columns may hold anything.
    return len(sheet) > 0 and (
        places.empty or bool(places.fillna("").map(str.strip).any(axis=None))
    )


def _summary(found: ImportedMeasurements) -> list[str]:
    """What was read, how, and what was left out."""
    import numpy as np

    from elastocal.mechanics.components import WRENCH_NAMES

    table = found.table
    options = found.options
    columns = options.columns
    units = options.units
    poses = len(
        np.unique(
            np.column_stack(
                [table.get("session", np.zeros_like(table["pose"])), table["pose"]]
            ),
            axis=0,
        )
    )
    targets = ", ".join(sorted(set(table["target"].tolist())))
    joints = format_count(found.joints, "joint")
    read = [
        f"{name} from {header!r}{f' in {units[name]}' if name in units else ''}"
        for name, header in columns.items()
    ]
    lists = {
        "left out": [f"{format_count(found.skipped, 'row')} without a position"]
        if found.skipped
        else [],
        "counted, as no column has it": [
            name for name in ("pose", "load", "repeat") if name not in columns
        ],
        "taken for zero, as no column has it": [
            name for name in WRENCH_NAMES if name not in columns
        ],
        "not used": found.ignored,
    }
    return [
        f"{format_count(len(table['pose']), 'measurement')} of {targets} at {format_count(poses, 'pose')}, {joints}",
        f"file: names of columns {f'in line {options.header}' if options.header else 'as stated'}, "
        f"separator {options.separator}, decimal {options.decimal}, encoding {options.encoding}",
        f"read: {'; '.join(read)}",
        f"orientations: {options.rotation}",
        *(f"{what}: {', '.join(names)}" for what, names in lists.items() if names),
        *(f"note: {note}" for note in found.notes),
    ]
