"""A measured campaign: its targets, its measurements, what it declares, and the columns
of tables in which the measurements are stored."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from elastocal.errors import InputError, suggest_names
from elastocal.measuring.channels import MeasuringPlan, parse_measuring
from elastocal.mechanics.chain import Chain
from elastocal.mechanics.components import (
    COMPONENT_NAMES,
    WRENCH_NAMES,
    list_joint_columns,
)
from elastocal.mechanics.robot import Robot

DOCUMENT = "campaign.yaml"
# Robot file in the folder of a campaign whose robot is not one of the project's.
ROBOT_FILE = "robot.yaml"
# Effects that a campaign of an uncalibrated robot declares: no such data can be fitted
# without them.
GEOMETRY = ("joint_offset", "link_geometry")
DEFAULT_HOLDOUT = {"fraction": 0.3, "seed": 1}
# Values of ``remainder``: no residual model, or the one with the best validation error.
NO_REMAINDER = "none"
BEST_REMAINDER = "auto"
UNKNOWN = "unknown"
NO_ROTATION = (0.0, 0.0, 0.0)
# Standard deviation of each coordinate of a declared offset that states none, m: a
# caliper on a bracket, or a drawing of the tool.
OFFSET_STD_M = 2e-4
# Standard deviation of each coordinate of the point at which a load acts, if a campaign
# states none, m: a hook or a weight is located with a rule and has play where it hangs.
APPLICATION_POINT_STD_M = 1e-3


@dataclass(frozen=True)
class Target:
    """A point of the robot that is tracked.

    Attributes
    ----------
    name : name of the target.
    point : measuring point of the chain on which the target sits.
    offset_m : position in the frame of the point; None if unknown and fitted.
    offset_std_m : standard deviation of each coordinate of a declared offset, which is
        fitted with this prior; 0 if the offset is exact by definition.
    rotation : rotation vector (rad) from the frame of the point to the axes of the
        target, to which measured orientations refer; None if unknown and fitted. If it
        is left out, it is unknown if the offset is, else zero.
    """

    name: str
    point: str
    offset_m: tuple[float, ...] | None
    rotation: tuple[float, ...] | None = ()
    offset_std_m: float = 0.0

    @property
    def has_inexact_offset(self) -> bool:
        """Whether the offset is declared, but not exact."""
        return self.offset_m is not None and self.offset_std_m > 0.0

    def __post_init__(self) -> None:
        if self.rotation == ():
            rotation = None if self.offset_m is None else NO_ROTATION
            object.__setattr__(self, "rotation", rotation)


@dataclass(frozen=True)
class Measurements:
    """N measurements, each of one target.

    Attributes
    ----------
    session, pose, load, repeat : (N,) int arrays; session 0 if the file has no such
        column; load 0 is unloaded.
    target : (N,) int array, index into the campaign's targets.
    joint_angles : (N, n) angles of the model's joints, rad: `Robot.model_angles` of
        the angles that the controller reports.
    wrench : (N, 6) external wrench at the origin of the last measuring point, base
        axes; N, N m.
    position : (N, 3) m, in the campaign's frame.
    rotation_vector : (N, 3) rad; None if positions are measured.
    approach : (N, n) direction from which each of the model's joints was approached,
        -1, 0 (unknown) or +1.
    time_s, temperature_c : (N,).
    row : (N,) int array, row in the file, 1 for the first row of data; for messages.
    u95_m : (N,) expanded uncertainty of the position, 95 % of one coordinate; None if
        the file does not state it.
    channel : (N,) int array, index into the channels of the campaign's measuring plan;
        None if it has none. If it has some, `position` (N, 1) or (N, 3) and
        `rotation_vector` hold the numbers of the rows.
    spread : (N,) standard deviation of each measurement over that of the campaign's
        noise; None if they are alike.
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
    channel: np.ndarray | None = None
    spread: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.pose)

    def select(self, mask_or_index: np.ndarray) -> Measurements:
        """Return the measurements of a bool mask (N,), or of an index array (M,) in its
        order."""
        selected: dict[str, Any] = {
            name: None if array is None else array[mask_or_index]
            for name, array in vars(self).items()
        }
        return Measurements(**selected)


def join_measurements(first: Measurements, second: Measurements) -> Measurements:
    """Join the measurements of one campaign, one after the other."""
    joined: dict[str, Any] = {
        name: None if array is None else np.concatenate([array, getattr(second, name)])
        for name, array in vars(first).items()
    }
    return Measurements(**joined)


