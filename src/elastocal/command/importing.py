"""`elastocal import`: what people have, to the files that elastocal reads; robots here, measurements in `import_csv`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from elastocal.command.import_csv import csv
from elastocal.command.printed import example
from elastocal.command.quantities import LARGEST_RELATIVE_STD
from elastocal.errors import printable
from elastocal.exchange import DH_MASS_STD, URDF_MASS_STD

if TYPE_CHECKING:
    from elastocal.exchange.robot_text import Imported

importing = typer.Typer(name="import", no_args_is_help=True)
_Output = Annotated[Path, Option("--output", "-o", help="The robot file to write.")]
_Force = Annotated[bool, Option("--force", help="Replace the file that is there.")]
_MassStd = Annotated[
    float,
    Option(min=0.001, max=LARGEST_RELATIVE_STD, help="How well the masses are known: standard deviation over the value."),
]


@importing.callback()
def import_() -> None:
    """Import a robot (URDF, DH table) or measurements (CSV)."""


@importing.command(epilog=example("elastocal import urdf arm.urdf --base base_link --tip tool0 -o robot.yaml"))
def urdf(
    file: Annotated[Path, Argument(help="The URDF; of a xacro file, what xacro makes of it.")],
    base: Annotated[str, Option(help="Link whose frame is the robot's base frame.")],
    tip: Annotated[str, Option(help="Link at the end; its frame is the last measuring point.")],
    output: _Output,
    point: Annotated[list[str] | None, Option(help="A link between them that targets may sit on; any number.")] = None,
    limits: Annotated[
        Literal["deg", "rad"] | None,
        Option(help="Unit of the limits of joints that turn; asked for where they look like degrees."),
    ] = None,
    mass_std: _MassStd = URDF_MASS_STD,
    force: _Force = False,
) -> None:
    """Make a robot file of the chain between two links of a URDF.

    It has the lengths, the joint limits and the masses of that chain.
    """
    from elastocal.exchange.robot_text import refuse_existing
    from elastocal.exchange.urdf import robot_from_urdf

    refuse_existing(output, force)
    _write(robot_from_urdf(file, base, tip, point or (), mass_std, limits), output)


@importing.command(epilog=example("elastocal import dh arm.csv -o robot.yaml"))
def dh(
    file: Annotated[Path, Argument(help="The table, .csv; or the kinematics file of the ROS driver, .yaml.")],
    output: _Output,
    modified: Annotated[bool, Option("--modified", help="Craig's notation: alpha and a come before the joint.")] = False,
    angles: Annotated[Literal["deg", "rad"] | None, Option(help="Unit of columns of angles that state none.")] = None,
    lengths: Annotated[Literal["m", "mm"] | None, Option(help="Unit of columns of lengths that state none.")] = None,
    decimal: Annotated[Literal["point", "comma"] | None, Option(help="Mark of a CSV table. Default: found out.")] = None,
    ignore: Annotated[list[str] | None, Option(help="Column to leave out; as often as needed.")] = None,
    name: Annotated[str | None, Option(help="Maker and model. Default: the name of the file.")] = None,
    mass_std: _MassStd = DH_MASS_STD,
    force: _Force = False,
) -> None:
    """Make a robot file of a Denavit-Hartenberg table.

    The table has one row for each joint. Columns: theta_offset_deg, d_m, a_m, alpha_deg; optionally joint, type (R, P or F),
    lower_deg, upper_deg, compliance_urad_per_Nm, mass_kg, cx_m, cy_m, cz_m, point. The first two rows of a UR5e, standard
    notation:

    joint, theta_offset_deg, d_m, a_m, alpha_deg, type

    1, 0, 0.1625, 0, 90, R

    2, 0, 0, -0.425, 0, R
    """
    from elastocal.exchange.dh import DhOptions, robot_from_dh
    from elastocal.exchange.robot_text import refuse_existing

    refuse_existing(output, force)
    options = DhOptions(angles, lengths, decimal, tuple(ignore or ()))
    _write(robot_from_dh(file, modified, options, name, mass_std), output)


importing.command(epilog=example("elastocal import csv tracker.csv --folder campaigns/cell --target SMR1"))(csv)


def _write(result: "Imported", output: Path) -> None:
    """Write the robot file, and print what was read."""
    from elastocal.exchange.robot_text import summary, write_robot

    write_robot(result, output)
    typer.echo("\n".join(map(printable, [*summary(result), f"written: {output.as_posix()}"])))
