"""`elastocal import`: what people have, to the files that elastocal reads."""

from __future__ import annotations

import typer

from elastocal.command.import_csv import csv
from elastocal.command.import_dh import dh
from elastocal.command.import_urdf import urdf
from elastocal.command.printed import example

importing = typer.Typer(name="import", no_args_is_help=True)


@importing.callback()
def import_() -> None:
    """Import a robot (URDF, DH table) or measurements (CSV)."""


importing.command(epilog=example("elastocal import urdf arm.urdf --base base_link --tip tool0 -o robot.yaml"))(urdf)
importing.command(epilog=example("elastocal import dh arm.csv -o robot.yaml"))(dh)
importing.command(epilog=example("elastocal import csv tracker.csv --folder campaigns/cell --target SMR1"))(csv)
