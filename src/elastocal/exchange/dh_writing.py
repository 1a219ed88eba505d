"""A chain as Denavit-Hartenberg parameters, and by how much a calibrated one differs from the nominal one.

Rows are of the standard notation, ``Rz(theta) Tz(d) Tx(a) Rx(alpha)``, from the base's z axis over each joint axis to that of
the end effector. Where two axes are nominally parallel, their common normal jumps with the smallest error, so that d is fixed
and the row ends in ``Ty(b) Ry(beta)`` instead, after Hayati [1]; b is 0 but where the axes nominally coincide, where theta is
fixed and a and b are the offset. All parameters then change as little as the robot does.

[1] Hayati, S. A., Robot arm geometric link parameter estimation, IEEE Conference on Decision and Control, 1983.
"""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
import pandas as pd

from elastocal.errors import InputError
from elastocal.exchange.fixed_transforms import elementary
from elastocal.mechanics.robot import Robot

# Axes within this angle are parallel, and lines within this distance are one: what decimals of a robot file leave.
_PARALLEL_RAD, _TOGETHER_M = 1e-6, 1e-7
PARAMETERS = ("theta_deg", "d_m", "a_m", "alpha_deg", "b_m", "beta_deg")
_ANGLES = ("theta_deg", "alpha_deg", "beta_deg")


@dataclass(frozen=True)
class Row:
    """Parameters of one row, rad and m."""

    theta: float
    d: float
    a: float
    alpha: float
    b: float = 0.0
    beta: float = 0.0


@dataclass(frozen=True)
class _Kind:
    """How a pair of axes is described: that of the nominal robot serves the calibrated one."""

    parallel: bool
    together: bool
    normal: np.ndarray
    theta: float


def dh_rows(robot: Robot) -> list[Row]:
    """Rows of a robot: of its base, of each joint, and of the end effector's frame.

    Returns n + 2 of them. Angles of joints are the controller's where it counts each joint by itself, else those of the chain.
    Raises `InputError`: prismatic or passive joints.
    """
    return _describe(robot, None, robot.counts_each_joint)[0]


def dh_frames(robot: Robot) -> np.ndarray:
    """Frames of the rows in base axes where the controller reports zero, ndarray (n + 2, 4, 4): F_0 before joint 1 first."""
    frames, here = [], np.eye(4)
    for row in dh_rows(robot):
        here = here @ _transform(row)
        frames.append(here)
    return np.array(frames)


def dh_table(robot: Robot, nominal: Robot | None = None) -> pd.DataFrame:
    """Rows as `elastocal import dh` reads them: ``Ty(b) Ry(beta)`` becomes a fixed row of its own.

    `nominal`: by which each pair of axes is described, see `dh_deltas`; the robot itself without. Returns of the angles that
    the controller reports, where for both it counts each joint by itself.
    """
    rows: list[dict[str, Any]] = []
    turned, like = 0.0, nominal or robot
    end = robot.chain.end_effector.name
    for number, row in enumerate(_rows(robot, like, robot.counts_each_joint and like.counts_each_joint)):
        joint = 1 <= number <= robot.joints
        rows.append(_write_row("R" if joint else "F", number if joint else None, (row.theta - turned, row.d, row.a, row.alpha)))
        turned = 0.0
        if row.b or row.beta:
            # Ry is Rx between quarter turns, of which the next row takes back the second.
            turned = 0.5 * math.pi
            rows.append(_write_row("F", None, (turned, 0.0, row.b, row.beta)))
    if turned:
        rows.append(_write_row("F", None, (-turned, 0.0, 0.0, 0.0)))
    rows[-1]["point"] = end
    return pd.DataFrame(rows)


def dh_deltas(nominal: Robot, calibrated: Robot) -> pd.DataFrame:
    """Parameters of both robots row by row, and their differences.

    Returns ``row`` (base, q1 .. qn, end effector), the calibrated `PARAMETERS`, then ``delta_..``: calibrated minus nominal.
    """
    names = ["base", *(f"q{joint}" for joint in range(1, nominal.joints + 1)), nominal.chain.end_effector.name]
    own = nominal.counts_each_joint and calibrated.counts_each_joint
    found = [np.array([astuple(row) for row in _rows(robot, nominal, own)]) for robot in (nominal, calibrated)]
    turns = np.isin(PARAMETERS, _ANGLES)
    delta = found[1] - found[0]
    delta[:, turns] = np.degrees((delta[:, turns] + math.pi) % (2.0 * math.pi) - math.pi)
    values = np.where(turns, np.degrees(found[1]), found[1])
    table = pd.DataFrame(values + 0.0, columns=list(PARAMETERS))
    return pd.concat(
        [pd.Series(names, name="row"), table, pd.DataFrame(delta + 0.0, columns=[f"delta_{p}" for p in PARAMETERS])], axis=1
    )


def _write_row(kind: str, joint: int | None, values: Sequence[float]) -> dict[str, Any]:
    theta, d, a, alpha = values
    head = {"joint": f"{joint or ''}", "type": kind, "theta_offset_deg": math.degrees(theta)}
    return head | {"d_m": d, "a_m": a, "alpha_deg": math.degrees(alpha), "point": ""}


def _rows(robot: Robot, nominal: Robot, own: bool) -> list[Row]:
    """Rows of a robot in the description of another one."""
    return _describe(robot, _describe(nominal, None, own)[1], own)[0]


