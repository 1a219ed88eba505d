"""A simulated robot with hidden defects takes the place of a real one: it fills a
measurement sheet and moves to its commands.

With it a calibration can be rehearsed, from the robot file to the corrected robot, before
a tracker is hired.
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
from elastocal.io.atomic_writes import check_places, write_atomically
from elastocal.io.texts import read_text
from elastocal.mechanics.components import WRENCH_NAMES, list_joint_columns
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

# Errors that every robot has which was never calibrated, at each of its joints. Its
# gears and weights differ from its file too.
ERRORS_OF_GEOMETRY = ("joint_offset", "link_geometry")
_COMPENSATORS = ("compensator_stiffness", "compensator_torque")
# This repeatability moves the end of an arm of 2 m by 10 µm.
_JOINT_REPEATABILITY_RAD = 5e-6
# Bounds of an unknown offset of a reflector, and of its unknown rotation.
_MAX_OFFSET_M = 0.1
_MAX_ROTATION_RAD = np.pi / 2
# Columns that identify a state in a measurement sheet.
_STATE = ["pose", "load", "repeat"]
# Length of a milling path over the reach, and number of its poses.
_PATH_SHARE = 0.2
_PATH_POSES = 50
# Postures that are tried until a path stays within the joint limits.
_MAX_POSTURES = 200
# Largest step of a joint along a path; a larger one is a jump to another posture.
_MAX_STEP_RAD = 0.1
# Difference of the seed of a verification from that of its campaign.
_VERIFIED_LATER = 1000
# Relative error of a moment that is rounding.
_MOMENT_ROUNDING = 1e-6


def build_hidden_robot(
    robot_file: str | Path, seed: int, effects: Sequence[str] = ()
) -> tuple[SimulatedRobot, list[Defect]]:
    """Build the simulated robot that takes the place of a real one.

    Parameters
    ----------
    robot_file : path
        Robot file of which the robot is a specimen.
    seed : int
        Seed of its errors.
    effects : sequence of str
        Hidden effects, keys of `KINDS`, each at a joint that is drawn; by default one
        effect that is drawn.

    Returns
    -------
    SimulatedRobot
        The robot.
    list of Defect
        Its defects: errors of geometry, then the hidden effects.

    Raises
    ------
    InputError
        If this arm cannot have one of the effects.
    """
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
    if not effects:
        # The catalogue offers no compensator effect to an arm whose file has no
        # compensator.
        if read_robot(robot_file).compensator is None:
            possible = [name for name in possible if name not in _COMPENSATORS]
        draw = open_simulation_stream(seed, "hidden effect").integers(len(possible))
        effects = (possible[draw],)
    draws = open_simulation_stream(seed, "errors of geometry")
    defects = []
    for name in ERRORS_OF_GEOMETRY:
        kind = KINDS[name]
        for index, joints in enumerate(kind.locations(arm)):
            size = kind.scale_plausible_size(arm) * draws.uniform()
            defects.append(Defect(name, joints, size, seed + 1 + index))
    defects += [draw_defect(name, arm, seed) for name in effects]
    repeatability_rad = (_JOINT_REPEATABILITY_RAD,) * arm.joints
    robot = replace(draw_specimen(arm, seed), repeatability_rad=repeatability_rad)
    return apply_defects(robot, defects), defects


def describe_hidden_effects(defects: Sequence[Defect], effects: Sequence[str]) -> str:
    """Describe the hidden effects of `build_hidden_robot` in words.

    Parameters
    ----------
    defects : sequence of Defect
        All defects of the robot.
    effects : sequence of str
        Hidden effects that were asked for; empty if one was drawn.
    """
    hidden = defects[-max(len(effects), 1) :]
    return join_items(
        f"{name_effect(defect.effect)}{format_joints(defect.effect, defect.joints)}"
        for defect in hidden
    )


def misplace_base(robot: SimulatedRobot, seed: int) -> SimulatedRobot:
    """Return the robot with a tracker whose base frame is wrong by about 0.3 mrad and
    0.2 mm."""
    tracker = replace(robot.tracker, misplaced=draw_misplaced_base(seed))
    return replace(robot, tracker=tracker)


def fill_sheet(
    path: Path, document: Mapping[str, Any], robot: SimulatedRobot, seed: int
) -> int:
    """Fill the measurement sheet at `path` with the measurements of a tracker.

    Parameters
    ----------
    path : path
        Sheet with the columns of measurements.csv; those of the tracker may be missing
        or empty.
    document : mapping
        Contents of campaign.yaml.
    robot : SimulatedRobot
        The robot that is measured.
    seed : int
        Seed of the noise, and of unknown offsets and rotations of reflectors.

    Returns
    -------
    int
        Number of measurements in the sheet.

    Raises
    ------
    InputError
        If a column is missing or has an entry that is no number, if the campaign lacks
        a target, or if a moment is not that of the row's force at a lever.
    """
    check_places(path)
    source = path.as_posix()
    sheet = _read_table(path)
    targets = list(document["targets"])
    angle_names = list_joint_columns(robot.arm.joints)
    require_numbers(sheet, [*_STATE, *angle_names, *WRENCH_NAMES], source)
    if "target" not in sheet:
        raise InputError(source, "columns", "no 'target'", "the target of each row")
    unknown = sheet[~sheet["target"].isin(targets)]
    if len(unknown):
        raise InputError(
            source,
            f"target, line {unknown.index[0] + 2}",
            repr(unknown["target"].iloc[0]),
            ", ".join(targets),
        )
    states = sheet.drop_duplicates(_STATE)
    schedule = _build_schedule(robot.arm, states, seed, source)
    position, rotation = _read_targets(robot, schedule, document, seed)
    rows = (
        pd.MultiIndex.from_frame(states[_STATE]).get_indexer(
            pd.MultiIndex.from_frame(sheet[_STATE])
        ),
        pd.Index(targets).get_indexer(sheet["target"]),
    )
    sheet[["x", "y", "z"]] = position[rows]
    if document["measured"] == "pose":
        sheet[["rx", "ry", "rz"]] = to_rotation_vector(rotation[rows])
    _write_table(path, sheet)
    return len(sheet)


def measure_targets(
    targets: Path,
    output: Path,
    document: Mapping[str, Any],
    robot: SimulatedRobot,
    seed: int,
) -> int:
    """Command the robot to corrected targets, and write what the tracker measures of the
    reflector on its end effector.

    Parameters
    ----------
    targets : path
        Joint targets as `elastocal correct` wrote them.
    output : path
        CSV of the measurements; an existing file is replaced.
    document : mapping
        Contents of campaign.yaml.
    robot : SimulatedRobot
        The robot that is measured.
    seed : int
        Seed of `fill_sheet`, whose reflectors stay where they are. Noise and
        repeatability are new ones.

    Returns
    -------
    int
        Number of measurements.
    """
    check_places(output)
    table = _read_table(targets)
    source = targets.as_posix()
    angle_names = list_joint_columns(robot.arm.joints)
    require_numbers(table, [*angle_names, *WRENCH_NAMES], source)
    states = table[[*angle_names, *WRENCH_NAMES]].assign(
        pose=np.arange(1, len(table) + 1), load=0, repeat=0
    )
    schedule = _build_schedule(robot.arm, states, seed + _VERIFIED_LATER, source)
    position, rotation = _read_targets(robot, schedule, document, seed)
    end = robot.arm.points[-1]
    names = [name for name, at in document["targets"].items() if at["point"] == end]
    column = list(document["targets"]).index(names[0])
    measured = states[["pose", "repeat"]].assign(target=names[0])
    measured[["x", "y", "z"]] = position[:, column]
    if document["measured"] == "pose":
        measured[["rx", "ry", "rz"]] = to_rotation_vector(rotation[:, column])
    _write_table(output, measured)
    return len(measured)


def _read_targets(
    robot: SimulatedRobot,
    schedule: Schedule,
    document: Mapping[str, Any],
    reflector_seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Read all targets of a campaign in each state: positions (S, targets, 3), m, and
    rotations (S, targets, 3, 3), in the campaign's frame. `reflector_seed` is the seed
    of unknown offsets and rotations."""
    points = []
    offsets = []
    rotation_vectors = []
    for name, target in document["targets"].items():
        points.append(robot.arm.points.index(target["point"]))
        draws = open_simulation_stream(reflector_seed, f"reflector {name}")
        offsets.append(_draw_if_unknown(target["offset_m"], _MAX_OFFSET_M, draws))
        mount = target.get("rotation", np.zeros(3))
        draws = open_simulation_stream(reflector_seed, f"mount {name}")
        rotation_vectors.append(_draw_if_unknown(mount, _MAX_ROTATION_RAD, draws))
    position, rotation = simulate_poses(robot, schedule)
    position = (
        position[:, points]
        + (rotation[:, points] @ np.array(offsets)[..., None])[..., 0]
    )
    rotation = rotation[:, points] @ Rotation.from_rotvec(rotation_vectors).as_matrix()
    draws = open_simulation_stream(schedule.seed, "readings")
    position, rotation = robot.tracker.read(position, rotation, draws)
    if document["frame"] == "tracker":
        return robot.tracker.to_tracker_frame(position, rotation)
    return position, rotation


