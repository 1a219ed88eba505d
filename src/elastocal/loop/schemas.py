"""Schemas of the tables that the loop stores, and access to stored residuals."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.measurements import describe_columns
from elastocal.io.storage import Column, TableSchema, read_table
from elastocal.mechanics.components import COMPONENTS, WRENCH_NAMES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

_STATE = ("session", "pose", "load", "repeat", "target", "row")
# Beginnings of the names of columns that a campaign need not record; they hold NaN then.
_OPTIONAL = ("rx", "ry", "rz", "approach", "time_s", "temperature_c", "u95_m")
# Residuals before the calibration and of the final model, by the prefix of their columns.
_STAGES = {"before": "robot before its calibration", "after": "with the effects found"}


def build_measurements_schema(joints: int) -> TableSchema:
    """Return the schema of the measurements of a campaign.

    It differs from that of the user's file in two columns: targets are numbers, and
    joint angles are those of the chain.
    """
    columns = {}
    for name, column in describe_columns(joints).items():
        columns[name] = replace(column, missing=name.startswith(_OPTIONAL))
    for name in _name_angles(joints):
        meaning = f"angle of joint {name[1:]} of the chain"
        columns[name] = replace(columns[name], meaning=meaning)
    columns["target"] = Column(
        "target",
        "int32",
        "",
        "number of the target, in the order of the campaign, from 0",
        minimum=0,
    )
    columns["row"] = Column(
        "row",
        "int32",
        "",
        "row in the file of measurements, 1 for the first of data",
        minimum=1,
    )
    return TableSchema("measurements", tuple(columns.values()))


def _name_angles(joints: int) -> list[str]:
    return [f"q{joint}" for joint in range(1, joints + 1)]


STEPS = TableSchema(
    "steps",
    (
        Column(
            "step",
            "int32",
            "",
            "number of the model on the way from the nominal robot to all effects found",
            minimum=0,
        ),
        Column(
            "owner", "text", "", "frame of a session, target, effect, or the fit itself"
        ),
        Column("parameter", "text", "", "name of the parameter"),
        Column("unit", "text", "", "unit of value, standard error and prior"),
        Column(
            "value",
            "float64",
            "",
            "estimate; placement of the base for frames, of the target in its point for targets",
        ),
        Column(
            "std_error", "float64", "", "standard error; 0 where held", missing=True
        ),
        Column(
            "held",
            "bool",
            "",
            "whether the parameter is not identifiable from these data and keeps its value",
        ),
        Column(
            "prior_std",
            "float64",
            "",
            "standard deviation of the normal prior about zero, if there is one",
            missing=True,
        ),
    ),
)


def build_residuals_schema(joints: int) -> TableSchema:
    """Return the schema of the residuals of every measurement before and after the
    diagnosis; positions are in base axes."""
    measured = {
        column.name: column for column in build_measurements_schema(joints).columns
    }
    columns = [measured[name] for name in _STATE]
    columns += [
        Column("held_out", "bool", "", "whether no step but the last has seen it"),
        Column(
            "gross_error",
            "bool",
            "",
            "whether no model explains the row, so that every fit and error leaves it out",
        ),
        Column(
            "outside_range",
            "bool",
            "",
            "whether its held-out pose lies outside the range of the fitted poses",
        ),
        measured["time_s"],
    ]
    columns += [
        measured[name] for name in (*_name_angles(joints), *WRENCH_NAMES, *"xyz")
    ]
    for stage, model in _STAGES.items():
        for name, unit, component in COMPONENTS:
            meaning = f"{component}, measured less predicted, {model}"
            columns.append(
                Column(f"{stage}_{name}", "float64", unit, meaning, missing=True)
            )
    return TableSchema("residuals", tuple(columns))


def read_residuals(path: str | Path, joints: int) -> dict[str, np.ndarray]:
    """Read the columns of a residuals table, without the rows of gross errors."""
    columns = read_table(path, build_residuals_schema(joints))
    kept = ~columns["gross_error"]
    return {name: values[kept] for name, values in columns.items()}


def find_worst_measurement(table: Mapping[str, np.ndarray]) -> int:
    """Find the row of a residuals table with the largest position error before the
    calibration."""
    residual = [table[f"before_d{axis}"] for axis in "xyz"]
    return int(np.argmax(np.linalg.norm(residual, axis=0)))


def stack_joint_angles(table: Mapping[str, np.ndarray], joints: int) -> np.ndarray:
    """Return the joint angles (N, n) of a residuals table, those of the chain, rad."""
    return np.column_stack([table[name] for name in _name_angles(joints)])
