"""Every table that the loop keeps, column by column, written down here and nowhere
else; and its residuals as they are read."""

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
# What a campaign may not have recorded; it is not a number there.
_OPTIONAL = ("rx", "ry", "rz", "approach", "time_s", "temperature_c", "u95_m")


def _columns(joints: int) -> dict[str, Column]:
    """Columns of a file of measurements as the library takes them: targets by number,
    angles as the chain counts them."""
    found = {
        name: replace(c, missing=name.startswith(_OPTIONAL))
        for name, c in describe_columns(joints).items()
    }
    found |= {
        name: replace(found[name], meaning=f"angle of joint {name[1:]} of the chain")
        for name in _angles(joints)
    }
    target = Column(
        "target",
        "int32",
        "",
        "number of the target, in the order of the campaign, from 0",
        minimum=0,
    )
    row = Column(
        "row",
        "int32",
        "",
        "row in the file of measurements, 1 for the first of data",
        minimum=1,
    )
    return found | {"target": target, "row": row}


def _angles(joints: int) -> list[str]:
    return [f"q{joint}" for joint in range(1, joints + 1)]


def measurements(joints: int) -> TableSchema:
    """Measurements of a campaign, as the library takes them; what was not recorded is
    not a number."""
    return TableSchema("measurements", (*_columns(joints).values(),))


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


def residuals(joints: int) -> TableSchema:
    """Every measurement, before and after; positions in base axes."""
    columns = _columns(joints)
    return TableSchema(
        "residuals",
        (
            *(columns[name] for name in _STATE),
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
            *(
                columns[name]
                for name in ("time_s", *_angles(joints), *WRENCH_NAMES, *"xyz")
            ),
            *(
                Column(
                    f"{stage}_{name}",
                    "float64",
                    unit,
                    f"{meaning}, measured less predicted, {words}",
                    missing=True,
                )
                for stage, words in (
                    ("before", "declared model"),
                    ("after", "with the effects found"),
                )
                for name, unit, meaning in COMPONENTS
            ),
        ),
    )


def read_residuals(path: str | Path, joints: int) -> dict[str, np.ndarray]:
    """Columns of a residuals table, of the rows that are no gross errors."""
    columns = read_table(path, residuals(joints))
    return {name: values[~columns["gross_error"]] for name, values in columns.items()}


def worst_measurement(table: Mapping[str, np.ndarray]) -> int:
    """Row of a residuals table with the largest position error of the declared
    model."""
    return int(
        np.argmax(np.linalg.norm([table[f"before_d{axis}"] for axis in "xyz"], axis=0))
    )


def angles_of(table: Mapping[str, np.ndarray], joints: int) -> np.ndarray:
    """Joint angles (N, n) of a residuals table, as the model of the robot counts them,
    rad."""
    return np.column_stack([table[name] for name in _angles(joints)])
