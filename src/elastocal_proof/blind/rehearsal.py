"""A physical robot with hidden defects stands in for a real one: it fills a measurement sheet, and goes where it is commanded.

To rehearse a calibration, from the robot's file to the corrected robot, before a tracker is hired.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError
from elastocal.mechanics.components import WRENCH
from elastocal.report.words import at_joints, listed, physical_name
from elastocal_proof.plant.arm import arm_from_file
from elastocal_proof.plant.defects import KINDS, OUTSIDE, Defect, drawn_defect, with_defects
from elastocal_proof.plant.drives import Repeatability
from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule, seen_poses, specimen
from elastocal_proof.plant.random_numbers import stream
from elastocal_proof.plant.tracker import misplaced_base, rotation_vector

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from elastocal_proof.plant.arm import Arm

# What every arm has that was never calibrated, at each of its joints, beside other gears and weights than its file says.
_NOT_TURNED = (0.0, 0.0, 0.0)
ERRORS_OF_GEOMETRY = ("joint_offset", "link_geometry")
_COMPENSATORS = ("compensator_stiffness", "compensator_torque")
# 10 µm at the end of an arm of 2 m.
_JOINT_REPEATABILITY_RAD = 5e-6
_SECONDS_PER_STATE = 25.0
_STATE = ["pose", "load", "repeat"]
_WRENCH = [name for name, _, _ in WRENCH]


def hidden_robot(robot_file: str | Path, seed: int, effects: Sequence[str] = ()) -> tuple[PhysicalRobot, list[Defect]]:
    """The robot that stands in.

    `robot_file`: of which it is a specimen. `effects`: keys of `defects.KINDS`, each at a joint that is drawn; one effect that
    is drawn by default. Returns `defects`: for whoever wants to compare them with the verdict afterwards. Raises `InputError`:
    an effect that this arm cannot have.
    """
    arm = arm_from_file(robot_file)
    possible = sorted(
        name
        for name, kind in KINDS.items()
        if not kind.needs and not name.startswith(OUTSIDE) and name not in ERRORS_OF_GEOMETRY and kind.locations(arm)
    )
    for name in effects:
        if name not in possible:
            raise InputError("rehearsal", "effects", repr(name), ", ".join(possible))
    # Nobody's catalogue offers a compensator to an arm whose file has none.
    if "compensator:" not in Path(robot_file).read_text(encoding="utf-8"):
        possible = [name for name in possible if name not in _COMPENSATORS]
    chosen = tuple(effects) or (possible[stream(seed, "hidden effect").integers(len(possible))],)
    defects = [*_errors_of_geometry(arm, seed), *(drawn_defect(name, arm, seed) for name in chosen)]
    robot = specimen(arm, seed)
    robot = replace(robot, drives=(*robot.drives, Repeatability((_JOINT_REPEATABILITY_RAD,) * arm.joints)))
    return with_defects(robot, defects), defects


def hidden_words(defects: Sequence[Defect], effects: Sequence[str]) -> str:
    """What `hidden_robot` hid of effects that were asked for, or drew; the small errors that every robot has stand before."""
    return listed(
        f"{physical_name(defect.effect)}{at_joints(defect.effect, defect.joints)}"
        for defect in defects[-max(len(effects), 1) :]
    )


def filled_sheet(
    sheet: pd.DataFrame, document: Mapping[str, Any], robot: PhysicalRobot, seed: int, source: str = "measurements.csv"
) -> pd.DataFrame:
    """A measurement sheet with what a tracker reads.

    `sheet`: columns of measurements.csv but for those of the tracker, which may be there and empty. `document`: of
    campaign.yaml. `seed`: of the noise, and of where reflectors sit whose offset or rotation is unknown. `source`: named in
    errors. Returns the same rows. Raises `InputError`: a column that is missing or no number, a target that the campaign does
    not have, or a moment that is not that of the row's force at a lever.
    """
    require_numbers(sheet, [*_STATE, *(f"q{j + 1}" for j in range(robot.arm.joints)), *_WRENCH], source)
    if "target" not in sheet:
        raise InputError(source, "columns", "no 'target'", "the target of each row")
    strangers = sheet[~sheet["target"].isin(list(document["targets"]))]
    if len(strangers):
        found = repr(strangers["target"].iloc[0])
        raise InputError(source, f"target, line {strangers.index[0] + 2}", found, ", ".join(document["targets"]))
    states = sheet.drop_duplicates(_STATE)
    number = pd.MultiIndex.from_frame(states[_STATE]).get_indexer(pd.MultiIndex.from_frame(sheet[_STATE]))
    schedule = _schedule(robot.arm, states, seed, source)
    position, rotation = seen_poses(robot, schedule)
    names = list(document["targets"])
    at = [robot.arm.points.index(document["targets"][name]["point"]) for name in names]
    targets = document["targets"].items()
    offsets = np.array([_stated(target["offset_m"], seed, f"reflector {name}", 0.1) for name, target in targets])
    mounts = [_stated(target.get("rotation", _NOT_TURNED), seed, f"mount {name}", np.pi / 2) for name, target in targets]
    turns = Rotation.from_rotvec(mounts).as_matrix()
    position = position[:, at] + (rotation[:, at] @ offsets[..., None])[..., 0]
    position, rotation, _ = robot.tracker.read(position, rotation[:, at] @ turns, stream(seed, "readings"))
    if document["frame"] == "tracker":
        position, rotation = robot.tracker.in_own_frame(position, rotation)
    seen = number, pd.Index(names).get_indexer(sheet["target"])
    measured = dict(zip("xyz", position[seen].T, strict=True))
    if document["measured"] == "pose":
        measured |= dict(zip(("rx", "ry", "rz"), rotation_vector(rotation[seen]).T, strict=True))
    return sheet.assign(**measured)


def require_numbers(table: pd.DataFrame, names: Sequence[str], source: str) -> None:
    """Refuse a table that lacks one of these columns or has in it what is no number: `InputError` names ``source`` and line."""
    for name in names:
        if name not in table:
            raise InputError(source, "columns", f"no {name!r}", ", ".join(names))
        wrong = ~np.isfinite(pd.to_numeric(table[name], errors="coerce"))
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InputError(source, f"{name}, line {row + 2}", repr(table[name].iloc[row]), "a number")


def with_misplaced_base(robot: PhysicalRobot, seed: int) -> PhysicalRobot:
    """The robot beside a tracker whose frame of the base is off by some 0.3 mrad and 0.2 mm."""
    return replace(robot, tracker=replace(robot.tracker, misplaced=misplaced_base(stream(seed, "tilted base"))))


def with_lost_beam(sheet: pd.DataFrame, seed: int) -> tuple[pd.DataFrame, int]:
    """A filled sheet in which one row, which is drawn, reads zeros as after a lost beam; and its place."""
    row = int(stream(seed, "lost beam").integers(len(sheet)))
    damaged = sheet.copy()
    damaged.loc[damaged.index[row], [name for name in ("x", "y", "z", "rx", "ry", "rz") if name in sheet]] = 0.0
    return damaged, row


def errors_along_path(
    robot: PhysicalRobot, shown: np.ndarray, wrench: np.ndarray, wanted: np.ndarray, seed: int, source: str
) -> tuple[np.ndarray, np.ndarray]:
    """Distances of where the tracker sees the robot from where it is wanted (N, 3), m, in the tracker's frame of the base.

    Other arguments as in `reached`. Returns those (N,), and what the tracker's noise and the robot's repeatability leave where
    the robot is commanded by an exact model (N,): half the square of the difference of two visits is the repeatability's.
    """
    visits = [reached(robot, shown, wrench, number, source) for number in (seed, seed + 1)]
    position, rotation = (part[:, None] for part in visits[0])
    noise = robot.tracker.read(position, rotation, stream(seed, "noise along a path"))[0][:, 0] - visits[0][0]
    repeatability = (visits[0][0] - visits[1][0]) / np.sqrt(2.0)
    errors = visits[0][0] + noise - wanted, noise + repeatability
    return np.linalg.norm(errors[0], axis=1), np.linalg.norm(errors[1], axis=1)


def reached(
    robot: PhysicalRobot, shown: np.ndarray, wrench: np.ndarray, seed: int, source: str = "commands"
) -> tuple[np.ndarray, np.ndarray]:
    """Where the end effector comes to rest.

    `shown` (N, n): commanded joint angles as the controller shows them, rad; each is approached afresh. `wrench` (N, 6): at the
    last measuring point, base axes; N, N m. `seed`: of the repeatability of the drives. `source`: named in errors. Returns
    `position` (N, 3): m, in the frame that is declared as the base's; without the tracker's noise; `rotation` (N, 3, 3). Raises
    `InputError`: as in `filled_sheet`.
    """
    columns = dict(zip([*(f"q{j + 1}" for j in range(shown.shape[1])), *_WRENCH], [*shown.T, *wrench.T], strict=True))
    rows = pd.DataFrame(columns | {"pose": np.arange(len(shown)), "load": 0, "repeat": 0})
    position, rotation = seen_poses(robot, _schedule(robot.arm, rows, seed, source))
    return position[:, -1], rotation[:, -1]


def _errors_of_geometry(arm: Arm, seed: int) -> list[Defect]:
    draws = stream(seed, "errors of geometry")
    return [
        Defect(name, joints, KINDS[name].plausible_on(arm) * draws.uniform(), seed + 1 + place)
        for name in ERRORS_OF_GEOMETRY
        for place, joints in enumerate(KINDS[name].locations(arm))
    ]


def _schedule(arm: Arm, states: pd.DataFrame, seed: int, source: str) -> Schedule:
    shown = states[[f"q{j}" for j in range(1, arm.joints + 1)]].to_numpy(float)
    force, moment = np.split(states[_WRENCH].to_numpy(float), 2, axis=1)
    square = (force**2).sum(axis=1, keepdims=True)
    lever = np.divide(np.cross(force, moment), square, out=np.zeros_like(force), where=square > 0)
    wrong = np.abs(np.cross(lever, force) - moment).max(axis=1) > 1e-6 * (1.0 + np.abs(moment).max(axis=1))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(source, f"moment of row {row + 1}", str(moment[row].tolist()), "the moment of the force at a lever")
    count = len(states)
    approach = [f"approach{j}" for j in range(1, arm.joints + 1)]
    drawn = stream(seed, "approaches").choice([-1, 1], (count, arm.joints))
    sense = states[approach].fillna(0).to_numpy(int) if set(approach) <= set(states) else np.zeros_like(drawn)
    return Schedule(
        arm.angles_shown_as(shown),
        force,
        lever,
        states["pose"].to_numpy(int),
        states["load"].to_numpy(int),
        states["repeat"].to_numpy(int),
        np.arange(count),
        np.where(sense == 0, drawn, sense),
        np.full(count, -1),
        _SECONDS_PER_STATE * np.arange(1, count + 1),
        np.ones(count, bool),
        seed,
    )


def _stated(value: str | Sequence[float], seed: int, name: str, within: float) -> np.ndarray:
    """What a campaign states of a target's place or mount (3,), or a draw within bounds where it does not know."""
    return stream(seed, name).uniform(-within, within, 3) if isinstance(value, str) else np.array(value, float)
