"""`elastocal import dh`: a robot file from a Denavit-Hartenberg table."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from elastocal.command.quantities import LARGEST_RELATIVE_STD
from elastocal.errors import printable
from elastocal.exchange.dh import RELATIVE_STD, robot_from_dh
from elastocal.exchange.dh_table import DhOptions
from elastocal.exchange.robot_text import refuse_existing, summary, write_robot


class Angles(StrEnum):
    """Units of angles."""

    DEG = "deg"
    RAD = "rad"


class Decimal(StrEnum):
    """Decimal marks."""

    POINT, COMMA = "point", "comma"


class Lengths(StrEnum):
    """Units of lengths."""

    M = "m"
    MM = "mm"


def dh(
    file: Annotated[Path, typer.Argument(help="The table, .csv or .yaml; or the kinematics file of the ROS driver.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The robot file to write.")],
    modified: Annotated[bool, typer.Option("--modified", help="Craig's notation: alpha and a come before the joint.")] = False,
    angles: Annotated[Angles | None, typer.Option(help="Unit of columns of angles that state none.")] = None,
    lengths: Annotated[Lengths | None, typer.Option(help="Unit of columns of lengths that state none.")] = None,
    decimal: Annotated[Decimal | None, typer.Option(help="Mark of a CSV table; a comma has to be stated.")] = None,
    ignore: Annotated[list[str] | None, typer.Option(help="Column to leave out; as often as needed.")] = None,
    name: Annotated[str | None, typer.Option(help="Maker and model. Default: the name of the file.")] = None,
    mass_std: Annotated[
        float,
        typer.Option(
            min=0.001,
            max=LARGEST_RELATIVE_STD,
            help="How well the masses are known: standard deviation over the value.",
        ),
    ] = RELATIVE_STD,
    force: Annotated[bool, typer.Option("--force", help="Replace the file that is there.")] = False,
) -> None:
    """Make a robot file of a Denavit-Hartenberg table.

    The table has one row for each joint. Columns: theta_offset_deg, d_m, a_m, alpha_deg; optionally joint, type (R, P or F),
    lower_deg, upper_deg, compliance_urad_per_Nm, mass_kg, cx_m, cy_m, cz_m, point. The first two rows of a UR5e, standard
    notation:

    joint, theta_offset_deg, d_m, a_m, alpha_deg, type

    1, 0, 0.1625, 0, 90, R

    2, 0, 0, -0.425, 0, R
    """
    refuse_existing(output, force)
    units = (angles.value if angles else None, lengths.value if lengths else None)
    options = DhOptions(*units, decimal.value if decimal else None, tuple(ignore or ()))
    result = robot_from_dh(file, modified, options, name, mass_std)
    write_robot(result, output)
    typer.echo("\n".join(map(printable, [*summary(result), f"written: {output.as_posix()}"])))