@dataclass(frozen=True)
class Campaign:
    """A campaign that was checked as a whole; the schema of ``campaign.yaml`` explains
    its keys.

    Attributes
    ----------
    name : name of the campaign.
    robot : nominal robot; its joints are rigid if `compliance` is nominal and the robot
        file states none.
    measuring : kinds, features and channels of the measurements.
    frame : "base", or "tracker": the placement of the base is unknown, and different in
        each session.
    targets : tracked points of the robot.
    compliance : "nominal" or "identify".
    declared : effects that the declared model has.
    noise : declared noise, if any.
    holdout : rule that selects the held-out poses.
    measurements : the measurements.
    application_point_std_m : standard deviation of each coordinate of the point at which
        the load acts, in flange axes; 0 if the point is exact by definition.
    base_std_m : standard deviation of each coordinate of a declared base in each session;
        0 if the base is exact by definition, or unknown.
    remainder : residual model, a name in `residual_model.regressions`, "auto" or "none".
    table : name of the file of measurements; empty if there is none.
    header_line : line of the header if the file is text.
    """

    name: str
    robot: Robot
    measuring: MeasuringPlan
    frame: str
    targets: tuple[Target, ...]
    compliance: str
    declared: tuple[str, ...]
    noise: dict[str, Any] | None
    holdout: dict[str, Any]
    measurements: Measurements
    remainder: str = NO_REMAINDER
    application_point_std_m: float = 0.0
    base_std_m: float = 0.0
    table: str = ""
    header_line: int | None = None

    @property
    def measures_poses(self) -> bool:
        """Whether a measurement is a pose: a position and an orientation."""
        return self.measuring.rows == 6

    def locate_row(self, row: int) -> str:
        """Return where a row of the measurements is, by its line if the file is text."""
        location = f"row {row}"
        if self.header_line is not None:
            location = f"line {row + self.header_line}"
        return f"{location} of {self.table}" if self.table else location


def assemble_campaign(
    document: Mapping[str, Any], robot: Robot, measurements: Measurements, source: str
) -> Campaign:
    """Return a campaign made of parts that were checked before.

    Parameters
    ----------
    document : contents of ``campaign.yaml``; may also have ``table`` and
        ``header_line`` of `Campaign`.
    robot : robot as its file describes it.
    measurements : the measurements.
    source : file of the document, for messages.
    """
    plan = parse_measuring(document, source)
    compliance = document.get("compliance", "nominal")
    if compliance == "nominal" and not robot.compliance_known:
        # Without known compliances the joints are rigid, and masses have no effect.
        robot = replace(robot, compliance=np.zeros(robot.joints), masses=())
    return Campaign(
        name=document["campaign"],
        robot=robot,
        measuring=plan,
        frame="base" if document["frame"] == "base" else "tracker",
        targets=parse_targets(document["targets"], robot.chain, source),
        compliance=compliance,
        declared=tuple(document.get("declared", ())),
        noise=complete_noise(document.get("noise"), plan),
        holdout=document.get("holdout", DEFAULT_HOLDOUT),
        measurements=measurements,
        remainder=document.get("remainder", BEST_REMAINDER),
        application_point_std_m=float(
            document.get("application_point_std_m", APPLICATION_POINT_STD_M)
        ),
        base_std_m=float(document.get("base_std_m", 0.0)),
        table=document.get("table", ""),
        header_line=document.get("header_line"),
    )


def complete_noise(
    noise: Mapping[str, Any] | None, plan: MeasuringPlan
) -> dict[str, Any] | None:
    """Complete declared noise: if positions have none, that of the first kind stands for
    all, and the spread of the other kinds refers to it."""
    if noise is None:
        return None
    by_kind = noise.get("by_kind", {})
    first = plan.kinds[0].name
    if "position_m" in noise or first not in by_kind:
        return {**noise}
    return {"position_m": by_kind[first], **noise}


def parse_targets(
    described: Mapping[str, Any], chain: Chain, source: str
) -> tuple[Target, ...]:
    """Return the targets of a campaign.

    Parameters
    ----------
    described : ``targets`` of ``campaign.yaml``.
    chain : chain with the measuring points.
    source : file, for messages.

    Raises
    ------
    InputError
        If a name is not text or a measuring point is unknown.
    """
    points = [point.name for point in chain.points]
    targets = []
    for name, target in described.items():
        if not isinstance(name, str):
            finding = f"the name {name!r}, which YAML does not read as text"
            raise InputError(
                source, "targets", finding, "a name, in quotes if necessary"
            )
        point = target["point"]
        if point not in points:
            allowed = f"a measuring point of the chain: {suggest_names(point, points)}"
            raise InputError(source, f"targets.{name}.point", repr(point), allowed)
        offset_m = _parse_vector(target["offset_m"])
        rotation = _parse_vector(target.get("rotation", ()))
        offset_std_m = 0.0
        if offset_m is not None:
            offset_std_m = float(target.get("offset_std_m", OFFSET_STD_M))
        targets.append(Target(name, point, offset_m, rotation, offset_std_m))
    return tuple(targets)


def _parse_vector(stated: str | Sequence[float]) -> tuple[float, ...] | None:
    return None if stated == UNKNOWN else tuple(map(float, stated))


_IDENTITY = ("session", "pose", "load", "repeat", "target", "row")


