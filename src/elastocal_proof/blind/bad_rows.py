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
import pandas as pd

from elastocal.campaigns.writing import write_campaign
from elastocal.errors import InputError
from elastocal.io.data_frames import read_frame, write_csv
from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.loop.whole import diagnosed
from elastocal_proof.blind import schemas
from elastocal_proof.blind.cases import WEIGHT, drawn_slips
from elastocal_proof.blind.folders import campaign_document, write_robot
from elastocal_proof.blind.scores import NONE, places, rate
from elastocal_proof.plant.arm import arm_from_file
from elastocal_proof.plant.bad_rows import JOINT_ANGLE, LOAD
from elastocal_proof.plant.campaigns import COVARIATES, FLANGE, Design, measured_table, schedule_of
from elastocal_proof.plant.defects import Defect, drawn_defect, with_defects
from elastocal_proof.plant.kinds import KINDS
from elastocal_proof.plant.physical_robot import specimen
from elastocal_proof.plant.random_numbers import stream
from elastocal_proof.plant.sizing import Yardstick, size_for
from elastocal_proof.plant.weights import declared_masses

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import Any

    from elastocal_proof.plant.arm import Arm, LinkMass
    from elastocal_proof.plant.bad_rows import BadReading
    from elastocal_proof.plant.campaigns import Table
    from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule

CLEAN, DAMAGED, FEWER = "clean", "damaged", "fewer"
NOTHING, OFFSETS, LARGE, TWO_LARGE, FAINT = "nothing", "joint offsets", "one, large", "two, large", "one, at 200"
# How often each truth is drawn.
MIXTURE = {NOTHING: 0.25, OFFSETS: 0.25, LARGE: 0.2, TWO_LARGE: 0.1, FAINT: 0.2}
# From this size on a bad row shall be named, in standard deviations.
NAMED_FROM = 10.0
SAME, SAME_JOINTS, NAMED, UNTOUCHED = "verdict of the clean file", "and its joints", "row named", "no row lost"
# Least share of each, as they were set beforehand.
TARGETS = {SAME: 0.97, NAMED: 0.95, UNTOUCHED: 0.98}
# Rows that a user's campaign has.
_FEWEST, _MOST = 40, 200
# Of a mastering that went wrong, rad; of other large effects, times the plausible size.
_OFFSET_RAD, _TIMES_PLAUSIBLE = 2e-3, 5.0
_NON_CENTRALITY = 200.0
_WITHOUT_LOAD = ("joint_offset", "link_geometry", WEIGHT, "transmission_harmonic", "transmission_ratio")
_WITH_LOAD = ("joint_tilt", "link_elasticity", "stiffening")
_DRAWS, _SLIPS = 8, 3
_CASE = ["robot", "seed"]


@dataclass(frozen=True)
class MadeCampaign:
    """A campaign before anything slipped.

    `robot`: with its defects. `kind`: of `MIXTURE`.
    """

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
    arm, draws = arm_from_file(robot_file), stream(seed, "campaign with bad rows")
    design = _drawn_design(arm, draws)
    schedule, kind = schedule_of(arm, design, seed), str(draws.choice(list(MIXTURE), p=list(MIXTURE.values())))
    known = _WITHOUT_LOAD + (_WITH_LOAD if len(design.ladder) > 1 else ())
    if kind == FAINT:
        found = (_faint(arm, str(draws.choice(known)), design, schedule, seed + number) for number in range(_DRAWS))
        defects = next((defects for defects in found if defects), ())
    else:
        defects = _large(arm, kind, draws, seed)
    hidden = any(defect.effect == WEIGHT for defect in defects)
    robot = with_defects(specimen(arm, seed, weighs=not hidden), defects)
    declared = () if hidden else declared_masses(arm)
    return MadeCampaign(robot, design, schedule, declared, kind if defects else NOTHING, defects)


