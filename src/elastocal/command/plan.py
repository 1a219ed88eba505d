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
    format_command,
    parse_angle_rad,
    parse_length_m,
    parse_numbers,
    print_answer,
    refuse_taken_name,
)
from elastocal.counting import format_count
from elastocal.errors import InputError, find_text_fault

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import numpy as np

    from elastocal.application.planning.cell import Cell
    from elastocal.application.planning.plan import Plan
    from elastocal.application.planning.reaching import SetUp
    from elastocal.application.planning.survey import Survey
    from elastocal.campaigns.campaign import Target
    from elastocal.measuring.protocol import Sensor
    from elastocal.mechanics.chain import Chain
    from elastocal.mechanics.robot import Robot

ROBOT = "robot.yaml"
SHEET = "plan.pdf"
PICTURE = "plan.png"
# Configurations to which a robot is driven before it is led into contact.
PLANNED = "plan.csv"
# Number of allowed configurations over which changes of a plan are compared, and the
# share of its error below which a change is worth a sentence.
_WORKSPACE = 300
_NOTICEABLE_SHARE = 0.8
# Upper bound on the name of a target, as in campaign.yaml.
_LONGEST_NAME = 80
# Bound on the height of the floor, either way.
_FARTHEST_FLOOR_M = 1e3