def _describe(robot: Robot, kinds: Sequence[_Kind] | None, own: bool) -> tuple[list[Row], list[_Kind]]:
    """Rows, and how each pair of axes was described."""
    points, directions, end = _axes(robot, own)
    here, rows, used = np.eye(4), [], []
    for number, (point, direction) in enumerate(zip(points, directions, strict=True)):
        inverse = np.linalg.inv(here)
        local, axis = inverse[:3, :3] @ point + inverse[:3, 3], inverse[:3, :3] @ direction
        kind = kinds[number] if kinds else _kind(local, axis)
        row = _parallel(local, axis, kind) if kind.parallel else _skew(local, axis, kind)
        rows.append(row)
        used.append(kind)
        here = here @ _transform(row)
    # What is left to the end effector's own frame turns and shifts along the last axis.
    left = np.linalg.inv(here) @ end
    rows.append(Row(math.atan2(left[1, 0], left[0, 0]), float(left[2, 3]), 0.0, 0.0))
    return rows, used


def _axes(robot: Robot, own: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points on and directions of the joint axes and of the end effector's z axis, and its frame, where nothing is turned."""
    chain = robot.chain
    if any(chain.prismatic) or any(chain.is_passive(place) for place in range(len(chain.transforms))):
        raise InputError(robot.name, "chain", "prismatic or passive joints", "a chain of revolute joints, for a DH table")
    sense = np.diag(robot.reported_matrix) if own else np.ones(robot.joints)
    zero = robot.reported_offset if own else np.zeros(robot.joints)
    here, points, directions = np.eye(4), [], []
    for place in range(chain.end_effector.after):
        transform = chain.transforms[place]
        value = transform.constant
        if transform.coordinate is not None:
            value = transform.sign * zero[transform.coordinate]
            points.append(here[:3, 3].copy())
            directions.append(np.sign(transform.sign * sense[transform.coordinate]) * here[:3, transform.axis])
        here = here @ elementary(transform.kind, transform.axis, value)
    here = here.copy()
    here[:3, 3] += here[:3, :3] @ np.array(chain.end_effector.offset_m)
    return np.array([*points, here[:3, 3]]), np.array([*directions, here[:3, 2]]), here


def _kind(point: np.ndarray, axis: np.ndarray) -> _Kind:
    """How the next axis lies to the z axis of a frame, by a point on it and its direction there."""
    if math.hypot(axis[0], axis[1]) < _PARALLEL_RAD:
        off = point - axis * point[2] / axis[2]
        together = math.hypot(off[0], off[1]) < _TOGETHER_M
        return _Kind(True, together, np.zeros(3), 0.0 if together else math.atan2(off[1], off[0]))
    normal = np.array([-axis[1], axis[0], 0.0]) / math.hypot(axis[0], axis[1])
    # The normal points from one axis to the next; of axes that meet, so that theta is small.
    apart = float(normal @ point)
    if apart < -_TOGETHER_M or (abs(apart) <= _TOGETHER_M and (normal[0], normal[1]) < (-1e-9, 0.0)):
        normal = -normal
    return _Kind(False, False, normal, math.atan2(normal[1], normal[0]))


def _skew(point: np.ndarray, axis: np.ndarray, kind: _Kind) -> Row:
    """Row by the common normal of two axes."""
    normal = np.array([-axis[1], axis[0], 0.0]) / math.hypot(axis[0], axis[1])
    normal = normal * (1.0 if normal @ kind.normal >= 0.0 else -1.0)
    a = float(normal @ point)
    # Foot on the z axis: where the next axis comes closest to it.
    along = (axis[0] * point[0] + axis[1] * point[1]) / (axis[0] ** 2 + axis[1] ** 2)
    d = float(point[2] - along * axis[2])
    alpha = math.atan2(float(np.cross(np.array([0.0, 0.0, 1.0]), axis) @ normal), float(axis[2]))
    return Row(math.atan2(normal[1], normal[0]), d, a, alpha)


def _parallel(point: np.ndarray, axis: np.ndarray, kind: _Kind) -> Row:
    """Row of Hayati for axes that are nominally parallel: d is 0."""
    met = point - axis * point[2] / axis[2]
    theta = kind.theta if kind.together else math.atan2(met[1], met[0])
    cos, sin = math.cos(theta), math.sin(theta)
    x, y = cos * met[0] + sin * met[1], cos * met[1] - sin * met[0]
    dx, dy, dz = cos * axis[0] + sin * axis[1], cos * axis[1] - sin * axis[0], axis[2]
    alpha, beta = math.atan2(-dy, dz), math.asin(float(np.clip(dx, -1.0, 1.0)))
    # Along the next axis to the plane of x and the turned y.
    reach = y * math.tan(alpha) / (dz - dy * math.tan(alpha))
    return Row(theta, 0.0, float(x + reach * dx), alpha, float((y + reach * dy) / math.cos(alpha)), beta)


def _transform(row: Row) -> np.ndarray:
    found = np.eye(4)
    for axis, angle, shift in ((2, row.theta, row.d), (0, row.alpha, row.a), (1, row.beta, row.b)):
        step = elementary("R", axis, angle)
        step[axis, 3] = shift
        found = found @ step
    return found
