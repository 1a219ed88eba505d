"""`elastocal import urdf`: a robot file from a URDF."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from elastocal.command.quantities import LARGEST_RELATIVE_STD
from elastocal.errors import printable
from elastocal.exchange.robot_text import refuse_existing, summary, write_robot
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.exchange.urdf_weights import RELATIVE_STD


class Limits(StrEnum):
    """Units of limits of joints that turn."""

    RAD, DEG = "rad", "deg"


def urdf(
    file: Annotated[Path, typer.Argument(help="The URDF; of a xacro file, what xacro makes of it.")],
    base: Annotated[str, typer.Option(help="Link whose frame is the robot's base frame.")],
    tip: Annotated[str, typer.Option(help="Link at the end; its frame is the last measuring point.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The robot file to write.")],
    point: Annotated[list[str] | None, typer.Option(help="A link between them that targets may sit on; any number.")] = None,
    limits: Annotated[
        Limits | None, typer.Option(help="Unit of the limits of joints that turn; asked for where they look like degrees.")
    ] = None,
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
    """Make a robot file of the chain between two links of a URDF.

    It has the lengths, the joint limits and the masses of that chain.
    """
    refuse_existing(output, force)
    result = robot_from_urdf(file, base, tip, point or (), mass_std, limits.value if limits else None)
    write_robot(result, output)
    typer.echo("\n".join(map(printable, [*summary(result), f"written: {output.as_posix()}"])))
