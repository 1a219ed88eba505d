"""What a measured campaign is: its targets, its measurements and what it declares of itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from elastocal.errors import InputError, closest_first
from elastocal.mechanics.chain import Chain
from elastocal.mechanics.robot import Robot, with_rigid_joints

DOCUMENT = "campaign.yaml"
DEFAULT_HOLDOUT = {"fraction": 0.3, "seed": 1}
NO_REMAINDER, BEST_REMAINDER = "none", "auto"
UNKNOWN = "unknown"
NOT_TURNED = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Target:
    """What is tracked.

    `point`: measuring point of the chain on which it sits. `offset_m`: in the frame of the point; None where unknown and
    fitted. `rotation`: rotation vector (rad) of the target's axes in the frame of the point, which orientations have beside
    those of the point; None where unknown and fitted. Left out, it is unknown where the offset is, else none.
    """

    name: str
    point: str
    offset_m: tuple[float, ...] | None
    rotation: tuple[float, ...] | None = ()

    def __post_init__(self) -> None:
        if self.rotation == ():
            object.__setattr__(self, "rotation", None if self.offset_m is None else NOT_TURNED)


@dataclass(frozen=True)
class Measurements:
    """One entry for each measurement of one target; arrays of N.

    `session`, `pose`, `load`, `repeat` (N,): session 0 where the file has no such column; load 0 is unloaded. `target` (N,):
    index into the campaign's targets. `joint_angles` (N, n): the model's, rad, not the controller's: `Robot.model_angles` of
    what it reports. `wrench` (N, 6): external wrench at the origin of the last measuring point, base axes; N, N m. `position`
    (N, 3): m, in the campaign's frame. `rotation_vector` (N, 3): rad; None where positions are measured. `approach` (N, n):
    sense in which each of the model's joints was approached, -1, 0 (not known) or +1. `time_s`, `temperature_c` (N,). `u95_m`
    (N,): expanded uncertainty of the position, 95 % of one coordinate; None where it is not stated for each measurement. `row`
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
        """The measurements of a mask or of an index array, in its order.

        `mask_or_index` (N,) of bool, (M,) of int.
        """
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        chosen: dict[str, Any] = {name: None if array is None else array[mask_or_index] for name, array in arrays.items()}
        return Measurements(**chosen)


@dataclass(frozen=True)
class Campaign:
    """A campaign that holds together.

    `robot`: with rigid joints where `compliance` is nominal and the robot file states none. `measured`: one of "position",
    "pose". `frame`: tracker: the placement of the base in it is unknown, and another one in each session. `compliance`: one of
    "nominal", "identify". `declared`: effects of the catalogue that the model already has. `noise`: ``position_m``,
    ``orientation_rad``, ``joint_rad``, as far as the campaign declares them. `holdout`: ``fraction`` and ``seed``, ``blocks``
    and ``seed``, ``session``, ``poses`` or ``campaign``. `remainder`: regression on what the final model leaves: a name in
    `remainder.corrected`, "auto" for the best of them or none, or "none". `table`: name of the file of measurements; empty
    where they come from none. `header_line`: line of the file in which its header stands, where it is a text whose rows are
    lines.
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
        """Where a row of the measurements stands, in words: by its line where it has one."""
        line = f"row {row}" if self.header_line is None else f"line {row + self.header_line}"
        return f"{line} of {self.table}" if self.table else line


def assemble_campaign(document: Mapping[str, Any], robot: Robot, measurements: Measurements, source: str) -> Campaign:
    """A campaign from its parts, which have been checked before.

    Nominal compliances that the robot file does not state leave rigid joints.

    `document`: contents of ``campaign.yaml``. `source`: named in errors.
    """
    compliance = document.get("compliance", "nominal")
    remainder = document.get("remainder", BEST_REMAINDER)
    rigid = compliance == "nominal" and not robot.compliance_known
    return Campaign(
        name=document["campaign"],
        robot=with_rigid_joints(robot) if rigid else robot,
        measured=document["measured"],
        frame=document["frame"],
        targets=targets_from(document["targets"], robot.chain, source),
        compliance=compliance,
        declared=tuple(document.get("declared", ())),
        noise=document.get("noise"),
        holdout=document.get("holdout", DEFAULT_HOLDOUT),
        measurements=measurements,
        remainder=remainder,
        table=document.get("table", ""),
        header_line=document.get("header_line"),
    )


def targets_from(described: Mapping[str, Any], chain: Chain, source: str) -> tuple[Target, ...]:
    """What a campaign says that it tracks.

    `described`: ``targets`` of ``campaign.yaml``. `source`: named in errors. Raises `InputError`: a name that is no text, or a
    measuring point that the chain does not have.
    """
    points = [point.name for point in chain.points]
    targets = []
    for name, target in described.items():
        if not isinstance(name, str):
            allowed = "a name, in quotes where need be"
            raise InputError(source, "targets", f"the name {name!r}, which YAML takes for no text", allowed)
        if target["point"] not in points:
            allowed = f"a measuring point of the chain: {closest_first(target['point'], points)}"
            raise InputError(source, f"targets.{name}.point", repr(target["point"]), allowed)
        stated = (target["offset_m"], target.get("rotation", ()))
        targets.append(
            Target(name, target["point"], *(None if value == UNKNOWN else tuple(map(float, value)) for value in stated))
        )
    return tuple(targets)
