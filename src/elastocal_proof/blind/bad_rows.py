"""What a few bad rows do to a verdict: campaigns of the plant, each diagnosed clean, damaged, and with as many good rows away.

The last is the floor: how often a verdict changes by chance alone, because a row more or less is fitted. Robots are those that
the method was developed on. Of each case everything is drawn: the design, what is wrong with the robot, and the slips.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.writing import write_campaign
from elastocal.errors import InputError
from elastocal.loop.whole import diagnosed
from elastocal_proof.blind.folders import campaign_document, write_robot
from elastocal_proof.plant.arm import arm_from_file
from elastocal_proof.plant.bad_rows import JOINT_ANGLE, LOAD, possible_kinds, with_bad_rows
from elastocal_proof.plant.campaigns import COVARIATES, FLANGE, Design, measured_table, schedule_of
from elastocal_proof.plant.defects import KINDS, Defect, drawn_defect, with_defects
from elastocal_proof.plant.physical_robot import specimen
from elastocal_proof.plant.random_numbers import stream
from elastocal_proof.plant.sizing import Yardstick, size_for
from elastocal_proof.plant.weights import declared_masses

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from elastocal_proof.plant.arm import Arm, LinkMass
    from elastocal_proof.plant.bad_rows import BadReading
    from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule

    Table = dict[str, np.ndarray]

CLEAN, DAMAGED, FEWER = "clean", "damaged", "fewer"
NOTHING, OFFSETS, LARGE, TWO_LARGE, FAINT = "nothing", "joint offsets", "one, large", "two, large", "one, at 200"
# How often each truth is drawn.
MIXTURE = {NOTHING: 0.25, OFFSETS: 0.25, LARGE: 0.2, TWO_LARGE: 0.1, FAINT: 0.2}
# From this size on a bad row shall be named, in standard deviations.
NAMED_FROM = 10.0
# Rows that a user's campaign has.
_FEWEST, _MOST = 40, 200
# Of a mastering that went wrong, rad; of other large effects, times the plausible size.
_OFFSET_RAD, _TIMES_PLAUSIBLE = 2e-3, 5.0
_NON_CENTRALITY = 200.0
_WEIGHT = "link_weight"
_WITHOUT_LOAD = ("joint_offset", "link_geometry", _WEIGHT, "transmission_harmonic", "transmission_ratio")
_WITH_LOAD = ("joint_tilt", "link_elasticity", "stiffening")
_DRAWS = 8


@dataclass(frozen=True)
class MadeCampaign:
    """A campaign before anything slipped.

    `robot`: with its defects. `kind`: of `MIXTURE`.
    """

    name: str
    robot: PhysicalRobot
    design: Design
    schedule: Schedule
    declared: tuple[LinkMass, ...]
    kind: str
    defects: tuple[Defect, ...]


def draw_seeds(robot_file: str | Path, seed: int, each: int) -> list[int]:
    """Seeds of all cases on one robot; more cases change none that is there."""
    name = Path(robot_file).stem
    return [int(stream(seed, f"bad rows {name} {number}").integers(2**31)) for number in range(each)]


def draw_campaign(robot_file: str | Path, seed: int) -> MadeCampaign:
    """A robot, what is wrong with it, and how it is measured."""
    arm = arm_from_file(robot_file)
    draws = stream(seed, "campaign with bad rows")
    design = _drawn_design(arm, draws)
    schedule = schedule_of(arm, design, seed)
    kind = str(draws.choice(list(MIXTURE), p=list(MIXTURE.values())))
    known = _WITHOUT_LOAD + (_WITH_LOAD if len(design.ladder) > 1 else ())
    if kind == FAINT:
        found = (_faint(arm, str(draws.choice(known)), design, schedule, seed + number) for number in range(_DRAWS))
        defects = next((defects for defects in found if defects), ())
    else:
        defects = _large(arm, kind, draws, seed)
    hidden = any(defect.effect == _WEIGHT for defect in defects)
    robot = with_defects(specimen(arm, seed, weighs=not hidden), defects)
    return MadeCampaign(
        f"bad_rows_{seed}",
        robot,
        design,
        schedule,
        () if hidden else declared_masses(arm),
        kind if defects else NOTHING,
        defects,
    )


def compare_verdicts(robot_file: str | Path, robots_folder: str | Path, seed: int) -> dict[str, np.ndarray]:
    """One case: the verdicts on a campaign clean, damaged and with fewer rows, and what became of the bad rows.

    Returns one row for each slip, columns as `schemas.bad_rows` has them.
    """
    made = draw_campaign(robot_file, seed)
    table, _ = measured_table(made.robot, made.design, made.schedule)
    draws = stream(seed, "bad rows")
    kind = str(draws.choice(possible_kinds(table)))
    bad, slips = with_bad_rows(table, made.robot, made.schedule, kind, int(draws.integers(1, 4)), draws)
    wrong = np.isin(np.arange(len(table["pose"])), [row for slip in slips for row in slip.rows])
    away = draws.choice(np.flatnonzero(~wrong), wrong.sum(), replace=False)
    fewer = {name: np.delete(column, away) for name, column in table.items()}
    stated = {
        version: _verdict_on(made, rows, robot_file, robots_folder)
        for version, rows in ((CLEAN, table), (DAMAGED, bad), (FEWER, fewer))
    }
    return _rows(made, table, slips, stated)


def _drawn_design(arm: Arm, draws: np.random.Generator) -> Design:
    """20 to 60 poses with the rows of a user's campaign."""
    while True:
        poses = int(draws.integers(20, 61))
        ladder: tuple[float, ...] = (0.0, 1.0) if draws.integers(2) else (0.0,)
        others = [point for point in arm.points[:-1]] if draws.integers(2) else []
        points = (*([str(draws.choice(others))] if others else []), FLANGE)
        declares = bool(draws.integers(2))
        repeats, repeated = (1, 0) if declares else (3, 6)
        rows = len(points) * (poses * len(ladder) + repeated * (repeats - 1) * len(ladder))
        design = Design(
            poses=poses,
            held_out=round(0.3 * poses),
            ladder=ladder,
            repeats=repeats,
            repeated_poses=repeated,
            points=points,
            covariates=COVARIATES if draws.integers(2) else (),
            declared_noise=(60e-6, 60e-6) if declares else None,
            measured=("position", "pose")[draws.integers(2)],
            frame="tracker" if draws.random() < 0.3 else "base",
        )
        if _FEWEST <= rows <= _MOST:
            return design


