"""`elastocal import`: what people have, to the files that elastocal reads."""

from __future__ import annotations

import typer

from elastocal.command.import_csv import csv
from elastocal.command.import_dh import dh
from elastocal.command.import_urdf import urdf

importing = typer.Typer(name="import", no_args_is_help=True)


@importing.callback()
def import_() -> None:
    """Read what you have: a robot as URDF or Denavit-Hartenberg table, measurements in another CSV format."""


importing.command()(urdf)
importing.command()(dh)
importing.command()(csv)
