"""`elastocal plan`: where to measure."""

from __future__ import annotations

import inspect
import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from elastocal.command.printed import print_answer
from elastocal.command.quantities import FARTHEST_TARGET_M, LARGEST_SEED, MOST_POSES, MOST_ROWS, angle_rad, length_m, numbers
from elastocal.counting import counted
from elastocal.errors import InputError, text_fault

if TYPE_CHECKING:
    import pandas as pd

    from elastocal.application.planning.cell import Cell
    from elastocal.application.planning.plan import Candidates, Loads, Plan, Sensor, Survey
    from elastocal.campaigns.campaign import Target
    from elastocal.mechanics.chain import Chain

ROBOT = "robot.yaml"
# Of a target, as in campaign.yaml.
_LONGEST_NAME = 80


@dataclass(frozen=True)
class _Options:
    """What the command line states."""

    robot: Annotated[Path, Argument(help="Robot file.")]
    output: Annotated[Path | None, Option(help="CSV of the plan; the sheet and a picture go beside it.")] = None
    folder: Annotated[Path | None, Option(help="New campaign folder, with a sheet to fill in.")] = None
    poses: Annotated[int, Option(min=1, max=MOST_POSES, help="Poses to fit.")] = 20
    held_out: Annotated[int, Option(min=3, max=MOST_POSES, help="Random poses that judge the result and fit nothing.")] = 9
    accuracy: Annotated[str | None, Option(help="Wanted accuracy such as 0.1mm; takes the fewest poses that reach it.")] = None
    number: Annotated[int, Option("--candidates", min=10, max=MOST_ROWS, help="Random configurations to choose from.")] = 10_000
    criterion: Annotated[
        str, Option(help="D, A or I: minimize the determinant or the trace of the covariance, or the error over the workspace.")
    ] = "D"
    force: Annotated[float, Option(min=0.0, max=1e6, help="Force of the load in N; 0 for none.")] = 0.0
    pull: Annotated[bool, Option("--pull", help="The load pulls in any direction. Default: it hangs.")] = False
    sensor: Annotated[
        str | None,
        Option(help="The instrument, for the assumed noise: tracker (30 µm), t-mac (30 µm, 0.005°), camera (120 µm, 0.05°)."),
    ] = None
    measured: Annotated[str | None, Option(help="position or pose. Default: what the sensor usually measures.")] = None
    base_known: Annotated[bool, Option("--base-known", help="Measurements are in the base frame.")] = False
    target: Annotated[
        list[str] | None,
        Option(help="A target and its measuring point: POINT, POINT=x,y,z in m, or with a name of its own A:POINT=x,y,z."),
    ] = None
    tracker: Annotated[str | None, Option(help="Position of the tracker, x,y,z in m, base axes.")] = None
    box: Annotated[list[str] | None, Option(help="Box to keep out of: xmin,xmax,ymin,ymax,zmin,zmax in m, base axes.")] = None
    floor: Annotated[
        str, Option(help="Height in m, base axes, that forearm and targets stay above: the plane that the base stands on.")
    ] = "0"
    no_floor: Annotated[bool, Option("--no-floor", help="Nothing is below the robot.")] = False
    column: Annotated[
        float | None,
        Option(
            min=0.0,
            max=FARTHEST_TARGET_M,
            help="Radius in m of the robot's own column, up to its shoulder, that forearm and hand keep out of; 0 for none. "
            "Default: a tenth of the reach.",
        ),
    ] = None
    noise: Annotated[str | None, Option(help="Standard deviation of a coordinate, such as 0.03mm. Default: the sensor's.")] = (
        None
    )
    orientation_noise: Annotated[
        str | None, Option(help="Standard deviation of a rotation about an axis, such as 0.01deg. Default: the sensor's.")
    ] = None
    seed: Annotated[int, Option(min=0, max=LARGEST_SEED, help="Seed of the random numbers.")] = 1