def _columns_by_field(joints: int) -> dict[str, Sequence[str]]:
    """Return the columns of the measurements table that hold each field of
    `Measurements`."""
    columns: dict[str, Sequence[str]] = {name: (name,) for name in _IDENTITY}
    return columns | {
        "joint_angles": list_joint_columns(joints),
        "wrench": WRENCH_NAMES,
        "position": "xyz",
        "rotation_vector": ("rx", "ry", "rz"),
        "approach": list_joint_columns(joints, "approach"),
        "time_s": ("time_s",),
        "temperature_c": ("temperature_c",),
        "u95_m": ("u95_m",),
        "channel": ("channel",),
        "spread": ("spread",),
    }


def tabulate_measurements(
    measurements: Measurements, fields: Collection[str] = ()
) -> dict[str, np.ndarray]:
    """Return columns (N,) of the measurements table; a field that is None becomes NaN.

    Parameters
    ----------
    measurements : N measurements.
    fields : fields of `Measurements`; all if empty.
    """
    count, joints = measurements.joint_angles.shape
    columns: dict[str, np.ndarray] = {}
    for field, names in _columns_by_field(joints).items():
        if fields and field not in fields:
            continue
        values = getattr(measurements, field)
        if values is None:
            values = np.full((count, len(names)), np.nan)
        values = values.reshape(count, -1)
        if values.shape[1] < len(names):
            # A measurement of one number has no further coordinates.
            missing = len(names) - values.shape[1]
            values = np.pad(values, ((0, 0), (0, missing)), constant_values=np.nan)
        columns |= dict(zip(names, values.T, strict=True))
    return columns


def build_measurements(columns: Mapping[str, np.ndarray]) -> Measurements:
    """Return the measurements of the columns (N,) of their table, as
    `tabulate_measurements` makes them."""
    joints = sum(name.startswith("approach") for name in columns)
    fields: dict[str, Any] = {}
    for field, names in _columns_by_field(joints).items():
        if field in columns:
            values = columns[field]
        else:
            values = np.column_stack([columns[name] for name in names])
        is_empty = values.dtype.kind == "f" and np.isnan(values).all()
        fields[field] = None if is_empty else values
    if fields["channel"] is not None:
        has_one_number = np.isnan(fields["position"][:, 1]).all()
        fields["position"] = fields["position"][:, : 1 if has_one_number else 3]
        fields["channel"] = fields["channel"].astype(int)
    return Measurements(**fields)


def tabulate_residuals(
    measurements: Measurements,
    outside: np.ndarray,
    position: np.ndarray,
    stages: Mapping[str, np.ndarray],
    *,
    held_out: bool,
    gross_errors: bool,
) -> dict[str, np.ndarray]:
    """Return columns (N,) of the residuals table.

    Parameters
    ----------
    measurements : N measurements.
    outside : (N,) bool array, whether each is outside the range of the fitted poses.
    position : (N, 3) m, base axes.
    stages : (N, rows) residuals "before", of the robot as its file has it, and "after", of
        the final model; m and rad.
    held_out : whether the measurements are held out.
    gross_errors : whether they are gross errors.
    """
    count = len(measurements)
    columns = tabulate_measurements(measurements, _IDENTITY)
    columns |= {
        "held_out": np.full(count, held_out),
        "gross_error": np.full(count, gross_errors),
        "outside_range": outside,
    }
    columns |= tabulate_measurements(measurements, ("time_s",))
    columns |= tabulate_measurements(measurements, ("joint_angles", "wrench"))
    columns |= dict(zip("xyz", position.T, strict=True))
    for stage, residual in stages.items():
        components = np.full((count, 6), np.nan)
        components[:, : residual.shape[1]] = residual
        for component, name in enumerate(COMPONENT_NAMES):
            columns[f"{stage}_{name}"] = components[:, component]
    return columns


def group_equal_rows(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Group equal rows: `numpy.unique` along the first axis, but many times as fast.

    Parameters
    ----------
    keys : (N, k) array.

    Returns
    -------
    first : (G,) int array, first row of each group; groups in lexicographic order.
    group : (N,) int array, group of each row.
    """
    order = np.argsort(keys[:, 0], kind="stable")
    if not np.diff(keys[order, 0]).all():
        # The first column does not decide the order.
        order = np.lexsort(keys.T[::-1])
    sorted_keys = keys[order]
    starts_group = np.ones(len(keys), bool)
    starts_group[1:] = (sorted_keys[1:] != sorted_keys[:-1]).any(axis=1)
    group = np.empty(len(keys), int)
    group[order] = np.cumsum(starts_group) - 1
    return order[starts_group], group


def average_by_group(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Return the mean of the values (N, ...) of each group (N,), 0 .. G-1: (G, ...)."""
    columns = values.reshape(len(values), math.prod(values.shape[1:])).T
    total = np.column_stack([np.bincount(group, column) for column in columns])
    return (total / np.bincount(group)[:, None]).reshape(-1, *values.shape[1:])
