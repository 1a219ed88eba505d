"""What a diagnosed campaign leads to beside corrected targets: `elastocal certificate` and `elastocal export`."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from elastocal.command.terminal import PhysicsOnly, diagnosed_campaign, length_m, print_answer, robots, workplace
from elastocal.counting import counted
from elastocal.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np

    from elastocal.exchange.urdf_writing import CorrectedUrdf
    from elastocal.mechanics.robot import Robot

DOCUMENT, PAGES = "certificate.json", "certificate.pdf"
ROBOT, URDF, SIDECAR, DH, DELTAS = _EXPORTED = "robot.yaml", "robot.urdf", "effects.json", "dh.csv", "dh_deltas.csv"
_ROUNDING_MM = 1e-5


def certificate(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    tolerance: Annotated[str, Option(help="Largest allowed RMS position error, such as 0.2mm.")],
    risk: Annotated[float, Option(min=0.001, max=0.5, help="Accepted risk of a wrong decision.")] = 0.05,
    physics_only: PhysicsOnly = False,
) -> None:
    """Certify a robot against a tolerance: pass, fail or undecided.

    The certificate has the risk of being wrong and the error budget, and says of which point it speaks. It stands beside the
    report. The exit code is 0 if the robot passes, and 1 if it fails or is undecided. A robot that nobody measured after
    correction is predicted to pass or fail.
    """
    from rich.console import Console

    from elastocal.data_checks.protocol import data_at_fault
    from elastocal.figures.certificate import budget_bars
    from elastocal.figures.style import save_all
    from elastocal.io.atomic_writes import check_places, write_together
    from elastocal.io.json_files import write_json
    from elastocal.loop.calibrated_files import certificate as certified
    from elastocal.report.certificate import certificate_facts, write_certificate

    console = Console(stderr=True)
    limit = length_m("--tolerance", tolerance)
    found = diagnosed_campaign(folder)
    found = found.by_physics() if physics_only else found
    place = workplace() / "reports" / "loop" / found.name
    check_places(place / PAGES, place / DOCUMENT, top=workplace() / "reports")
    if data_at_fault(found.verdict):
        raise InputError(folder, "", "data at fault", "a campaign whose data are in order; its report says what is wrong")
    with console.status("working"):
        document = certified(folder, robots(), found, limit, risk)
        facts = certificate_facts(document)
        with tempfile.TemporaryDirectory() as scratch, write_together(place, (PAGES, DOCUMENT)) as partial:
            names = [row[0] for row in facts["budget"]]
            budget = budget_bars(document["budget"], names, limit, document["tracker_rms_m"])
            write_certificate(partial / PAGES, facts, [*save_all({"budget": budget}, scratch).values()])
            write_json(partial / DOCUMENT, document)
    passed, (answer, *details) = facts["decision"] == "pass", _lines(document)
    print_answer(passed, answer, [*details, str(place / PAGES), str(place / DOCUMENT)], facts["now"], console)
    raise typer.Exit(0 if passed else 1)


def _lines(document: Mapping[str, Any]) -> list[str]:
    """The answer in three lines: the decision by its criterion; over which poses and of which point; why, or what it lacks."""
    from elastocal.application.accuracy import Accuracy, millimetres
    from elastocal.application.frames import FRAMES

    found, accuracy = document["conformity"], Accuracy(**document["accuracy"])
    answer = f"{found['decision']}: no error is predicted of a robot of which nothing was fitted"
    if accuracy.fitted or accuracy.form_m:
        answer = (
            f"{found['decision']}, as predicted: the RMS position error of the corrected robot is"
            f" {millimetres(accuracy.rms_m)}, {1 - found['accepted_risk']:.0%} sure to be below"
            f" {millimetres(found['limit_m'])}, the tolerance {millimetres(found['tolerance_m'])}"
        )
    poses = f"In {FRAMES[accuracy.frame].removeprefix('in ')}, over {accuracy.region} ({accuracy.poses})"
    where = f"{poses}, {millimetres(accuracy.worst_m)} at the worst of them. {document['point']}"
    rest = [f"Too little for a pass: {'; '.join(found['shortfalls'])}."] if found["shortfalls"] else []
    rest.append("Nobody has measured the corrected robot: command corrected targets, measure them, and compare.")
    return [answer, where, " ".join(rest), *(f"! {each['sentence']}" for each in document["misplaced"])]


def export(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    output: Annotated[Path, Option(help="Folder for the files.")],
    urdf: Annotated[
        Path | None, Option(help="The URDF that the robot was imported from. Its joint origins are changed, nothing else.")
    ] = None,
) -> None:
    """Write the calibrated robot: robot file, URDF, DH, effects.

    URDF and DH parameters hold the geometry; effects.json holds springs and effects as well. None holds the regression on the
    remainder: what is lost with it is said, and the accuracy stated is without.
    """
    from datetime import date

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
    check_places(*(output / name for name in _EXPORTED))
    if urdf is not None and (output / URDF).resolve() == urdf.resolve():
        raise InputError(urdf, "", "the file that would be replaced", "a URDF outside of --output")
    whole = diagnosed_campaign(folder)
    # No file has the regression: what stands in them is of a robot without.
    calibrated, states = whole.by_physics().calibrated, whole.case.observations.states
    nominal, robot = calibrated.robot, fold_effects(calibrated).robot
    drop_in = None if urdf is None else write_calibrated_origins(urdf, nominal, robot)
    stated = f"Calibrated by elastocal from the campaign {whole.name}."
    text = yaml.safe_dump(document_of(robot), sort_keys=False, default_flow_style=None, width=128)
    accuracy = campaign_accuracy(calibrated)
    document = sidecar(calibrated, whole.name, date.today().isoformat(), accuracy)
    lines = [accuracy_sentence(accuracy), *(str(output / name) for name in (ROBOT, *([URDF] if urdf else []), SIDECAR))]
    with write_together(output, _EXPORTED) as partial:
        write_text(partial / ROBOT, f"# {stated}\n{text}")
        if drop_in is not None:
            (partial / URDF).write_bytes(drop_in.content)
            lines += _drop_in(drop_in, partial / URDF, nominal, robot, states.joint_angles)
        write_json(partial / SIDECAR, document)
        lines += _denavit_hartenberg(nominal, robot, partial, output)
    at = nominal.reported_angles(states.joint_angles)
    under = OperatingConditions(states.wrench, None, states.time_s, states.temperature_c)
    if document["effects"]:
        names = ", ".join(entry["key"] for entry in document["effects"])
        lines.insert(0, f"! only {SIDECAR} holds {names}: {_sizes(find_left_out_m(calibrated, at, under))}")
    if whole.calibrated.remainder is not None:
        words, lost = whole.verdict["remainder"]["words"], np.linalg.norm(regressed(whole.calibrated, at, under), axis=1)
        lines.insert(0, f"! no file holds the {words} on the remainder, which elastocal correct adds: {_sizes(lost)}")
    print_answer(True, f"{whole.name}: calibrated robot in {output}", lines, "", console)


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
    changed = counted(drop_in.changed, "joint origin")
    lines = [f"{URDF}: {changed} changed, nothing else; put it where the old one is, beside its meshes"]
    if off > _ROUNDING_MM:
        what = "ratios of joints, and errors behind a last joint that has no fixed one after it"
        lines.append(f"{URDF} cannot hold {what}: up to {off:.3f} mm at the measured poses")
    return lines


def _denavit_hartenberg(nominal: Robot, robot: Robot, partial: Path, output: Path) -> list[str]:
    """Write the DH parameters, and by how much they differ from the nominal ones; lines to print."""
    from elastocal.exchange.dh_writing import dh_deltas, dh_table
    from elastocal.io.data_frames import write_csv

    try:
        table, deltas = dh_table(robot, nominal), dh_deltas(nominal, robot)
    except InputError as error:
        return [f"no DH parameters: {error}"]
    write_csv(partial / DH, table, digits=12)
    write_csv(partial / DELTAS, deltas)
    return [str(output / DH), str(output / DELTAS)]