@dataclass(frozen=True)
class _Task:
    """What is to be planned, in SI units: what is measured, in which cell, under which loads, with which instrument."""

    survey: Survey
    cell: Cell
    loads: Loads
    sensor: Sensor
    accuracy_m: float | None


def plan(**words: Any) -> None:
    """Choose where to measure; write a sheet to print.

    The chosen poses and loads determine the robot's parameters best, among those that the arm, the cell and the tracker allow.
    plan.pdf is the sheet to take to the cell.
    """
    from rich.console import Console

    from elastocal.application.planning.plan import sheet
    from elastocal.campaigns.measurements import CSV

    options, console = _Options(**words), Console(stderr=True)
    task = _read_task(options)
    names = _check_places(options)
    with console.status("planning"):
        some, found = _choose(task, options)
    table, worth = sheet(task.survey, found), _describe(task, options, found)
    _write_files(task, options, names, found, table, worth)
    folder = options.folder
    output = options.output or Path(str(folder), names[0])
    answer = (
        f"{counted(len(found.fitted.joint_angles), 'pose')} to fit and {options.held_out} held out, of "
        f"{len(some.joint_angles):,} that the cell allows: {counted(len(table), 'measurement')}"
    )
    sheets = [f"sheet to print: {output.with_suffix('.pdf')}", f"table: {output}"]
    following = f", fill in {folder / CSV}, then elastocal check {folder}" if folder else " the poses of the sheet"
    print_answer(True, answer, [*worth, *sheets], f"measure{following}", console)


# Where typer looks for the options of a command.
plan.__signature__ = inspect.signature(_Options, eval_str=True)  # type: ignore[attr-defined]


def _read_task(options: _Options) -> _Task:
    """The task that the options state; the first that is wrong is refused by its name."""
    from elastocal.application.inverse_kinematics import reach_m
    from elastocal.application.planning.cell import COLUMN_SHARE, RADIUS_SHARE, Cell
    from elastocal.application.planning.designs import CRITERIA
    from elastocal.application.planning.plan import Loads, Survey
    from elastocal.campaigns.reading import read_robot

    arm = read_robot(options.robot)
    if options.criterion not in CRITERIA:
        raise InputError("--criterion", "", repr(options.criterion), ", ".join(CRITERIA))
    sensor, measured = _find_sensor(options.sensor, options.measured)
    loads = Loads(options.force, options.pull)
    targets = _read_targets(options.target or [arm.chain.end_effector.name], arm.chain)
    noise = _read_noise(options.noise, options.orientation_noise, sensor, measured)
    survey = Survey(arm, targets, not options.base_known, measured, loads.shares, *noise)
    boxes = tuple(numbers("--box", text, 6).reshape(3, 2) for text in options.box or ())
    if wrong := [corner.ravel().tolist() for corner in boxes if (corner[:, 0] >= corner[:, 1]).any()]:
        raise InputError("--box", "", str(wrong[0]), "xmin,xmax,ymin,ymax,zmin,zmax with each min below its max")
    tracker = None if options.tracker is None else numbers("--tracker", options.tracker, 3)
    accuracy = None if options.accuracy is None else length_m("--accuracy", options.accuracy)
    reach = reach_m(arm)
    column = COLUMN_SHARE * reach if options.column is None else options.column
    floor = None if options.no_floor else float(numbers("--floor", options.floor, 1)[0])
    cell = Cell(boxes, tracker, RADIUS_SHARE * reach, floor, column)
    return _Task(survey, cell, loads, sensor, accuracy)