def _large(arm: Arm, kind: str, draws: np.random.Generator, seed: int) -> tuple[Defect, ...]:
    """Defects that nobody overlooks."""
    if kind == OFFSETS:
        joints = draws.choice(arm.joints, draws.integers(2, arm.joints + 1), replace=False) + 1
        return tuple(
            Defect("joint_offset", (int(joint),), _OFFSET_RAD * draws.uniform(0.5, 1.5), seed + int(joint)) for joint in joints
        )
    count = {NOTHING: 0, LARGE: 1, TWO_LARGE: 2}[kind]
    effects = draws.choice(_WITHOUT_LOAD, count, replace=False)
    drawn = [drawn_defect(str(effect), arm, seed + number) for number, effect in enumerate(effects)]
    return tuple(replace(defect, size=_TIMES_PLAUSIBLE * defect.size) for defect in drawn)


def _faint(arm: Arm, effect: str, design: Design, schedule: Schedule, seed: int) -> tuple[Defect, ...]:
    """An effect of a non-centrality of 200; none where the declared model absorbs it, or its size would be implausible."""
    hidden = effect == _WEIGHT
    robot = specimen(arm, schedule.seed, weighs=not hidden)
    yardstick = Yardstick(
        robot,
        schedule,
        [arm.points.index(point) for point in design.targets_on(arm)],
        orientation=design.measured == "pose",
        free_frame=design.frame == "tracker",
        declared=() if hidden else declared_masses(arm),
    )
    defect = drawn_defect(effect, arm, seed)
    largest = min(KINDS[effect].largest, _TIMES_PLAUSIBLE * defect.size)
    try:
        size, _ = size_for(
            yardstick,
            lambda size: with_defects(robot, [replace(defect, size=size)]),
            defect.size,
            _NON_CENTRALITY,
            largest=largest,
        )
    except ValueError:
        return ()
    return (replace(defect, size=size),)


