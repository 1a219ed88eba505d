"""A physical robot with hidden defects stands in for a real one: it fills a measurement
sheet, and goes where it is commanded.

To rehearse a calibration, from the robot's file to the corrected robot, before a
tracker is hired.
"""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from elastocal.application.calibrated import compute_nominal_poses
from elastocal.application.inverse_kinematics import (
    SOLVED_M,
    find_beyond_limits,
    solve_poses,
)
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.tables import LARGEST_BYTES
from elastocal.errors import InputError
from elastocal.exchange.target_path import read_target_path
from elastocal.io.atomic_writes import atomic_write, check_places
from elastocal.io.texts import read_text
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.report.words import format_joints, join_items, name_effect
from elastocal_proof.blind.cases import draw_misplaced_base
from elastocal_proof.plant.arm import read_arm, to_rotation_vector
from elastocal_proof.plant.campaigns import SECONDS_PER_STATE, get_typical_force_N
from elastocal_proof.plant.kinds import (
    KINDS,
    OUTSIDE,
    Defect,
    apply_defects,
    draw_defect,
)
from elastocal_proof.plant.simulated_robot import (
    Schedule,
    SimulatedRobot,
    draw_specimen,
    open_simulation_stream,
    simulate_poses,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from elastocal.mechanics.robot import Robot
    from elastocal_proof.plant.arm import Arm

# What every arm has that was never calibrated, at each of its joints, beside other
# gears and weights than its file says.
ERRORS_OF_GEOMETRY = ("joint_offset", "link_geometry")
_COMPENSATORS = ("compensator_stiffness", "compensator_torque")
# 10 µm at the end of an arm of 2 m.
_JOINT_REPEATABILITY_RAD = 5e-6
_STATE = ["pose", "load", "repeat"]
# A path to mill: its width over the reach, and its poses; postures that are tried until
# it stays within the limits.
_BOW = 0.2
_BOW_POSES = 50
_TRIES = 200


def build_hidden_robot(
    robot_file: str | Path, seed: int, effects: Sequence[str] = ()
) -> tuple[SimulatedRobot, list[Defect]]:
    """The robot that stands in, and its defects.

    `effects`: keys of `KINDS`, each at a joint that is drawn; one that is drawn by
    default. Raises `InputError`: an effect that this arm cannot have.
    """
    declared = read_robot(robot_file)
    arm = read_arm(robot_file)
    possible = sorted(
        name
        for name, kind in KINDS.items()
        if not kind.needs
        and not name.startswith(OUTSIDE)
        and name not in ERRORS_OF_GEOMETRY
        and kind.locations(arm)
    )
    for name in effects:
        if name not in possible:
            raise InputError("rehearsal", "effects", repr(name), ", ".join(possible))
    # Nobody's catalogue offers a compensator to an arm whose file has none.
    if declared.compensator is None:
        possible = [name for name in possible if name not in _COMPENSATORS]
    chosen = tuple(effects)
    draws = open_simulation_stream(seed, "errors of geometry")
    if not chosen:
        chosen = (
            possible[
                open_simulation_stream(seed, "hidden effect").integers(len(possible))
            ],
        )
    of_geometry = [
        Defect(
            name,
            joints,
            KINDS[name].scale_plausible_size(arm) * draws.uniform(),
            seed + 1 + place,
        )
        for name in ERRORS_OF_GEOMETRY
        for place, joints in enumerate(KINDS[name].locations(arm))
    ]
    defects = [*of_geometry, *(draw_defect(name, arm, seed) for name in chosen)]
    robot = replace(
        draw_specimen(arm, seed),
        repeatability_rad=(_JOINT_REPEATABILITY_RAD,) * arm.joints,
    )
    return apply_defects(robot, defects), defects


def describe_hidden_effects(defects: Sequence[Defect], effects: Sequence[str]) -> str:
    """What `build_hidden_robot` hid of effects that were asked for, or drew; the small errors
    that every robot has stand before."""
    hidden = defects[-max(len(effects), 1) :]
    return join_items(
        f"{name_effect(defect.effect)}{format_joints(defect.effect, defect.joints)}"
        for defect in hidden
    )


def misplace_base(robot: SimulatedRobot, seed: int) -> SimulatedRobot:
    """The robot beside a tracker whose frame of the base is off by some 0.3 mrad and
    0.2 mm."""
    return replace(
        robot, tracker=replace(robot.tracker, misplaced=draw_misplaced_base(seed))
    )


def fill_sheet(
    path: Path, document: Mapping[str, Any], robot: SimulatedRobot, seed: int
) -> int:
    """Fill the measurement sheet at `path` with what a tracker reads; returns how many
    measurements it has now.

    Its columns are those of measurements.csv; those of the tracker may be missing or
    empty. `document`: of campaign.yaml. `seed`: of the noise, and of where reflectors
    sit whose offset or rotation is unknown. Raises `InputError`: a column that is
    missing or no number, a target that the campaign does not have, or a moment that is
    not that of the row's force at a lever.
    """
    check_places(path)
    sheet = _read_table(path)
    source = path.as_posix()
    targets = document["targets"]
    require_numbers(
        sheet,
        [*_STATE, *(f"q{j + 1}" for j in range(robot.arm.joints)), *WRENCH_NAMES],
        source,
    )
    if "target" not in sheet:
        raise InputError(source, "columns", "no 'target'", "the target of each row")
    strangers = sheet[~sheet["target"].isin(list(targets))]
    if len(strangers):
        raise InputError(
            source,
            f"target, line {strangers.index[0] + 2}",
            repr(strangers["target"].iloc[0]),
            ", ".join(targets),
        )
    states = sheet.drop_duplicates(_STATE)
    number = pd.MultiIndex.from_frame(states[_STATE]).get_indexer(
        pd.MultiIndex.from_frame(sheet[_STATE])
    )
    position, rotation = simulate_poses(
        robot, _schedule(robot.arm, states, seed, source)
    )
    at = [robot.arm.points.index(target["point"]) for target in targets.values()]

    def where(value: str | Sequence[float], name: str, within: float) -> np.ndarray:
        # A draw within bounds where the campaign does not know.
        return (
            open_simulation_stream(seed, name).uniform(-within, within, 3)
            if isinstance(value, str)
            else np.array(value, float)
        )

    offsets = np.array(
        [
            where(target["offset_m"], f"reflector {name}", 0.1)
            for name, target in targets.items()
        ]
    )
    mounts = [
        where(each.get("rotation", np.zeros(3)), f"mount {name}", np.pi / 2)
        for name, each in targets.items()
    ]
    position = position[:, at] + (rotation[:, at] @ offsets[..., None])[..., 0]
    rotation = rotation[:, at] @ Rotation.from_rotvec(mounts).as_matrix()
    position, rotation = robot.tracker.read(
        position, rotation, open_simulation_stream(seed, "readings")
    )
    if document["frame"] == "tracker":
        position, rotation = robot.tracker.to_tracker_frame(position, rotation)
    seen = number, pd.Index(list(targets)).get_indexer(sheet["target"])
    measured = dict(zip("xyz", position[seen].T, strict=True))
    if document["measured"] == "pose":
        measured |= dict(
            zip(("rx", "ry", "rz"), to_rotation_vector(rotation[seen]).T, strict=True)
        )
    _write_table(path, sheet.assign(**measured))
    return len(sheet)


def write_milling_path(
    path: Path, declared: Robot, robot: SimulatedRobot, seed: int
) -> int:
    """Write wanted poses along a bow as for milling, under half the usual force of such
    a robot; returns how many."""
    check_places(path)
    at, turned, angles = draw_milling_path(
        declared, _BOW * robot.arm.reach_m, _BOW_POSES, np.random.default_rng(seed)
    )
    force = np.tile(
        [0.0, 0.0, get_typical_force_N(robot.arm) / 2, 0.0, 0.0, 0.0], (len(at), 1)
    )
    names = [
        "x",
        "y",
        "z",
        "rx",
        "ry",
        "rz",
        *WRENCH_NAMES,
        *(f"q{j + 1}" for j in range(len(angles[0]))),
    ]
    columns = np.column_stack(
        [at, Rotation.from_matrix(turned).as_rotvec(), force, angles]
    )
    _write_table(path, pd.DataFrame(columns, columns=names))
    return len(at)


def measure_errors(
    path: Path, targets: Path, robot: SimulatedRobot, seed: int
) -> dict[str, np.ndarray]:
    """Distances (N,), m, of where the tracker sees the robot from the wanted poses, in
    the campaign's frame of the base.

    By "uncorrected" and "corrected" `targets`, as `elastocal correct` wrote them for
    `path`; "noise alone": of an exact model.
    """
    wanted = read_target_path(path, robot.arm.joints)
    table = _read_table(targets)
    source = targets.as_posix()
    if len(table) != len(wanted):
        raise InputError(
            source, "rows", str(len(table)), f"{len(wanted)}, the poses of {path}"
        )
    wrench = np.zeros((len(wanted), 6)) if wanted.wrench is None else wanted.wrench
    off = {}
    for name, ending in (("uncorrected", "_uncorrected"), ("corrected", "")):
        columns = [f"q{joint}{ending}" for joint in range(1, robot.arm.joints + 1)]
        require_numbers(table, columns, source)
        angles = table[columns].to_numpy(float)
        visits = [
            move_robot(robot, angles, wrench, number, source)
            for number in (seed, seed + 1)
        ]
        position, rotation = (part[:, None] for part in visits[0])
        noise = (
            robot.tracker.read(
                position, rotation, open_simulation_stream(seed, "noise along a path")
            )[0][:, 0]
            - visits[0][0]
        )
        off[name] = np.linalg.norm(visits[0][0] + noise - wanted.position, axis=1)
        # Half the square of the difference of two visits is the repeatability's.
        off["noise alone"] = np.linalg.norm(
            noise + (visits[0][0] - visits[1][0]) / np.sqrt(2.0), axis=1
        )
    return off


def move_robot(
    robot: SimulatedRobot,
    shown: np.ndarray,
    wrench: np.ndarray,
    seed: int,
    source: str = "commands",
) -> tuple[np.ndarray, np.ndarray]:
    """Where the end effector comes to rest, (N, 3), m, and (N, 3, 3), in the frame that
    is declared as the base's; no noise.

    `shown` (N, n): commanded joint angles as the controller shows them, rad; each is
    approached afresh. `wrench` (N, 6): at the last measuring point, base axes. `seed`:
    of the repeatability of the drives.
    """
    columns = dict(
        zip(
            [*(f"q{j + 1}" for j in range(shown.shape[1])), *WRENCH_NAMES],
            [*shown.T, *wrench.T],
            strict=True,
        )
    )
    rows = pd.DataFrame(
        columns | {"pose": np.arange(len(shown)), "load": 0, "repeat": 0}
    )
    position, rotation = simulate_poses(robot, _schedule(robot.arm, rows, seed, source))
    return position[:, -1], rotation[:, -1]


def draw_milling_path(
    robot: Robot, length_m: float, count: int, draws: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A path in a level plane at one orientation, in a posture that keeps within the
    limits, as for milling.

    Returns so many positions and rotations, m, base axes, and reported angles of the
    rigid robot, rad.
    """
    low, high = robot.joint_limits.T
    share = np.linspace(-0.5, 0.5, count)[:, None]
    for _ in range(_TRIES):
        middle = (
            low + (high - low) * (0.5 + 0.5 * (draws.random(robot.joints) - 0.5))
        )[None]
        heading = draws.uniform(0.0, 2.0 * np.pi)
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        aside = np.array([-np.sin(heading), np.cos(heading), 0.0])
        at, turned = compute_nominal_poses(robot, robot.reported_angles(middle))
        position = at + length_m * (share * ahead + share**2 * aside)
        rotation = np.broadcast_to(turned, (count, 3, 3))
        angles, left = solve_poses(
            robot, position, rotation, np.repeat(middle, count, axis=0)
        )
        smooth = np.abs(np.diff(angles, axis=0)).max() < 0.1
        if (
            left.max() < SOLVED_M
            and not find_beyond_limits(robot, angles).any()
            and smooth
        ):
            return position, rotation, robot.reported_angles(angles)
    raise RuntimeError(
        f"{robot.name}: no posture in {_TRIES} in which the path lies within the limits"
    )


def require_numbers(table: pd.DataFrame, names: Sequence[str], source: str) -> None:
    """Refuse a table that lacks one of these columns or has in it what is no number:
    `InputError` names ``source`` and line."""
    for name in names:
        if name not in table:
            raise InputError(source, "columns", f"no {name!r}", ", ".join(names))
        wrong = ~np.isfinite(pd.to_numeric(table[name], errors="coerce"))
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InputError(
                source,
                f"{name}, line {row + 2}",
                repr(table[name].iloc[row]),
                "a number",
            )


def _schedule(arm: Arm, states: pd.DataFrame, seed: int, source: str) -> Schedule:
    wrench = states[list(WRENCH_NAMES)].to_numpy(float)
    count = len(states)
    force, moment = np.split(wrench, 2, axis=1)
    square = (force**2).sum(axis=1, keepdims=True)
    # The shortest at which the forces have their moments.
    lever = np.divide(
        np.cross(force, moment), square, out=np.zeros_like(force), where=square > 0
    )
    wrong = np.abs(np.cross(lever, force) - moment).max(axis=1) > 1e-6 * (
        1.0 + np.abs(moment).max(axis=1)
    )
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            source,
            f"moment of row {row + 1}",
            str(moment[row].tolist()),
            "the moment of the force at a lever",
        )
    approach = [f"approach{j}" for j in range(1, arm.joints + 1)]
    drawn = open_simulation_stream(seed, "approaches").choice(
        [-1, 1], (count, arm.joints)
    )
    sense = (
        states[approach].fillna(0).to_numpy(int)
        if set(approach) <= set(states)
        else np.zeros_like(drawn)
    )
    return Schedule(
        angle=states[[f"q{j}" for j in range(1, arm.joints + 1)]].to_numpy(float),
        force=force,
        lever=lever,
        **{name: states[name].to_numpy(int) for name in _STATE},
        approach=np.arange(count),
        sense=np.where(sense == 0, drawn, sense),
        previous=np.full(count, -1),
        time_s=SECONDS_PER_STATE * np.arange(1, count + 1),
        training=np.ones(count, bool),
        seed=seed,
    )


def _read_table(path: Path) -> pd.DataFrame:
    try:
        return pd.read_csv(io.StringIO(read_text(path, LARGEST_BYTES)))
    except (pd.errors.EmptyDataError, pd.errors.ParserError) as error:
        raise InputError(
            path.as_posix(),
            "table",
            str(error).strip().splitlines()[-1],
            "columns under one header",
        ) from error


def _write_table(path: Path, table: pd.DataFrame) -> None:
    with atomic_write(path) as partial:
        table.to_csv(partial, index=False)