def _check_places(options: _Options) -> list[str]:
    """Names of the table, the sheet and the picture; places where they cannot go are refused."""
    from elastocal.io.atomic_writes import check_places
    from elastocal.io.texts import kind_of

    output, folder = options.output, options.folder
    if output is None and folder is None:
        raise InputError("plan", "", "neither --output nor --folder", "where the plan shall go")
    if folder is not None and os.path.lexists(folder):
        raise InputError(folder, "", f"{kind_of(os.lstat(folder).st_mode)} that is there", "a new one")
    names = [(output or Path("plan.csv")).with_suffix(suffix).name for suffix in (".csv", ".pdf", ".png")]
    if output is not None:
        if output.name != names[0]:
            raise InputError("--output", "", repr(output.name), "a name that ends in .csv; pictures go beside it")
        check_places(*(output.with_name(name) for name in names))
    return names


def _choose(task: _Task, options: _Options) -> tuple[Candidates, Plan]:
    """Configurations that the cell allows, and the plan among them: of the fewest poses where an accuracy is wanted."""
    from elastocal.application.planning.plan import choose_plan, fewest_poses, find_allowed_candidates

    def choose(poses: int) -> Plan:
        return choose_plan(task.survey, some, poses, options.held_out, options.criterion, options.seed)

    some = find_allowed_candidates(task.survey, task.cell, task.loads, options.number, options.seed)
    found = choose(options.poses)
    if task.accuracy_m is None:
        return some, found
    enough = int((found.accuracy_m > task.accuracy_m).sum()) + 1
    if enough > len(found.accuracy_m):
        best = f"{1e3 * found.accuracy_m[-1]:.3f} mm with {counted(options.poses, 'pose')}"
        raise InputError("--accuracy", "", best, "more poses, or an accuracy that they reach")
    return some, choose(max(enough, fewest_poses(task.survey)))


def _describe(task: _Task, options: _Options, found: Plan) -> list[str]:
    """What a plan is worth, in sentences."""
    import numpy as np

    from elastocal.application.accuracy import millimetres
    from elastocal.application.frames import BASE, FRAMES, ROBOT

    survey, pose = task.survey, task.survey.measured == "pose"
    random = 1e3 * np.quantile(found.random_m[:, -1], [0.05, 0.5, 0.95])
    stated = options.noise and (options.orientation_noise or not pose)
    return [
        f"Predicted position error of a robot that is corrected by the fit, {FRAMES[ROBOT if survey.unknown_base else BASE]}: "
        f"{millimetres(found.accuracy_m[-1])} RMS over configurations that the cell allows; with as many random poses "
        f"{random[1]:.3f} mm ({random[0]:.3f} to {random[2]:.3f}).",
        "It is a standard error by the uncertainty of the parameters alone, without the tracker's noise.",
        f"Assumed noise: {1e6 * survey.position_m:.3g} µm"
        + (f", {1e6 * survey.orientation_rad:.3g} µrad" if pose else "")
        + ("." if stated else f"; {task.sensor.words}."),
        f"{options.criterion}-efficiency: at least {100 * found.efficiency:.0f} % of the best design with as many poses.",
    ]


def _write_files(task: _Task, options: _Options, names: list[str], found: Plan, table: pd.DataFrame, worth: list[str]) -> None:
    """The campaign's folder, if one is wanted, and the table, the sheet and the picture there or beside the output."""
    from elastocal.campaigns.campaign import DOCUMENT
    from elastocal.campaigns.measurements import CSV
    from elastocal.figures.arms import plan_picture, pose_pictures
    from elastocal.figures.style import save_all
    from elastocal.io.atomic_writes import write_together
    from elastocal.io.data_frames import write_csv
    from elastocal.report.plan_pages import plan_facts, write_plan_sheet

    def write_plan(place: Path) -> None:
        write_csv(place / names[0], table.assign(expected_accuracy_m=float(found.accuracy_m[-1])))
        with tempfile.TemporaryDirectory() as scratch:
            arm = task.survey.robot
            pages = {f"poses{page}": figure for page, figure in enumerate(pose_pictures(arm, found))}
            pictures = save_all({"overview": plan_picture(arm, task.cell, found), **pages}, scratch)
            write_plan_sheet(place / names[1], plan_facts(task.survey, found, table, worth), pictures)
            shutil.copyfile(f"{scratch}/overview.png", place / names[2])

    output, folder = options.output, options.folder
    if folder is not None:
        with write_together(folder, (ROBOT, CSV, *names, DOCUMENT)) as partial:
            _write_campaign(partial, folder.name, options.robot, task.survey, found, table)
            if output is None:
                write_plan(partial)
    if output is not None:
        with write_together(output.parent, names) as partial:
            write_plan(partial)


