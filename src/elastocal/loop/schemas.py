"""Every table that the loop keeps, column by column, written down here and nowhere else; and its residuals as they are read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.storage import Column, TableSchema, read_table
from elastocal.mechanics.components import COMPONENTS, WRENCH

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

_IDENTITY = (
    Column("session", "int32", "", "sessions have each their own tracker frame"),
    Column("pose", "int32", "", "number of the pose in its session"),
    Column("load", "int32", "", "number of the load, 0 where unloaded"),
    Column("repeat", "int32", "", "number of the fresh approach to this pose and load"),
    Column("target", "int32", "", "number of the target, in the order of the campaign, from 0", minimum=0),
    Column("row", "int32", "", "row in the file of measurements, 1 for the first of data", minimum=1),
)


def _angles_and_wrench(joints: int) -> tuple[Column, ...]:
    return (
        *(Column(f"q{j}", "float64", "rad", f"angle of joint {j} of the chain") for j in range(1, joints + 1)),
        *(Column(name, "float64", unit, f"{meaning}, at the last measuring point") for name, unit, meaning in WRENCH),
    )


def measurements(joints: int) -> TableSchema:
    """Measurements of a campaign, as the library takes them; what was not recorded is not a number."""
    return TableSchema(
        "measurements",
        (
            *_IDENTITY,
            *_angles_and_wrench(joints),
            *(Column(axis, "float64", "m", f"measured position along {axis}") for axis in "xyz"),
            *(Column(f"r{axis}", "float64", "rad", f"measured rotation vector about {axis}", missing=True) for axis in "xyz"),
            *(Column(f"approach{j + 1}", "float64", "", f"approach of joint {j + 1}", missing=True) for j in range(joints)),
            Column("time_s", "float64", "s", "time since any instant", missing=True),
            Column("temperature_c", "float64", "°C", "temperature", missing=True),
            Column("u95_m", "float64", "m", "expanded uncertainty of this position, 95 % of one coordinate", missing=True),
        ),
    )


STEPS = TableSchema(
    "steps",
    (
        Column("step", "int32", "", "number of the model on the way from the nominal robot to all effects found", minimum=0),
        Column("owner", "text", "", "frame of a session, target, effect, or the fit itself"),
        Column("parameter", "text", "", "name of the parameter"),
        Column("unit", "text", "", "unit of value, standard error and prior"),
        Column("value", "float64", "", "estimate; placement of the base for frames, of the target in its point for targets"),
        Column("std_error", "float64", "", "standard error; 0 where held", missing=True),
        Column("held", "bool", "", "whether the parameter is not identifiable from these data and keeps its value"),
        Column("prior_std", "float64", "", "standard deviation of the normal prior about zero, if there is one", missing=True),
    ),
)


def residuals(joints: int) -> TableSchema:
    """Every measurement, before and after."""
    return TableSchema(
        "residuals",
        (
            *_IDENTITY,
            Column("held_out", "bool", "", "whether no step but the last has seen it"),
            Column("gross_error", "bool", "", "whether no model explains the row, so that every fit and error leaves it out"),
            Column("outside_range", "bool", "", "whether its held-out pose lies outside the range of the fitted poses"),
            Column("time_s", "float64", "s", "time since any instant", missing=True),
            *_angles_and_wrench(joints),
            *(Column(axis, "float64", "m", f"measured position along {axis}, base axes") for axis in "xyz"),
            *(
                Column(f"{stage}_{name}", "float64", unit, f"{meaning}, measured less predicted, {words}", missing=True)
                for stage, words in (("before", "declared model"), ("after", "with the effects found"))
                for name, unit, meaning in COMPONENTS
            ),
        ),
    )


def read_residuals(path: str | Path, joints: int) -> dict[str, np.ndarray]:
    """Columns of a residuals table, of the rows that are no gross errors."""
    columns = read_table(path, residuals(joints))
    return {name: values[~columns["gross_error"]] for name, values in columns.items()}


def worst_measurement(table: Mapping[str, np.ndarray]) -> int:
    """Row of a residuals table with the largest position error of the declared model."""
    return int(np.argmax(np.linalg.norm([table[f"before_d{axis}"] for axis in "xyz"], axis=0)))


def angles_of(table: Mapping[str, np.ndarray], joints: int) -> np.ndarray:
    """Joint angles (N, n) of a residuals table, as the model of the robot counts them, rad."""
    return np.column_stack([table[f"q{joint}"] for joint in range(1, joints + 1)])