def _draw_if_unknown(
    value: str | Sequence[float], bound: float, draws: np.random.Generator
) -> np.ndarray:
    """Return a vector (3,), drawn within bounds if the campaign calls it unknown."""
    if isinstance(value, str):
        return draws.uniform(-bound, bound, 3)
    return np.array(value, float)


def write_milling_path(
    path: Path, declared: Robot, robot: SimulatedRobot, seed: int
) -> int:
    """Write wanted poses along a milling path, under half the typical force of such a
    robot, and return their number."""
    check_places(path)
    position, rotation, angles = draw_milling_path(
        declared,
        _PATH_SHARE * robot.arm.reach_m,
        _PATH_POSES,
        np.random.default_rng(seed),
    )
    force = get_typical_force_N(robot.arm) / 2
    wrench = np.tile([0.0, 0.0, force, 0.0, 0.0, 0.0], (_PATH_POSES, 1))
    angle_names = list_joint_columns(angles.shape[1])
    names = ["x", "y", "z", "rx", "ry", "rz", *WRENCH_NAMES, *angle_names]
    columns = [position, Rotation.from_matrix(rotation).as_rotvec(), wrench, angles]
    _write_table(path, pd.DataFrame(np.column_stack(columns), columns=names))
    return _PATH_POSES


def measure_errors(
    path: Path, targets: Path, robot: SimulatedRobot, seed: int
) -> dict[str, np.ndarray]:
    """Measure the distances of the robot from wanted poses, in the campaign's base
    frame.

    Parameters
    ----------
    path : path
        Wanted poses.
    targets : path
        Joint targets as `elastocal correct` wrote them for these poses.
    robot : SimulatedRobot
        The robot that is measured.
    seed : int
        Seed of noise and repeatability.

    Returns
    -------
    dict
        Distances (N,), m, of the "uncorrected" and the "corrected" targets, and of
        "noise alone", which an exact model would leave.
    """
    wanted = read_target_path(path, robot.arm.joints)
    table = _read_table(targets)
    source = targets.as_posix()
    if len(table) != len(wanted):
        raise InputError(
            source, "rows", str(len(table)), f"{len(wanted)}, the poses of {path}"
        )
    wrench = wanted.wrench
    if wrench is None:
        wrench = np.zeros((len(wanted), 6))
    errors = {}
    for model, suffix in (("uncorrected", "_uncorrected"), ("corrected", "")):
        columns = [f"{joint}{suffix}" for joint in list_joint_columns(robot.arm.joints)]
        require_numbers(table, columns, source)
        angles = table[columns].to_numpy(float)
        position, rotation = move_robot(robot, angles, wrench, seed, source)
        second_position, _ = move_robot(robot, angles, wrench, seed + 1, source)
        draws = open_simulation_stream(seed, "noise along a path")
        measured, _ = robot.tracker.read(position[:, None], rotation[:, None], draws)
        noise = measured[:, 0] - position
        errors[model] = np.linalg.norm(position + noise - wanted.position, axis=1)
        # The variance of the repeatability is half the mean square of the difference of
        # two visits.
        repeatability = (position - second_position) / np.sqrt(2.0)
        errors["noise alone"] = np.linalg.norm(noise + repeatability, axis=1)
    return errors


