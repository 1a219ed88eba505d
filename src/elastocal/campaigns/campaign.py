"""What a measured campaign is: its targets, its measurements and what it declares of
itself, also as columns of tables."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from elastocal.errors import InputError, suggest_names
from elastocal.mechanics.chain import Chain
from elastocal.mechanics.components import COMPONENT_NAMES, WRENCH_NAMES
from elastocal.mechanics.robot import Robot

DOCUMENT = "campaign.yaml"
DEFAULT_HOLDOUT = {"fraction": 0.3, "seed": 1}
NO_REMAINDER = "none"
BEST_REMAINDER = "auto"
UNKNOWN = "unknown"
NO_ROTATION = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Target:
    """What is tracked.

    `point`: measuring point of the chain on which it sits. `offset_m`: in the frame of
    the point; None where unknown and fitted. `rotation`: rotation vector (rad) of the
    target's axes in the frame of the point, which orientations have beside those of the
    point; None where unknown and fitted. Left out, it is unknown where the offset is,
    else none.
    """

    name: str
    point: str
    offset_m: tuple[float, ...] | None
    rotation: tuple[float, ...] | None = ()

    def __post_init__(self) -> None:
        if self.rotation == ():
            object.__setattr__(
                self, "rotation", None if self.offset_m is None else NO_ROTATION
            )


@dataclass(frozen=True)
class Measurements:
    """One entry for each measurement of one target; arrays of N.

    `session`, `pose`, `load`, `repeat` (N,): session 0 where the file has no such
    column; load 0 is unloaded. `target` (N,): index into the campaign's targets.
    `joint_angles` (N, n): the model's, rad, not the controller's: `Robot.model_angles`
    of what it reports. `wrench` (N, 6): external wrench at the origin of the last
    measuring point, base axes; N, N m. `position` (N, 3): m, in the campaign's frame.
    `rotation_vector` (N, 3): rad; None where positions are measured. `approach` (N, n):
    sense in which each of the model's joints was approached, -1, 0 (not known) or +1.
    `time_s`, `temperature_c` (N,). `u95_m` (N,): expanded uncertainty of the position,
    95 % of one coordinate; None where it is not stated for each measurement. `row`
    (N,): row in the file, 1 for the first of data; for messages.
    """

    session: np.ndarray
    pose: np.ndarray
    load: np.ndarray
    repeat: np.ndarray
    target: np.ndarray
    joint_angles: np.ndarray
    wrench: np.ndarray
    position: np.ndarray
    rotation_vector: np.ndarray | None
    approach: np.ndarray | None
    time_s: np.ndarray | None
    temperature_c: np.ndarray | None
    row: np.ndarray
    u95_m: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.pose)

    def select(self, mask_or_index: np.ndarray) -> Measurements:
        """The measurements of a mask (N,) or of an index array (M,), in its order."""
        arrays = vars(self).items()
        chosen: dict[str, Any] = {
            name: None if array is None else array[mask_or_index]
            for name, array in arrays
        }
        return Measurements(**chosen)


@dataclass(frozen=True)
class Campaign:
    """A campaign that holds together; its schema explains what it declares.

    `robot`: with rigid joints where `compliance` is nominal and the robot file states
    none. `frame`: of a tracker: the placement of the base in it is unknown, and another
    one in each session. `remainder`: regression on what the final model leaves, a name
    in `remainder.corrected`, "auto" or "none". `table`, `header_line`: name of the file
    of measurements, empty for none, and the line of its header, where it is a text.
    """

    name: str
    robot: Robot
    measured: str
    frame: str
    targets: tuple[Target, ...]
    compliance: str
    declared: tuple[str, ...]
    noise: dict[str, Any] | None
    holdout: dict[str, Any]
    measurements: Measurements
    remainder: str = NO_REMAINDER
    table: str = ""
    header_line: int | None = None

    def place_of(self, row: int) -> str:
        """Where a row of the measurements stands, in words: by its line where it has
        one."""
        line = (
            f"row {row}"
            if self.header_line is None
            else f"line {row + self.header_line}"
        )
        return f"{line} of {self.table}" if self.table else line


def assemble_campaign(
    document: Mapping[str, Any], robot: Robot, measurements: Measurements, source: str
) -> Campaign:
    """A campaign from its parts, checked before; `source`, the file of its document, is
    named in errors."""
    compliance = document.get("compliance", "nominal")
    rigid = compliance == "nominal" and not robot.compliance_known
    return Campaign(
        name=document["campaign"],
        # What is left without known compliances: joints that do not yield, which no
        # mass turns.
        robot=replace(robot, compliance=np.zeros(robot.joints), masses=())
        if rigid
        else robot,
        measured=document["measured"],
        frame=document["frame"],
        targets=parse_targets(document["targets"], robot.chain, source),
        compliance=compliance,
        declared=tuple(document.get("declared", ())),
        noise=document.get("noise"),
        holdout=document.get("holdout", DEFAULT_HOLDOUT),
        measurements=measurements,
        remainder=document.get("remainder", BEST_REMAINDER),
        table=document.get("table", ""),
        header_line=document.get("header_line"),
    )


def parse_targets(
    described: Mapping[str, Any], chain: Chain, source: str
) -> tuple[Target, ...]:
    """``targets`` of ``campaign.yaml``, which `source`, named in errors, describes; an
    unknown measuring point is refused."""
    points = [point.name for point in chain.points]
    targets = []
    for name, target in described.items():
        if not isinstance(name, str):
            allowed = "a name, in quotes where need be"
            raise InputError(
                source,
                "targets",
                f"the name {name!r}, which YAML takes for no text",
                allowed,
            )
        if target["point"] not in points:
            allowed = f"a measuring point of the chain: {suggest_names(target['point'], points)}"
            raise InputError(
                source, f"targets.{name}.point", repr(target["point"]), allowed
            )
        stated = (target["offset_m"], target.get("rotation", ()))
        targets.append(
            Target(
                name,
                target["point"],
                *(
                    None if value == UNKNOWN else tuple(map(float, value))
                    for value in stated
                ),
            )
        )
    return tuple(targets)


_IDENTITY = ("session", "pose", "load", "repeat", "target", "row")


def _columns_by_part(joints: int) -> dict[str, Sequence[str]]:
    """Columns of the measurements table by the part of `Measurements` that they
    hold."""
    angles, approach = (
        [f"{letter}{j}" for j in range(1, joints + 1)] for letter in ("q", "approach")
    )
    parts = {name: (name,) for name in _IDENTITY} | {
        "joint_angles": angles,
        "wrench": WRENCH_NAMES,
        "position": "xyz",
    }
    parts |= {"rotation_vector": ("rx", "ry", "rz"), "approach": approach}
    return parts | {name: (name,) for name in ("time_s", "temperature_c", "u95_m")}


def tabulate_measurements(
    measurements: Measurements, parts: Collection[str] = ()
) -> dict[str, np.ndarray]:
    """Columns of the measurements table, dict of str to ndarray (N,); of some parts
    alone where they are named."""
    count, joints = measurements.joint_angles.shape
    columns: dict[str, np.ndarray] = {}
    for part, names in _columns_by_part(joints).items():
        values = getattr(measurements, part)
        if not parts or part in parts:
            whole = (
                np.full((count, len(names)), np.nan)
                if values is None
                else values.reshape(count, len(names))
            )
            columns |= dict(zip(names, whole.T, strict=True))
    return columns


def build_measurements(columns: Mapping[str, np.ndarray]) -> Measurements:
    """Measurements from the columns of their table, dict of str to ndarray (N,)."""
    found: dict[str, Any] = {}
    for part, names in _columns_by_part(
        sum(name.startswith("approach") for name in columns)
    ).items():
        whole = (
            columns[part]
            if part in columns
            else np.column_stack([columns[name] for name in names])
        )
        found[part] = (
            None if whole.dtype.kind == "f" and np.isnan(whole).all() else whole
        )
    return Measurements(**found)


def tabulate_residuals(
    measurements: Measurements,
    held_out: bool,
    gross_errors: bool,
    outside: np.ndarray,
    position: np.ndarray,
    stages: Mapping[str, np.ndarray],
) -> dict[str, np.ndarray]:
    """Columns of the residuals table.

    `outside` (N,) of bool: whether each lies outside of the range of the poses fitted.
    `position` (N, 3): m, base axes. `stages` (N, rows): residuals "before", of the
    declared model, and "after", of the found one, m and rad. Returns (N,).
    """
    count = len(measurements)
    columns = tabulate_measurements(measurements, _IDENTITY)
    columns |= {
        "held_out": np.full(count, held_out),
        "gross_error": np.full(count, gross_errors),
        "outside_range": outside,
    }
    columns |= tabulate_measurements(measurements, ("time_s",)) | tabulate_measurements(
        measurements, ("joint_angles", "wrench")
    )
    columns |= dict(zip("xyz", position.T, strict=True))
    for stage, residual in stages.items():
        whole = np.full((count, 6), np.nan)
        whole[:, : residual.shape[1]] = residual
        columns |= {
            f"{stage}_{name}": whole[:, k] for k, name in enumerate(COMPONENT_NAMES)
        }
    return columns


def group_equal_rows(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Group equal rows: `numpy.unique` along the first axis, many times as fast.

    `keys` (N, k). Returns `first` (G,) of int: first row of each group; groups in
    lexicographic order; `group` (N,) of int: of each row.
    """
    order = np.argsort(keys[:, 0], kind="stable")
    order = order if np.diff(keys[order, 0]).all() else np.lexsort(keys.T[::-1])
    rising = keys[order]
    new = np.concatenate(
        [np.ones(min(len(keys), 1), bool), (rising[1:] != rising[:-1]).any(axis=1)]
    )
    group = np.empty(len(keys), int)
    group[order] = np.cumsum(new) - 1
    return order[new], group


def average_by_group(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Mean of the values (N, ...) of each group (N,), 0 .. G-1, ndarray (G, ...)."""
    columns = values.reshape(len(values), math.prod(values.shape[1:])).T
    total = np.column_stack([np.bincount(group, column) for column in columns])
    return (total / np.bincount(group)[:, None]).reshape(-1, *values.shape[1:])
