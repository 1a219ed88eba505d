"""A chain as Denavit-Hartenberg parameters, and by how much a calibrated one differs from the nominal one.

Rows are of the standard notation, ``Rz(theta) Tz(d) Tx(a) Rx(alpha)``, from the base's z axis over each joint axis to that of
the end effector. Where two axes are nominally parallel, their common normal jumps with the smallest error, so that d is fixed
and the row ends in ``Ty(b) Ry(beta)`` instead, after Hayati [1]; b is 0 but where the axes nominally coincide, where theta is
fixed and a and b are the offset. All parameters then change as little as the robot does.

[1] Hayati, S. A., Robot arm geometric link parameter estimation, IEEE Conference on Decision and Control, 1983.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from elastocal.errors import InputError
from elastocal.exchange.fixed_transforms import elementary, homogeneous, rotation_about
from elastocal.mechanics.robot import Robot

# Axes within this angle are parallel, and lines within this distance are one: what decimals of a robot file leave.
_PARALLEL_RAD, _TOGETHER_M = 1e-6, 1e-7
PARAMETERS = ("theta_deg", "d_m", "a_m", "alpha_deg", "b_m", "beta_deg")
# How a pair of axes is described, that of the nominal robot for the calibrated one: the common normal, None of parallel axes;
# and theta, None of parallel axes that do not coincide.
_Kind = tuple[np.ndarray | None, float | None]


def dh_table(robot: Robot, nominal: Robot | None = None) -> pd.DataFrame:
    """Rows as `elastocal import dh` reads them: ``Ty(b) Ry(beta)`` becomes a fixed row of its own.

    `nominal`: by which each pair of axes is described, see `dh_deltas`; the robot itself without. Returns of the angles that
    the controller reports, where for both it counts each joint by itself. Raises `InputError`: prismatic joints.
    """
    rows: list[dict[str, Any]] = []
    turned, like = 0.0, nominal or robot

    def write(kind: str, joint: int | None, theta: float, d: float, a: float, alpha: float) -> None:
        head = {"joint": f"{joint or ''}", "type": kind, "theta_offset_deg": math.degrees(theta)}
        rows.append(head | {"d_m": d, "a_m": a, "alpha_deg": math.degrees(alpha), "point": ""})

    for number, row in enumerate(_rows(robot, like, robot.counts_each_joint and like.counts_each_joint)):
        theta, d, a, alpha, b, beta = row.tolist()
        joint = number if 1 <= number <= robot.joints else None
        write("R" if joint else "F", joint, theta - turned, d, a, alpha)
        # Ry is Rx between quarter turns, of which the next row takes back the second.
        turned = 0.5 * math.pi if b or beta else 0.0
        if turned:
            write("F", None, turned, 0.0, b, beta)
    if turned:
        write("F", None, -turned, 0.0, 0.0, 0.0)
    rows[-1]["point"] = robot.chain.end_effector.name
    return pd.DataFrame(rows)


def dh_deltas(nominal: Robot, calibrated: Robot) -> pd.DataFrame:
    """Parameters of both robots row by row, and their differences.

    Returns ``row`` (base, q1 .. qn, end effector), the calibrated `PARAMETERS`, then ``delta_..``: calibrated minus nominal.
    """
    own = nominal.counts_each_joint and calibrated.counts_each_joint
    before, after = (_rows(robot, nominal, own) for robot in (nominal, calibrated))
    turns, delta = np.array([name.endswith("_deg") for name in PARAMETERS]), after - before
    delta[:, turns] = np.degrees((delta[:, turns] + math.pi) % (2.0 * math.pi) - math.pi)
    table = pd.DataFrame(np.where(turns, np.degrees(after), after) + 0.0, columns=list(PARAMETERS))
    table.insert(0, "row", ["base", *(f"q{joint}" for joint in range(1, nominal.joints + 1)), nominal.chain.end_effector.name])
    return pd.concat([table, pd.DataFrame(delta + 0.0, columns=[f"delta_{name}" for name in PARAMETERS])], axis=1)


def _rows(robot: Robot, nominal: Robot, own: bool) -> np.ndarray:
    """Rows of base, joints and end effector in the description of another robot, ndarray (n + 2, 6): `PARAMETERS` in rad, m."""
    return _describe(robot, _describe(nominal, None, own)[1], own)[0]


def _describe(robot: Robot, kinds: Sequence[_Kind] | None, own: bool) -> tuple[np.ndarray, list[_Kind]]:
    """Rows, and how each pair of axes was described."""
    points, directions, end = _axes(robot, own)
    here, rows, used = np.eye(4), [], []
    for number, (point, direction) in enumerate(zip(points, directions, strict=True)):
        inverse = np.linalg.inv(here)
        local, axis = inverse[:3, :3] @ point + inverse[:3, 3], inverse[:3, :3] @ direction
        kind = kinds[number] if kinds else _kind(local, axis)
        row = _parallel(local, axis, kind[1]) if kind[0] is None else _skew(local, axis, kind[0])
        rows.append(row)
        used.append(kind)
        here = here @ _transform(row)
    # What is left to the end effector's own frame turns and shifts along the last axis.
    left = np.linalg.inv(here) @ end
    return np.array([*rows, (math.atan2(left[1, 0], left[0, 0]), left[2, 3], 0.0, 0.0, 0.0, 0.0)]), used


def _axes(robot: Robot, own: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points on and directions of the joint axes and of the end effector's z axis, and its frame, where nothing is turned."""
    chain = robot.chain
    if any(chain.prismatic):
        raise InputError(robot.name, "chain", "prismatic joints", "a chain of revolute joints, for a DH table")
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
    here = here @ homogeneous(np.eye(3), chain.end_effector.offset_m)
    return np.array([*points, here[:3, 3]]), np.array([*directions, here[:3, 2]]), here