def compare_case(robot_file: str | Path, robots_folder: str | Path, seed: int) -> dict[str, np.ndarray]:
    """One case: the verdicts on a campaign clean, damaged and with fewer rows, and what became of the bad rows.

    Returns one row for each slip, columns as `schemas.BAD_ROWS` has them.
    """
    made, draws = draw_campaign(robot_file, seed), stream(seed, "bad rows")
    table, _ = measured_table(made.robot, made.design, made.schedule)
    bad, slips = drawn_slips(table, made.robot, made.schedule, _SLIPS, draws)
    wrong = np.isin(np.arange(len(table["pose"])), [row for slip in slips for row in slip.rows])
    away = draws.choice(np.flatnonzero(~wrong), wrong.sum(), replace=False)
    fewer = {name: np.delete(column, away) for name, column in table.items()}
    versions = {CLEAN: table, DAMAGED: bad, FEWER: fewer}
    stated = {name: _verdict_on(made, rows, robot_file, robots_folder) for name, rows in versions.items()}
    return _rows(made, table, slips, stated)


def _drawn_design(arm: Arm, draws: np.random.Generator) -> Design:
    """20 to 60 poses with the rows of a user's campaign."""
    while True:
        poses = int(draws.integers(20, 61))
        ladder: tuple[float, ...] = (0.0, 1.0) if draws.integers(2) else (0.0,)
        others = list(arm.points[:-1]) if draws.integers(2) else []
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
        sizes = {int(joint): _OFFSET_RAD * draws.uniform(0.5, 1.5) for joint in joints}
        return tuple(Defect("joint_offset", (joint,), size, seed + joint) for joint, size in sizes.items())
    effects = draws.choice(_WITHOUT_LOAD, {NOTHING: 0, LARGE: 1, TWO_LARGE: 2}[kind], replace=False)
    drawn = [drawn_defect(str(effect), arm, seed + number) for number, effect in enumerate(effects)]
    return tuple(replace(defect, size=_TIMES_PLAUSIBLE * defect.size) for defect in drawn)


