"""Measurements to columns of tables and back."""

from collections.abc import Mapping

import numpy as np

from elastocal.campaigns.campaign import Measurements
from elastocal.mechanics.components import COMPONENT_NAMES, WRENCH_NAMES

_IDENTITY = ("session", "pose", "load", "repeat", "target", "row")


def columns_of(measurements: Measurements) -> dict[str, np.ndarray]:
    """Columns of the measurements table, dict of str to ndarray (N,)."""
    count, joints = measurements.joint_angles.shape
    columns = _identity(measurements) | _commanded(measurements)
    columns |= dict(zip("xyz", measurements.position.T, strict=True))
    columns |= dict(zip(("rx", "ry", "rz"), _or_missing(measurements.rotation_vector, (count, 3)).T, strict=True))
    approach = _or_missing(measurements.approach, (count, joints))
    columns |= {f"approach{j + 1}": approach[:, j] for j in range(joints)}
    return columns | {name: _or_missing(getattr(measurements, name), (count,)) for name in ("time_s", "temperature_c", "u95_m")}


def measurements_from(columns: Mapping[str, np.ndarray]) -> Measurements:
    """Measurements from the columns of their table, dict of str to ndarray (N,)."""
    joints = sum(name.startswith("approach") for name in columns)
    return Measurements(
        **{name: columns[name] for name in _IDENTITY},
        joint_angles=np.column_stack([columns[f"q{j}"] for j in range(1, joints + 1)]),
        wrench=np.column_stack([columns[name] for name in WRENCH_NAMES]),
        position=np.column_stack([columns[axis] for axis in "xyz"]),
        rotation_vector=_or_none(np.column_stack([columns[f"r{axis}"] for axis in "xyz"])),
        approach=_or_none(np.column_stack([columns[f"approach{j}"] for j in range(1, joints + 1)])),
        time_s=_or_none(columns["time_s"]),
        temperature_c=_or_none(columns["temperature_c"]),
        u95_m=_or_none(columns["u95_m"]),
    )


def residual_columns(
    measurements: Measurements,
    held_out: bool,
    gross_errors: bool,
    outside: np.ndarray,
    position: np.ndarray,
    stages: Mapping[str, np.ndarray],
) -> dict[str, np.ndarray]:
    """Columns of the residuals table.

    `outside` (N,) of bool: whether each lies outside of the range of the poses fitted. `position` (N, 3): m, base axes.
    `stages` (N, rows): residuals "before", of the declared model, and "after", of the found one, m and rad. Returns (N,).
    """
    count = len(measurements)
    columns = _identity(measurements)
    columns |= {"held_out": np.full(count, held_out), "gross_error": np.full(count, gross_errors), "outside_range": outside}
    columns |= {"time_s": _or_missing(measurements.time_s, (count,))} | _commanded(measurements)
    columns |= dict(zip("xyz", position.T, strict=True))
    for stage, residual in stages.items():
        whole = np.full((count, 6), np.nan)
        whole[:, : residual.shape[1]] = residual
        columns |= {f"{stage}_{name}": whole[:, k] for k, name in enumerate(COMPONENT_NAMES)}
    return columns


def _identity(measurements: Measurements) -> dict[str, np.ndarray]:
    return {name: getattr(measurements, name) for name in _IDENTITY}


def _commanded(measurements: Measurements) -> dict[str, np.ndarray]:
    angles = {f"q{joint}": values for joint, values in enumerate(measurements.joint_angles.T, 1)}
    return angles | dict(zip(WRENCH_NAMES, measurements.wrench.T, strict=True))


def _or_missing(values: np.ndarray | None, shape: tuple[int, ...]) -> np.ndarray:
    return np.full(shape, np.nan) if values is None else values


def _or_none(values: np.ndarray) -> np.ndarray | None:
    return None if np.isnan(values).all() else values