def _kind(point: np.ndarray, axis: np.ndarray) -> _Kind:
    """How the next axis lies to the z axis of a frame, by a point on it and its direction there."""
    if math.hypot(axis[0], axis[1]) < _PARALLEL_RAD:
        off = point - axis * point[2] / axis[2]
        return None, 0.0 if math.hypot(off[0], off[1]) < _TOGETHER_M else None
    normal = np.array([-axis[1], axis[0], 0.0]) / math.hypot(axis[0], axis[1])
    # The normal points from one axis to the next; of axes that meet, so that theta is small.
    apart = float(normal @ point)
    meet = abs(apart) <= _TOGETHER_M
    return -normal if apart < -_TOGETHER_M or (meet and (normal[0], normal[1]) < (-1e-9, 0.0)) else normal, None


def _skew(point: np.ndarray, axis: np.ndarray, nominal: np.ndarray) -> tuple[float, ...]:
    """Row by the common normal of two axes, which points as the nominal one does."""
    normal = np.array([-axis[1], axis[0], 0.0]) / math.hypot(axis[0], axis[1])
    normal = normal * (1.0 if normal @ nominal >= 0.0 else -1.0)
    # Foot on the z axis: where the next axis comes closest to it.
    along = (axis[0] * point[0] + axis[1] * point[1]) / (axis[0] ** 2 + axis[1] ** 2)
    alpha = math.atan2(float(np.cross(np.array([0.0, 0.0, 1.0]), axis) @ normal), float(axis[2]))
    return math.atan2(normal[1], normal[0]), point[2] - along * axis[2], normal @ point, alpha, 0.0, 0.0


def _parallel(point: np.ndarray, axis: np.ndarray, theta: float | None) -> tuple[float, ...]:
    """Row of Hayati for axes that are nominally parallel: d is 0; theta is fixed where they nominally coincide."""
    met = point - axis * point[2] / axis[2]
    theta = math.atan2(met[1], met[0]) if theta is None else theta
    (x, y, _), (dx, dy, dz) = rotation_about("z", -theta) @ met, rotation_about("z", -theta) @ axis
    alpha, beta = math.atan2(-dy, dz), math.asin(float(np.clip(dx, -1.0, 1.0)))
    # Along the next axis to the plane of x and the turned y.
    reach = y * math.tan(alpha) / (dz - dy * math.tan(alpha))
    return theta, 0.0, x + reach * dx, alpha, (y + reach * dy) / math.cos(alpha), beta


def _transform(row: Sequence[float] | np.ndarray) -> np.ndarray:
    theta, d, a, alpha, b, beta = row
    steps = ((2, theta, d), (0, alpha, a), (1, beta, b))
    first, second, third = (homogeneous(rotation_about("xyz"[i], angle), shift * np.eye(3)[i]) for i, angle, shift in steps)
    return first @ second @ third