def _faint(arm: Arm, effect: str, design: Design, schedule: Schedule, seed: int) -> tuple[Defect, ...]:
    """An effect of a non-centrality of 200; none where the declared model absorbs it, or its size would be implausible."""
    weighs, targets = effect != WEIGHT, [arm.points.index(point) for point in design.targets_on(arm)]
    robot, declared = specimen(arm, schedule.seed, weighs=weighs), declared_masses(arm) if weighs else ()
    yardstick = Yardstick(robot, schedule, targets, design.measured == "pose", design.frame == "tracker", declared)
    defect = drawn_defect(effect, arm, seed)
    largest = min(KINDS[effect].largest, _TIMES_PLAUSIBLE * defect.size)
    try:
        size = size_for(
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
    seed, arm = made.schedule.seed, made.robot.arm
    document = campaign_document(f"bad_rows_{seed}", arm, made.design)
    document["holdout"]["poses"] = [pose for pose in document["holdout"]["poses"] if pose in table["pose"]]
    if made.design.frame == "tracker":
        document["targets"] = {name: target | {"offset_m": "unknown"} for name, target in document["targets"].items()}
    with tempfile.TemporaryDirectory() as folder:
        write_campaign(folder, document, table, arm.joints, "csv")
        write_robot(folder, robot_file, made.robot, made.declared)
        try:
            return diagnosed(folder, robots_folder, seed % 2**16)
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
        "truth": " + ".join(f"{d.effect} {'-'.join(map(str, d.joints))}".strip() for d in made.defects) or NONE,
        "clean_rows_lost": len(named[CLEAN]),
        "wrongly_named": len(named[DAMAGED] - right),
    }
    for version, verdict in stated.items():
        head |= {f"{version}_{name}": value for name, value in _words_of(verdict).items()}
    columns = {name: np.repeat(np.array([value]), len(slips)) for name, value in head.items()}
    fitted = made.design.poses - made.design.held_out
    return columns | {
        "kind": np.array([slip.kind for slip in slips]),
        "bad_rows": np.array([" ".join(str(row + 1) for row in slip.rows) for slip in slips]),
        "held_out": np.array([table["pose"][slip.rows[0]] >= fitted for slip in slips]),
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
    found, heldout = places(verdict["effects"], "name"), verdict["heldout"]
    at = [f"{name} {'-'.join(map(str, sorted(found[name])))}".strip() for name in sorted(found)]
    words = {"verdict": verdict["verdict"], "found": " + ".join(sorted(found)) or NONE, "found_at": " + ".join(at) or NONE}
    return words | {"heldout_rms_m": np.nan if heldout is None else heldout["after"]["rms_m"]}


def judge_cases(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Every slip with whether the verdict on its case stayed the same; `tables`: rows of `compare_case` by robot."""
    frame = pd.concat([table.assign(robot=robot) for robot, table in tables.items()], ignore_index=True)
    for version in (DAMAGED, FEWER):
        alike = [frame[f"{version}_{name}"] == frame[f"{CLEAN}_{name}"] for name in ("verdict", "found", "found_at")]
        frame[f"{version}_same"], frame[f"{version}_same_joints"] = alike[0] & alike[1], alike[0] & alike[2]
    frame["heldout_ratio"] = frame[f"{DAMAGED}_heldout_rms_m"] / frame[f"{CLEAN}_heldout_rms_m"]
    return frame[[*_CASE, *(name for name in frame if name not in _CASE)]]


def summarize(slips: pd.DataFrame) -> pd.DataFrame:
    """Each rate with its interval of 95 %, of all cases and of parts of them, and with its target where it has one."""
    return pd.DataFrame([*_summaries(slips)], columns=["quantity", "of", *rate([]), "target", "holds"])


def _summaries(slips: pd.DataFrame) -> Iterator[dict[str, Any]]:
    cases, large = slips.drop_duplicates(_CASE), slips[slips["size"] >= NAMED_FROM]
    yield _rated(SAME, "all cases", cases[f"{DAMAGED}_same"], judged=True)
    yield _rated(SAME, "with as many good rows deleted", cases[f"{FEWER}_same"])
    yield _rated(SAME_JOINTS, "all cases", cases[f"{DAMAGED}_same_joints"])
    yield _rated(SAME_JOINTS, "with as many good rows deleted", cases[f"{FEWER}_same_joints"])
    for name in ("kind", "mixture", "robot"):
        for value, part in cases.groupby(name):
            yield _rated(SAME, str(value), part[f"{DAMAGED}_same"])
    yield _rated(UNTOUCHED, "clean files", cases["clean_rows_lost"] == 0, judged=True)
    yield _rated(UNTOUCHED, "good rows of damaged files", cases["wrongly_named"] == 0)
    yield _rated("refused when read", "all cases", cases[f"{DAMAGED}_verdict"] == "refused")
    yield _rated(NAMED, f"from {NAMED_FROM:g} standard deviations", large["named"], judged=True)
    yield _rated(NAMED, "smaller", slips[slips["size"] < NAMED_FROM]["named"])
    for where, part in large.groupby(np.where(large["held_out"], "held out", "fitted")):
        yield _rated(NAMED, str(where), part["named"])
    for kind, part in large.groupby("kind"):
        yield _rated(NAMED, str(kind), part["named"])
    # Held-out errors of the damaged file over those of the clean one.
    ratio = cases["heldout_ratio"].dropna()
    for words, share in (("median", 0.5), ("95th percentile", 0.95), ("largest", 1.0)):
        row = {"hits": None, "cases": len(ratio), "rate": float(ratio.quantile(share)) if len(ratio) else np.nan}
        row |= {"low": np.nan, "high": np.nan, "target": np.nan, "holds": None}
        yield {"quantity": "held-out RMS error over the clean file's", "of": words} | row


def _rated(quantity: str, of: str, hits: pd.Series, judged: bool = False) -> dict[str, Any]:
    found, target = rate(hits), TARGETS[quantity] if judged else np.nan
    holds = bool(found["rate"] >= target) if judged and found["cases"] else None
    return {"quantity": quantity, "of": of} | found | {"target": target, "holds": holds}


def compare_verdicts(job: Any) -> None:
    """All cases of bad rows on one robot, as one table."""
    robot = Path(job.input.robot)
    blocks = (compare_case(robot, robot.parent, seed) for seed in draw_seeds(robot, job.params.seed, job.params.each))
    write_table(job.output.slips, schemas.BAD_ROWS, blocks, provenance(job.params, **job.wildcards))


def summarize_bad_rows(job: Any) -> None:
    """Rates of verdicts that bad rows leave as they are, and of rows that are named."""
    files = zip(job.params.robots, job.input.slips, strict=True)
    slips = judge_cases({robot: read_frame(path, schemas.BAD_ROWS) for robot, path in files})
    write_csv(job.output.cases, slips)
    write_csv(job.output.summary, summarize(slips))