def _verdict_on(made: MadeCampaign, table: Table, robot_file: str | Path, robots_folder: str | Path) -> Mapping[str, Any] | str:
    """Verdict on a table, or the line by which it is refused; the files are a user's, and go with the folder."""
    document = campaign_document(made.name, made.robot.arm, made.design)
    document["holdout"]["poses"] = [pose for pose in document["holdout"]["poses"] if pose in table["pose"]]
    if made.design.frame == "tracker":
        document["targets"] = {name: target | {"offset_m": "unknown"} for name, target in document["targets"].items()}
    with tempfile.TemporaryDirectory() as folder:
        write_campaign(folder, document, table, made.robot.arm.joints, "csv")
        write_robot(folder, robot_file, made.robot, made.declared)
        try:
            return diagnosed(folder, robots_folder, made.schedule.seed % 2**16)
        except InputError as error:
            return str(error).replace(folder, "")


def _rows(
    made: MadeCampaign, table: Table, slips: Sequence[BadReading], stated: Mapping[str, Mapping[str, Any] | str]
) -> dict[str, np.ndarray]:
    named = {version: _named_rows(verdict) for version, verdict in stated.items()}
    reading = list(zip(table["pose"], table["load"], table["repeat"], strict=True))
    right = {row for slip in slips for row in slip.rows}
    if slips[0].kind in (JOINT_ANGLE, LOAD):
        # Targets of one reading share their angles and load: which of them is wrong, nothing tells.
        right = {row for row in range(len(reading)) if reading[row] in {reading[bad] for bad in right}}
    head = {
        "seed": made.schedule.seed,
        "poses": made.design.poses,
        "rows": len(reading),
        "loads": len(made.design.ladder),
        "targets": len(made.design.points),
        "measured": made.design.measured,
        "frame": made.design.frame,
        "noise": "repeats" if made.design.declared_noise is None else "declared",
        "covariates": bool(made.design.covariates),
        "mixture": made.kind,
        "truth": " + ".join(f"{d.effect} {'-'.join(map(str, d.joints))}".strip() for d in made.defects) or "none",
        "clean_rows_lost": len(named[CLEAN]),
        "wrongly_named": len(named[DAMAGED] - right),
    }
    for version, verdict in stated.items():
        head |= {f"{version}_{name}": value for name, value in _words_of(verdict).items()}
    held_out = made.design.poses - made.design.held_out
    count = len(slips)
    columns = {name: np.repeat(np.array([value]), count) for name, value in head.items()}
    return columns | {
        "kind": np.array([slip.kind for slip in slips]),
        "bad_rows": np.array([" ".join(str(row + 1) for row in slip.rows) for slip in slips]),
        "held_out": np.array([table["pose"][slip.rows[0]] >= held_out for slip in slips]),
        "size": np.array([max(slip.sizes) for slip in slips]),
        "named": np.array([_is_named(slip, named[DAMAGED]) for slip in slips]),
    }


def _named_rows(verdict: Mapping[str, Any] | str) -> set[int]:
    """Rows, from 0, that a verdict names as gross errors."""
    entries = [] if isinstance(verdict, str) else verdict.get("gross_errors", ())
    return {int(row) - 1 for entry in entries for row in entry["rows"]}


def _is_named(slip: BadReading, named: set[int]) -> bool:
    """Whether all rows of a slip are that contradict the robot by enough; of smaller ones the row that does so most."""
    enough = min(NAMED_FROM, max(slip.sizes))
    return all(row in named for row, size in zip(slip.rows, slip.sizes, strict=True) if size >= enough)


def _words_of(verdict: Mapping[str, Any] | str) -> dict[str, Any]:
    """What is compared: the word, the mechanisms, these with their joints, and the error on held-out poses."""
    if isinstance(verdict, str):
        return {"verdict": "refused", "found": verdict, "found_at": verdict, "heldout_rms_m": np.nan}
    effects, heldout = verdict["effects"], verdict["heldout"]
    places: dict[str, set[int]] = {}
    for effect in effects:
        places.setdefault(effect["name"], set()).update(effect["joints"])
    return {
        "verdict": verdict["verdict"],
        "found": " + ".join(sorted(places)) or "none",
        "found_at": " + ".join(f"{name} {'-'.join(map(str, sorted(places[name])))}".strip() for name in sorted(places))
        or "none",
        "heldout_rms_m": np.nan if heldout is None else heldout["after"]["rms_m"],
    }