def plan(
    robot: Annotated[Path, Argument(help="Robot file.")],
    *,
    folder: Annotated[
        Path, Option(help="New campaign folder, with a sheet to fill in.")
    ],
    poses: Annotated[int, Option(min=1, max=MOST_POSES, help="Poses to fit.")] = 20,
    held_out: Annotated[
        int,
        Option(
            min=3,
            max=MOST_POSES,
            help="Random poses that only validate the result.",
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
        str,
        Option(
            help="Kind of measurement, and its default noise: position by a laser tracker,"
            " pose by its 6DoF probe; or without a tracker board, point (a ball in a"
            " socket), plane, sphere, distance or line."
        ),
    ] = "position",
    place: Annotated[
        list[str] | None,
        Option(
            help="Without a tracker: where a feature roughly is, in m, base axes. A socket,"
            " plane or dial gauge NAME=x,y,z,nx,ny,nz (point and outward direction, 0,0,1"
            " if left out), a board too; a sphere NAME=x,y,z,radius; an anchor"
            " NAME=x,y,z."
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        Option(
            help="Bound within which the kind can measure, such as tilt_deg=40; an unknown"
            " one is answered with all."
        ),
    ] = None,
    camera: Annotated[
        Literal["on-robot", "beside-robot"],
        Option(
            help="Where the camera is that sees the board. The --place of a camera beside"
            " the robot has the direction of its view."
        ),
    ] = "on-robot",
    base_known: Annotated[
        bool, Option("--base-known", help="Measurements are in the base frame.")
    ] = False,
    target: Annotated[
        list[str] | None,
        Option(
            help="A target and its measuring point: POINT, POINT=x,y,z in m, or with a"
            " name of its own A:POINT=x,y,z. Without a tracker the offset only says where"
            " tip, camera or board roughly is."
        ),
    ] = None,
    tracker: Annotated[
        str | None, Option(help="Position of the tracker, x,y,z in m, base axes.")
    ] = None,
    box: Annotated[
        list[str] | None,
        Option(
            help="Box that the robot keeps out of: xmin,xmax,ymin,ymax,zmin,zmax in m, base axes."
        ),
    ] = None,
    floor: Annotated[
        float,
        Option(
            min=-_FARTHEST_FLOOR_M,
            max=_FARTHEST_FLOOR_M,
            help="Height in m, base axes, above which forearm and targets stay: the plane"
            " on which the base stands.",
        ),
    ] = 0.0,
    noise: Annotated[
        str | None,
        Option(
            help="Standard deviation of a coordinate, such as 0.05mm. Default: 0.03mm, a"
            " laser tracker at 7.5 m."
        ),
    ] = None,
    orientation_noise: Annotated[
        str | None,
        Option(
            help="Standard deviation of a rotation about an axis, such as 0.01deg."
            " Default: 0.005deg, a 6DoF probe."
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

    from elastocal.application.planning.improvements import compare_improvements
    from elastocal.application.planning.plan import choose_plan, find_allowed_candidates
    from elastocal.application.planning.survey import Survey
    from elastocal.application.pose_counts import warn_of_few_poses
    from elastocal.campaigns.campaign import Target
    from elastocal.campaigns.reading import read_robot
    from elastocal.command.plan_places import PlaceOptions, read_setup

    arm = read_robot(robot)
    console = Console(stderr=True)
    sensor = _choose_sensor(measured, noise, orientation_noise)
    targets = _read_targets(target or [arm.chain.end_effector.name], arm.chain)
    setup = read_setup(
        PlaceOptions(measured, place or (), limit or (), camera),
        {"--tracker": tracker, "--base-known": base_known, "--force": force},
        arm,
        targets,
    )
    if setup is not None:
        # The fit finds what the offset says roughly.
        targets = tuple(Target(item.name, item.point, None) for item in targets)
    survey = Survey(
        arm,
        targets,
        # Features anywhere do not say where the base is, and need no frame of their own.
        not base_known if setup is None else not setup.has_features,
        measured,
        sensor.position_m,
        sensor.orientation_rad,
        force,
        pull,
        setup,
    )
    cell = _read_cell(arm, box or (), tracker, floor, setup)
    _check_new_folder(folder)
    with console.status("planning"):
        candidates = find_allowed_candidates(survey, cell, number, seed)
        chosen = choose_plan(survey, candidates, poses, held_out, seed)
        improvements = compare_improvements(
            survey, chosen.fitted, candidates.select(slice(_WORKSPACE))
        )
    sentences = _describe_plan(survey, chosen, sensor)
    sentences += _describe_improvement(improvements)
    warnings = warn_of_few_poses(
        poses,
        poses * survey.numbers,
        chosen.parameters,
        chosen.effective_parameters,
        [measured],
    )
    worth = [*sentences, *(f"{warning}." for warning in warnings)]
    rows = _write_campaign(folder, robot, survey, cell, chosen, worth)
    print_answer(
        f"{format_count(poses, 'pose')} to fit and {held_out} held out, of"
        f" {len(candidates.joint_angles):,} that the cell allows:"
        f" {format_count(rows, 'measurement')}",
        [
            *sentences,
            *(f"! {warning}" for warning in warnings),
            f"sheet to print: {folder / SHEET}",
        ],
        _describe_next(setup, folder),
        console,
    )


def _describe_next(setup: SetUp | None, folder: Path) -> str:
    """Say what comes after the plan."""
    if setup is None:
        table = format_command("import", "csv", "tracker.csv", "--folder", folder)
        return f"measure, then {table}"
    sheet = folder / "measurements.csv"
    if setup.kind.is_converted:
        table = format_command(
            "import",
            "board",
            "boards.csv",
            *("--joints", sheet),
            *("--folder", folder.with_name(f"{folder.name}_measured")),
            *("--robot", folder / "robot.yaml"),
        )
        return f"take an image for each row, in their order, elastocal detect, then {table}"
    filled = f"fill in {sheet}"
    if setup.kind.is_contact:
        filled += " with the joint angles of each contact"
    return f"measure, {filled}, then {format_command('check', folder)}"


def _choose_sensor(
    measured: str, noise: str | None, orientation_noise: str | None
) -> Sensor:
    """Return the usual sensor with the noise that the user states.

    Its description is empty if all of its noise is stated.
    """
    from elastocal.command.plan_places import read_kind
    from elastocal.measuring.protocol import Sensor

    kind = read_kind(measured)
    usual = kind.sensor
    assert usual is not None, "kinds without a sensor are refused"
    position_m = usual.position_m
    orientation_rad = usual.orientation_rad
    if noise is not None:
        position_m = parse_length_m("--noise", noise)
    if orientation_noise is not None:
        if kind.numbers != 6:
            raise InputError(
                "--orientation-noise",
                "",
                f"{measured}, which has no orientation",
                "--measured pose or board beside it",
            )
        orientation_rad = parse_angle_rad("--orientation-noise", orientation_noise)
    all_stated = noise and (orientation_noise or kind.numbers != 6)
    description = "" if all_stated else usual.description
    return Sensor(description, position_m, orientation_rad)


def _check_new_folder(folder: Path) -> None:
    """Refuse a folder that exists, and one that `check` or `diagnose` would refuse after
    all has been measured."""
    from elastocal.campaigns.campaign_folder import check_campaign_name
    from elastocal.io.texts import describe_file_kind

    check_campaign_name(folder.resolve())
    refuse_taken_name(folder.resolve().name, folder)
    if os.path.lexists(folder):
        kind = describe_file_kind(os.lstat(folder).st_mode)
        raise InputError(folder, "", f"{kind} that is there", "a new one")


def _read_cell(
    arm: Robot,
    boxes: Iterable[str],
    tracker: str | None,
    floor_m: float,
    setup: SetUp | None,
) -> Cell:
    """Read boxes and the tracker's position; radii are shares of the arm's reach."""
    from elastocal.application.planning.cell import build_cell

    corners = []
    for text in boxes:
        box = parse_numbers("--box", text, 6).reshape(3, 2)
        if (box[:, 0] >= box[:, 1]).any():
            raise InputError(
                "--box",
                "",
                str(box.ravel().tolist()),
                "xmin,xmax,ymin,ymax,zmin,zmax with each min below its max",
            )
        corners.append(box)
    tracker_m = None if setup is None else setup.find_viewpoint()
    if tracker is not None:
        tracker_m = parse_numbers("--tracker", tracker, 3)
    return build_cell(arm, corners, tracker_m, floor_m)


def _read_targets(descriptions: list[str], chain: Chain) -> tuple[Target, ...]:
    """Read targets on measuring points, ``POINT``, ``NAME:POINT`` or either with
    ``=x,y,z``, the known offset; each has a name of its own."""
    from elastocal.campaigns.campaign import OFFSET_STD_M, Target

    targets: dict[str, Target] = {}
    for text in descriptions:
        name, point, offset = _split_target(text, [p.name for p in chain.points])
        if name in targets:
            raise InputError(
                "--target",
                "",
                f"{name!r} twice",
                f"a name for each target, such as A:{point} and B:{point}",
            )
        offset_m = None
        if offset is not None:
            numbers = parse_numbers("--target", offset, 3, FARTHEST_TARGET_M)
            offset_m = tuple(numbers.tolist())
        targets[name] = Target(name, point, offset_m, offset_std_m=OFFSET_STD_M)
    return tuple(targets.values())


def _split_target(text: str, points: list[str]) -> tuple[str, str, str | None]:
    """Split the description of a target into name, measuring point and offset, None if
    it has none. Names of points may contain ``=`` and ``:``."""
    label = text
    offset = None
    if text not in points and "=" in text:
        label, _, offset = text.partition("=")
    name = point = label
    if label not in points and ":" in label:
        name, _, point = map(str.strip, label.partition(":"))
    if point not in points:
        allowed = f"{', '.join(points)}, with a name before: A:{points[-1]}"
        raise InputError("--target", "", repr(point), allowed)
    if not 0 < len(name) <= _LONGEST_NAME:
        raise InputError(
            "--target",
            "",
            f"a name of {len(name)} characters",
            f"1 to {_LONGEST_NAME}, such as A:{point}",
        )
    if fault := find_text_fault(name):
        raise InputError("--target", "", *fault)
    return name, point, offset


def _describe_plan(survey: Survey, chosen: Plan, sensor: Sensor) -> list[str]:
    """State the accuracy that a plan gives, and the noise on which it is based."""
    import numpy as np

    from elastocal.application.statements import format_frame, format_millimetres

    low, median, high = 1e3 * np.quantile(chosen.random_m[:, -1], [0.05, 0.5, 0.95])
    frame = format_frame(survey.frame, offset_removed=survey.offset_removed)
    noise = f"{1e6 * survey.position_m:.3g} µm"
    if survey.rows == 6:
        noise += f", {1e6 * survey.orientation_rad:.3g} µrad"
    source = f"; {sensor.description}" if sensor.description else ""
    return [
        "Predicted position error of a robot that is corrected by the fit,"
        f" {frame}: {format_millimetres(chosen.accuracy_m[-1])} RMS over configurations"
        " that the cell allows; with as many random poses"
        f" {median:.3f} mm ({low:.3f} to {high:.3f}). {_describe_tool(survey)}",
        "It follows from the uncertainty of the fitted parameters and does not include"
        f" the noise of {'the tracker' if survey.setup is None else 'the measurement'}.",
        f"Assumed noise: {noise}{source}.",
    ]


def _describe_improvement(accuracy_m: dict[str, float]) -> list[str]:
    """Say what would help most, if it would help noticeably."""
    from elastocal.application.statements import format_millimetres

    best = min(accuracy_m, key=lambda change: accuracy_m[change])
    if accuracy_m[best] > _NOTICEABLE_SHARE * accuracy_m[""]:
        return []
    further = [
        f"{change} {format_millimetres(error_m)}"
        for change, error_m in accuracy_m.items()
        if change not in ("", best)
    ]
    others = f" ({'; '.join(further)})" if further else ""
    return [
        f"What would help most: {best}, {format_millimetres(accuracy_m[best])}"
        f" instead of {format_millimetres(accuracy_m[''])}{others}."
    ]


def _describe_tool(survey: Survey) -> str:
    """Say whether the error contains that of the tool's offset."""
    if survey.offset_removed:
        return (
            "It does not include the offset of the tool, because that of the"
            f" {'reflector' if survey.setup is None else 'target'} is fitted instead."
        )
    return (
        "It includes the offset of the tool, with the uncertainty of the reflectors'"
        " offsets."
    )


def _find_places(survey: Survey) -> Mapping[str, np.ndarray]:
    """Find what pictures show beside the cell: features, board or camera by name."""
    return survey.setup.places if survey.setup is not None else {}


def _write_campaign(
    folder: Path,
    robot_file: Path,
    survey: Survey,
    cell: Cell,
    chosen: Plan,
    sentences: list[str],
) -> int:
    """Write the campaign to fill in: descriptions, a sheet whose measurement columns are
    empty, and its pages with sentences and pictures of the cell and of the poses.

    Returns the number of rows.
    """
    import yaml

    from elastocal.application.planning.sheet import (
        build_campaign_document,
        build_sheet,
        clear_joint_angles,
    )
    from elastocal.campaigns.campaign import DOCUMENT
    from elastocal.campaigns.measurements import CSV
    from elastocal.figures.arms import draw_plan, draw_poses
    from elastocal.figures.style import save_all
    from elastocal.io.atomic_writes import write_text, write_together
    from elastocal.io.data_frames import write_csv
    from elastocal.io.documents import LARGEST_BYTES
    from elastocal.io.texts import read_text
    from elastocal.report.plan_pages import collect_plan_facts
    from elastocal.report.typesetting import compile_document

    table = build_sheet(survey, chosen)
    written = {CSV: table}
    if survey.setup is not None and survey.setup.kind.is_contact:
        written = {CSV: clear_joint_angles(table), PLANNED: table}
    facts = collect_plan_facts(survey, chosen, table, sentences)
    document = build_campaign_document(folder.name, ROBOT, survey, chosen)
    names = (ROBOT, *written, SHEET, PICTURE, DOCUMENT)
    with write_together(folder, names) as partial:
        write_text(partial / ROBOT, read_text(robot_file, LARGEST_BYTES))
        for name, rows in written.items():
            write_csv(partial / name, rows)
        figures = {
            "overview": draw_plan(survey.robot, cell, chosen, _find_places(survey))
        }
        for page, figure in enumerate(draw_poses(survey.robot, chosen)):
            figures[f"poses{page}"] = figure
        with tempfile.TemporaryDirectory() as scratch:
            pictures = save_all(figures, scratch).values()
            compile_document(partial / SHEET, "plan.typ", {"facts": facts}, pictures)
            shutil.copyfile(f"{scratch}/overview.png", partial / PICTURE)
        text = yaml.safe_dump(
            document, sort_keys=False, default_flow_style=None, width=120
        )
        write_text(partial / DOCUMENT, text)
    return len(table)