def _read_targets(described: list[str], chain: Chain) -> tuple[Target, ...]:
    """Reflectors on measuring points, at a known offset or an unknown one, each by a name of its own."""
    from elastocal.campaigns.campaign import Target

    known = [place.name for place in chain.points]
    found: dict[str, Target] = {}
    for text in described:
        place, equals, offset = (text, "", "") if text in known else text.partition("=")
        name, colon, point = (place, "", place) if place in known else map(str.strip, place.partition(":"))
        if point not in known:
            allowed = f"{', '.join(known)}, with a name before: A:{known[-1]}"
            raise InputError("--target", "", repr(point if colon else place), allowed)
        if not name or len(name) > _LONGEST_NAME:
            raise InputError("--target", "", f"a name of {len(name)} characters", f"1 to {_LONGEST_NAME}, such as A:{point}")
        if fault := text_fault(name):
            raise InputError("--target", "", *fault)
        if name in found:
            raise InputError("--target", "", f"{name!r} twice", f"a name for each target, such as A:{point} and B:{point}")
        at = tuple(numbers("--target", offset, 3, FARTHEST_TARGET_M).tolist()) if equals else None
        found[name] = Target(name, point, at)
    return tuple(found.values())


def _find_sensor(name: str | None, measured: str | None) -> tuple[Sensor, str]:
    """What reads the targets, and whether it reads positions or poses."""
    from elastocal.application.planning.plan import SENSORS

    if measured not in (None, "position", "pose"):
        raise InputError("--measured", "", repr(measured), "position, pose")
    name = (name or ("t-mac" if measured == "pose" else "tracker")).lower()
    if name not in SENSORS:
        raise InputError("--sensor", "", repr(name), ", ".join(SENSORS))
    usual = SENSORS[name].measured
    if measured not in (None, *usual):
        other = ", ".join(each for each, sensor in SENSORS.items() if measured in sensor.measured)
        raise InputError("--measured", "", f"{measured} by a {name}", f"{usual[0]}, or --sensor {other}")
    return SENSORS[name], measured or usual[0]


def _read_noise(position: str | None, orientation: str | None, sensor: Sensor, measured: str) -> tuple[float, float]:
    """Standard deviations as stated, or the sensor's."""
    if orientation is not None and measured != "pose":
        allowed = "--measured pose beside it"
        raise InputError("--orientation-noise", "", f"{orientation!r} where positions are measured", allowed)
    position_m = sensor.position_m if position is None else length_m("--noise", position)
    # Of positions no orientation is read: its noise is not used.
    orientation_rad = sensor.orientation_rad if orientation is None else angle_rad("--orientation-noise", orientation)
    return position_m, orientation_rad or position_m


def _write_campaign(place: Path, name: str, robot: Path, survey: Survey, found: Plan, table: pd.DataFrame) -> None:
    """A campaign to fill in: campaign.yaml, the robot file, and a sheet whose measurement columns are empty."""
    import yaml

    from elastocal.application.planning.plan import campaign_document
    from elastocal.campaigns.campaign import DOCUMENT
    from elastocal.campaigns.measurements import CSV
    from elastocal.io.atomic_writes import write_text
    from elastocal.io.data_frames import write_csv
    from elastocal.io.documents import LARGEST_BYTES
    from elastocal.io.texts import read_text

    write_text(place / ROBOT, read_text(robot, LARGEST_BYTES))
    write_csv(place / CSV, table)
    document = campaign_document(name, ROBOT, survey, found)
    write_text(place / DOCUMENT, yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120))
