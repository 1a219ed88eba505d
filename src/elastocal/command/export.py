"""`elastocal export`: the calibrated robot as robot file, URDF and DH parameters, and a sidecar with what these cannot hold."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from elastocal.command.campaign import AcceptEnvironment, diagnosed_campaign
from elastocal.command.printed import print_answer
from elastocal.counting import counted
from elastocal.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from elastocal.exchange.urdf_writing import CorrectedUrdf
    from elastocal.mechanics.robot import Robot

ROBOT, URDF, SIDECAR = "robot.yaml", "robot.urdf", "effects.json"
_ROUNDING_MM = 1e-5
DH, DELTAS = "dh.csv", "dh_deltas.csv"
_NAMES = (ROBOT, URDF, SIDECAR, DH, DELTAS)


def export(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    output: Annotated[Path, Option(help="Folder for the files.")],
    urdf: Annotated[
        Path | None, Option(help="The URDF that the robot was imported from. Its joint origins are changed, nothing else.")
    ] = None,
    date: Annotated[str, Option(help="Date that the sidecar states. Default: today.")] = "",
    accept_environment: AcceptEnvironment = False,
) -> None:
    """Write the calibrated robot: robot file, URDF, DH, effects.

    URDF and DH parameters hold the geometry; effects.json holds springs and effects as well. None holds the regression on the
    remainder: what is lost with it is said, and the accuracy stated is without.
    """
    from datetime import date as calendar

    import numpy as np
    import yaml
    from rich.console import Console

    from elastocal.application.accuracy import accuracy_sentence, campaign_accuracy
    from elastocal.application.calibrated import OperatingConditions, regressed
    from elastocal.application.exported import find_left_out_m, fold_effects, sidecar
    from elastocal.exchange.urdf_writing import write_calibrated_origins
    from elastocal.io.atomic_writes import check_places, write_text, write_together
    from elastocal.io.json_files import write_json
    from elastocal.mechanics.robot_file import document_of

    console = Console(stderr=True)
    check_places(*(output / name for name in _NAMES))
    if urdf is not None and (output / URDF).resolve() == urdf.resolve():
        raise InputError(urdf, "", "the file that would be replaced", "a URDF outside of --output")
    whole = diagnosed_campaign(folder, accept_environment)
    # No file has the regression: what stands in them is of a robot without.
    found = whole if whole.calibrated.remainder is None else diagnosed_campaign(folder, accept_environment, physics_only=True)
    calibrated = found.calibrated
    robot = fold_effects(calibrated).robot
    drop_in = None if urdf is None else write_calibrated_origins(urdf, calibrated.robot, robot)
    stated = f"Calibrated by elastocal from the campaign {found.name}."
    text = yaml.safe_dump(document_of(robot), sort_keys=False, default_flow_style=None, width=128)
    accuracy = campaign_accuracy(calibrated)
    document = sidecar(calibrated, found.name, date or calendar.today().isoformat(), accuracy)
    lines = [accuracy_sentence(accuracy), *(str(output / name) for name in (ROBOT, *([URDF] if urdf else []), SIDECAR))]
    with write_together(output, _NAMES) as partial:
        write_text(partial / ROBOT, f"# {stated}\n{text}")
        if drop_in is not None:
            (partial / URDF).write_bytes(drop_in.content)
            lines += _drop_in(drop_in, partial / URDF, calibrated.robot, robot, found.case.observations.states.joint_angles)
        write_json(partial / SIDECAR, document)
        lines += _denavit_hartenberg(calibrated.robot, robot, partial, output)
    states = found.case.observations.states
    at = calibrated.robot.reported_angles(states.joint_angles)
    under = OperatingConditions(states.wrench, None, states.time_s, states.temperature_c)
    if document["effects"]:
        names = ", ".join(entry["key"] for entry in document["effects"])
        lines.insert(0, f"! only {SIDECAR} holds {names}: {_sizes(find_left_out_m(calibrated, at, under))}")
    if found is not whole:
        words, lost = whole.verdict["remainder"]["words"], np.linalg.norm(regressed(whole.calibrated, at, under), axis=1)
        lines.insert(0, f"! no file holds the {words} on the remainder, which elastocal correct adds: {_sizes(lost)}")
    print_answer(True, f"{found.name}: calibrated robot in {output}", lines, "", console)


def _sizes(off: np.ndarray) -> str:
    """How far something moves the end effector (N,), m, in words."""
    return f"up to {1e3 * off.max():.3f} mm at the measured poses ({1e3 * float((off**2).mean()) ** 0.5:.3f} mm RMS)"


def _drop_in(drop_in: CorrectedUrdf, path: Path, nominal: Robot, robot: Robot, angles: np.ndarray) -> list[str]:
    """Lines to print: what became of the user's URDF, and how far its poses at measured angles are from the robot file's."""
    import numpy as np

    from elastocal.exchange.urdf import read_urdf
    from elastocal.exchange.urdf_writing import nominal_chain
    from elastocal.mechanics.kinematics import poses

    _, chain = nominal_chain(read_urdf(path), drop_in.base, drop_in.tip, path.as_posix())
    theirs, _ = poses(chain, angles, chain.end_effector)
    mine, _ = poses(robot.chain, robot.model_angles(nominal.reported_angles(angles)), robot.chain.end_effector)
    off = 1e3 * float(np.linalg.norm(theirs - mine, axis=1).max())
    lines = [
        f"{URDF}: {counted(drop_in.changed, 'joint origin')} changed, nothing else; put it where the old one is, beside its "
        "meshes"
    ]
    if off > _ROUNDING_MM:
        what = "ratios of joints, and errors behind a last joint that has no fixed one after it"
        lines.append(f"{URDF} cannot hold {what}: up to {off:.3f} mm at the measured poses")
    return lines


def _denavit_hartenberg(nominal: Robot, robot: Robot, partial: Path, output: Path) -> list[str]:
    """Write the DH parameters, and by how much they differ from the nominal ones; lines to print."""
    from elastocal.exchange.dh_writing import dh_deltas, dh_table
    from elastocal.io.data_frames import write_csv

    try:
        table = dh_table(robot, nominal)
    except InputError as error:
        return [f"no DH parameters: {error}"]
    write_csv(partial / DH, table, digits=12)
    write_csv(partial / DELTAS, dh_deltas(nominal, robot))
    return [str(output / name) for name in (DH, DELTAS)]
