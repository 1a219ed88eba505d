"""`elastocal export`: the calibrated robot as robot file, URDF and a sidecar with what neither can hold."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from elastocal.command.campaign import diagnosed_campaign

ROBOT, URDF, SIDECAR = "robot.yaml", "robot.urdf", "effects.json"


def export(
    folder: Annotated[Path, typer.Argument(help="Folder of a diagnosed campaign.")],
    output: Annotated[Path, typer.Option(help="Folder for the files.")],
    date: Annotated[str, typer.Option(help="Date that the sidecar states; today without.")] = "",
) -> None:
    """Write the calibrated robot: robot file, URDF (its geometry), and a sidecar with springs and effects."""
    from datetime import date as calendar

    import numpy as np
    import yaml

    from elastocal.application.calibrated import OperatingConditions
    from elastocal.application.calibrated_geometry import folded
    from elastocal.application.sidecar import left_out_m, sidecar
    from elastocal.exchange.urdf_writing import urdf_of
    from elastocal.io.atomic_writes import write_text
    from elastocal.io.json_files import write_json
    from elastocal.mechanics.robot_file import document_of

    console = Console(stderr=True)
    found = diagnosed_campaign(folder)
    calibrated = found.calibrated
    robot = folded(calibrated).robot
    stated = f"Calibrated by elastocal from the campaign {found.name}."
    output.mkdir(parents=True, exist_ok=True)
    text = yaml.safe_dump(document_of(robot), sort_keys=False, default_flow_style=None, width=128)
    write_text(output / ROBOT, f"# {stated}\n{text}")
    write_text(output / URDF, urdf_of(robot, f"{stated} Geometry alone: springs and effects are in {SIDECAR}."))
    document = sidecar(calibrated, found.name, date or calendar.today().isoformat())
    write_json(output / SIDECAR, document)
    lines = [f"    {output / name}" for name in (ROBOT, URDF, SIDECAR)]
    if document["effects"]:
        states = found.case.observations.states
        angles = calibrated.robot.reported_angles(states.joint_angles)
        off = left_out_m(calibrated, angles, OperatingConditions(states.wrench, None, states.time_s, states.temperature_c))
        names = ", ".join(entry["key"] for entry in document["effects"])
        largest, rms = 1e3 * off.max(), 1e3 * np.sqrt((off**2).mean())
        lines.insert(0, f"only in {SIDECAR}: {names}; up to {largest:.3f} mm at the measured poses ({rms:.3f} mm RMS)")
    for line in lines:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
