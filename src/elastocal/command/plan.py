"""`elastocal plan`: where to measure."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from elastocal.command.terminal import (
    FARTHEST_TARGET_M,
    LARGEST_SEED,
    MOST_POSES,
    MOST_ROWS,
    angle_rad,
    length_m,
    numbers,
    print_answer,
)
from elastocal.counting import format_count
from elastocal.errors import InputError, find_text_fault

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.application.planning.cell import Cell
    from elastocal.application.planning.plan import Plan, Survey
    from elastocal.campaigns.campaign import Target
    from elastocal.mechanics.chain import Chain
    from elastocal.mechanics.robot import Robot

ROBOT = "robot.yaml"
SHEET = "plan.pdf"
PICTURE = "plan.png"
# Of a target, as in campaign.yaml.
_LONGEST_NAME = 80
_LOWEST_FLOOR_M = 1e3


def plan(
    robot: Annotated[Path, Argument(help="Robot file.")],
    folder: Annotated[
        Path, Option(help="New campaign folder, with a sheet to fill in.")
    ],
    poses: Annotated[int, Option(min=1, max=MOST_POSES, help="Poses to fit.")] = 20,
    held_out: Annotated[
        int,
        Option(
            min=3,
            max=MOST_POSES,
            help="Random poses that judge the result and fit nothing.",
        ),
    ] = 9,
    number: Annotated[
        int,
        Option(
            "--candidates",
            min=10,
            max=MOST_ROWS,
            help="Random configurations to choose from.",
        ),
    ] = 10_000,
    force: Annotated[
        float, Option(min=0.0, max=1e6, help="Force of the load in N; 0 for none.")
    ] = 0.0,
    pull: Annotated[
        bool,
        Option("--pull", help="The load pulls in any direction. Default: it hangs."),
    ] = False,
    measured: Annotated[
        Literal["position", "pose"],
        Option(
            help="What is read of a target, and by default with which noise: of a laser tracker, or of its 6DoF probe."
        ),
    ] = "position",
    base_known: Annotated[
        bool, Option("--base-known", help="Measurements are in the base frame.")
    ] = False,
    target: Annotated[
        list[str] | None,
        Option(
            help="A target and its measuring point: POINT, POINT=x,y,z in m, or with a name of its own A:POINT=x,y,z."
        ),
    ] = None,
    tracker: Annotated[
        str | None, Option(help="Position of the tracker, x,y,z in m, base axes.")
    ] = None,
    box: Annotated[
        list[str] | None,
        Option(
            help="Box to keep out of: xmin,xmax,ymin,ymax,zmin,zmax in m, base axes."
        ),
    ] = None,
    floor: Annotated[
        float,
        Option(
            min=-_LOWEST_FLOOR_M,
            max=_LOWEST_FLOOR_M,
            help="Height in m, base axes, that forearm and targets stay above: the plane that the base stands on.",
        ),
    ] = 0.0,
    noise: Annotated[
        str | None,
        Option(
            help="Standard deviation of a coordinate, such as 0.03mm. Default: usual."
        ),
    ] = None,
    orientation_noise: Annotated[
        str | None,
        Option(
            help="Standard deviation of a rotation about an axis, such as 0.01deg. Default: usual."
        ),
    ] = None,
    seed: Annotated[
        int, Option(min=0, max=LARGEST_SEED, help="Seed of the random numbers.")
    ] = 1,
) -> None:
    """Choose where to measure; write a sheet to print.

    The chosen poses and loads determine the robot's parameters best, among those that
    the arm, the cell and the tracker allow. The folder is a campaign whose
    measurements.csv is to be filled in; plan.pdf is the sheet to take to the cell.
    """
    from rich.console import Console

    from elastocal.application.planning.plan import (
        SENSORS,
        Survey,
        choose_plan,
        find_allowed_candidates,
    )
    from elastocal.campaigns.measurements import CSV
    from elastocal.campaigns.reading import read_robot
    from elastocal.io.texts import describe_file_kind

    arm, console, (_, position_m, orientation_rad) = (
        read_robot(robot),
        Console(stderr=True),
        SENSORS[measured],
    )
    if noise is not None:
        position_m = length_m("--noise", noise)
    if orientation_noise is not None:
        if measured != "pose":
            raise InputError(
                "--orientation-noise",
                "",
                "positions, which have no orientation",
                "--measured pose beside it",
            )
        orientation_rad = angle_rad("--orientation-noise", orientation_noise)
    targets = _read_targets(target or [arm.chain.end_effector.name], arm.chain)
    survey = Survey(
        arm, targets, not base_known, measured, position_m, orientation_rad, force, pull
    )
    cell = _cell(arm, box or (), tracker, floor)
    if os.path.lexists(folder):
        raise InputError(
            folder,
            "",
            f"{describe_file_kind(os.lstat(folder).st_mode)} that is there",
            "a new one",
        )
    with console.status("planning"):
        some = find_allowed_candidates(survey, cell, number, seed)
        found = choose_plan(survey, some, poses, held_out, seed)
    worth = _worth(
        survey, found, bool(noise and (orientation_noise or measured == "position"))
    )
    rows = _write(folder, robot, survey, cell, found, worth)
    answer = (
        f"{format_count(poses, 'pose')} to fit and {held_out} held out, of {len(some.joint_angles):,} that the cell allows: "
        f"{format_count(rows, 'measurement')}"
    )
    following = f"measure, fill in {folder / CSV}, then elastocal check {folder}"
    print_answer(
        True, answer, [*worth, f"sheet to print: {folder / SHEET}"], following, console
    )


def _cell(arm: Robot, boxed: Iterable[str], tracker: str | None, floor: float) -> Cell:
    from elastocal.application.inverse_kinematics import reach_m
    from elastocal.application.planning.cell import COLUMN_SHARE, RADIUS_SHARE, Cell

    boxes = tuple(numbers("--box", text, 6).reshape(3, 2) for text in boxed)
    if wrong := [
        corner.ravel().tolist()
        for corner in boxes
        if (corner[:, 0] >= corner[:, 1]).any()
    ]:
        raise InputError(
            "--box",
            "",
            str(wrong[0]),
            "xmin,xmax,ymin,ymax,zmin,zmax with each min below its max",
        )
    place = None if tracker is None else numbers("--tracker", tracker, 3)
    reach = reach_m(arm)
    return Cell(boxes, place, RADIUS_SHARE * reach, floor, COLUMN_SHARE * reach)


def _read_targets(described: list[str], chain: Chain) -> tuple[Target, ...]:
    """Reflectors on measuring points, at a known offset or an unknown one, each by a
    name of its own."""
    from elastocal.campaigns.campaign import Target

    known = [place.name for place in chain.points]
    found: dict[str, Target] = {}
    for text in described:
        place, equals, offset = (text, "", "") if text in known else text.partition("=")
        name, colon, point = (
            (place, "", place)
            if place in known
            else map(str.strip, place.partition(":"))
        )
        if point not in known:
            allowed = f"{', '.join(known)}, with a name before: A:{known[-1]}"
            raise InputError("--target", "", repr(point if colon else place), allowed)
        if not 0 < len(name) <= _LONGEST_NAME:
            raise InputError(
                "--target",
                "",
                f"a name of {len(name)} characters",
                f"1 to {_LONGEST_NAME}, such as A:{point}",
            )
        if fault := find_text_fault(name):
            raise InputError("--target", "", *fault)
        if name in found:
            raise InputError(
                "--target",
                "",
                f"{name!r} twice",
                f"a name for each target, such as A:{point} and B:{point}",
            )
        at = (
            tuple(numbers("--target", offset, 3, FARTHEST_TARGET_M).tolist())
            if equals
            else None
        )
        found[name] = Target(name, point, at)
    return tuple(found.values())


def _worth(survey: Survey, found: Plan, stated: bool) -> list[str]:
    """What a plan is worth, in sentences; `stated`: whether the noise is."""
    import numpy as np

    from elastocal.application.accuracy import millimetres
    from elastocal.application.frames import BASE, FRAMES, ROBOT
    from elastocal.application.planning.plan import SENSORS

    random = 1e3 * np.quantile(found.random_m[:, -1], [0.05, 0.5, 0.95])
    return [
        f"Predicted position error of a robot that is corrected by the fit, {FRAMES[ROBOT if survey.unknown_base else BASE]}: "
        f"{millimetres(found.accuracy_m[-1])} RMS over configurations that the cell allows; with as many random poses "
        f"{random[1]:.3f} mm ({random[0]:.3f} to {random[2]:.3f}).",
        "It is a standard error by the uncertainty of the parameters alone, without the tracker's noise.",
        f"Assumed noise: {1e6 * survey.position_m:.3g} µm"
        + (
            f", {1e6 * survey.orientation_rad:.3g} µrad"
            if survey.measured == "pose"
            else ""
        )
        + ("." if stated else f"; {SENSORS[survey.measured][0]}."),
    ]


def _write(
    folder: Path, robot: Path, survey: Survey, cell: Cell, found: Plan, worth: list[str]
) -> int:
    """Write the campaign to fill in: descriptions, a sheet whose measurement columns
    are empty, and its pages; its rows."""
    import yaml

    from elastocal.application.planning.plan import build_sheet, campaign_document
    from elastocal.campaigns.campaign import DOCUMENT
    from elastocal.campaigns.measurements import CSV
    from elastocal.figures.arms import draw_plan, draw_poses
    from elastocal.figures.style import save_all
    from elastocal.io.atomic_writes import write_text, write_together
    from elastocal.io.data_frames import write_csv
    from elastocal.io.documents import LARGEST_BYTES
    from elastocal.io.texts import read_text
    from elastocal.report.plan_pages import plan_facts
    from elastocal.report.typesetting import compile_document

    table = build_sheet(survey, found)
    names = (ROBOT, CSV, SHEET, PICTURE, DOCUMENT)
    with (
        write_together(folder, names) as partial,
        tempfile.TemporaryDirectory() as scratch,
    ):
        write_text(partial / ROBOT, read_text(robot, LARGEST_BYTES))
        write_csv(partial / CSV, table)
        pages = {
            f"poses{page}": figure
            for page, figure in enumerate(draw_poses(survey.robot, found))
        }
        pictures = save_all(
            {"overview": draw_plan(survey.robot, cell, found), **pages}, scratch
        )
        facts = plan_facts(survey, found, table, worth)
        compile_document(
            partial / SHEET, "plan.typ", {"facts": facts}, pictures.values()
        )
        shutil.copyfile(f"{scratch}/overview.png", partial / PICTURE)
        document = campaign_document(folder.name, ROBOT, survey, found)
        write_text(
            partial / DOCUMENT,
            yaml.safe_dump(
                document, sort_keys=False, default_flow_style=None, width=120
            ),
        )
    return len(table)