def move_robot(
    robot: SimulatedRobot,
    angles: np.ndarray,
    wrench: np.ndarray,
    seed: int,
    source: str = "commands",
) -> tuple[np.ndarray, np.ndarray]:
    """Move the robot, and return where its end effector comes to rest, without noise.

    Parameters
    ----------
    robot : SimulatedRobot
        The robot.
    angles : (N, n) array
        Commanded joint angles as the controller reports them, rad; each command is
        approached afresh.
    wrench : (N, 6) array
        Load at the last measuring point, base axes.
    seed : int
        Seed of the repeatability of the drives.
    source : str
        Origin of the commands, for error messages.

    Returns
    -------
    (N, 3) and (N, 3, 3) arrays
        Positions, m, and rotations in the declared base frame.
    """
    count, joints = angles.shape
    names = [*list_joint_columns(joints), *WRENCH_NAMES]
    states = pd.DataFrame(np.hstack([angles, wrench]), columns=names)
    states = states.assign(pose=np.arange(count), load=0, repeat=0)
    schedule = _build_schedule(robot.arm, states, seed, source)
    position, rotation = simulate_poses(robot, schedule)
    return position[:, -1], rotation[:, -1]


def draw_milling_path(
    robot: Robot, length_m: float, count: int, draws: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw a bent path in a horizontal plane at one orientation, in a posture that stays
    within the joint limits.

    Parameters
    ----------
    robot : Robot
        The declared robot.
    length_m : float
        Length of the path.
    count : int
        Number of poses.
    draws : Generator
        Random numbers.

    Returns
    -------
    (count, 3), (count, 3, 3) and (count, n) arrays
        Positions, m, and rotations, base axes, and reported angles of the rigid robot,
        rad.

    Raises
    ------
    RuntimeError
        If no posture is found.
    """
    low, high = robot.joint_limits.T
    share = np.linspace(-0.5, 0.5, count)[:, None]
    for _ in range(_MAX_POSTURES):
        shares = 0.5 + 0.5 * (draws.random(robot.joints) - 0.5)
        middle = (low + (high - low) * shares)[None]
        heading = draws.uniform(0.0, 2.0 * np.pi)
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        aside = np.array([-np.sin(heading), np.cos(heading), 0.0])
        centre, orientation = compute_nominal_poses(
            robot, robot.reported_angles(middle)
        )
        position = centre + length_m * (share * ahead + share**2 * aside)
        rotation = np.broadcast_to(orientation, (count, 3, 3))
        angles, residual_m = solve_poses(
            robot, position, rotation, np.repeat(middle, count, axis=0)
        )
        if (
            residual_m.max() < SOLVED_M
            and not find_beyond_limits(robot, angles).any()
            and np.abs(np.diff(angles, axis=0)).max() < _MAX_STEP_RAD
        ):
            return position, rotation, robot.reported_angles(angles)
    raise RuntimeError(
        f"{robot.name}: in none of {_MAX_POSTURES} postures does the path lie within"
        " the joint limits"
    )


def require_numbers(table: pd.DataFrame, names: Sequence[str], source: str) -> None:
    """Refuse a table that lacks a column or has an entry that is no number, by an
    `InputError` that names `source` and the line."""
    for name in names:
        if name not in table:
            raise InputError(source, "columns", f"no {name!r}", ", ".join(names))
        wrong = ~np.isfinite(pd.to_numeric(table[name], errors="coerce"))
        if wrong.any():
            row = int(np.argmax(wrong))
            key = f"{name}, line {row + 2}"
            raise InputError(source, key, repr(table[name].iloc[row]), "a number")


def _build_schedule(arm: Arm, states: pd.DataFrame, seed: int, source: str) -> Schedule:
    """Build the schedule of states that are each approached afresh."""
    count = len(states)
    force, moment = np.split(states[list(WRENCH_NAMES)].to_numpy(float), 2, axis=1)
    lever = _find_levers(force, moment, source)
    # Directions of approach that the table does not state are drawn.
    draws = open_simulation_stream(seed, "approaches")
    sense = draws.choice([-1, 1], (count, arm.joints))
    approach_names = list_joint_columns(arm.joints, "approach")
    if set(approach_names) <= set(states):
        stated = states[approach_names].fillna(0).to_numpy(int)
        sense = np.where(stated == 0, sense, stated)
    return Schedule(
        angle=states[list_joint_columns(arm.joints)].to_numpy(float),
        force=force,
        lever=lever,
        **{name: states[name].to_numpy(int) for name in _STATE},
        approach=np.arange(count),
        sense=sense,
        previous=np.full(count, -1),
        time_s=SECONDS_PER_STATE * np.arange(1, count + 1),
        training=np.ones(count, bool),
        seed=seed,
    )


def _find_levers(force: np.ndarray, moment: np.ndarray, source: str) -> np.ndarray:
    """Find the shortest levers (S, 3) at which forces have their moments, and refuse
    moments that no lever gives."""
    square = (force**2).sum(axis=1, keepdims=True)
    lever = np.divide(
        np.cross(force, moment), square, out=np.zeros_like(force), where=square > 0
    )
    error = np.abs(np.cross(lever, force) - moment).max(axis=1)
    wrong = error > _MOMENT_ROUNDING * (1.0 + np.abs(moment).max(axis=1))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            source,
            f"moment of row {row + 1}",
            str(moment[row].tolist()),
            "the moment of the force at a lever",
        )
    return lever


def _read_table(path: Path) -> pd.DataFrame:
    """Read a table, and refuse a file that is none."""
    try:
        return pd.read_csv(io.StringIO(read_text(path, LARGEST_BYTES)))
    except (pd.errors.EmptyDataError, pd.errors.ParserError) as error:
        reason = str(error).strip().splitlines()[-1]
        raise InputError(
            path.as_posix(), "table", reason, "columns under one header"
        ) from error


def _write_table(path: Path, table: pd.DataFrame) -> None:
    with write_atomically(path) as partial:
        table.to_csv(partial, index=False)
