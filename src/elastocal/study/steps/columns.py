"""Arrays with the axes (data set, configuration, component) to columns of tables and back."""

from collections.abc import Mapping, Sequence

import numpy as np

from elastocal.mechanics.components import COMPONENT_NAMES, WRENCH_NAMES
from elastocal.study.experiments import Experiments

# All that `to_deflections` looks at.
DEFLECTION_COLUMNS = ("configuration", *COMPONENT_NAMES)


def index_columns(sets: Sequence[int] | np.ndarray, configurations: int) -> dict[str, np.ndarray]:
    """Columns that number the rows of a block."""
    return {
        "data_set": np.repeat(np.asarray(sets), configurations),
        "configuration": np.tile(np.arange(configurations), len(sets)),
    }


def prefix_index_columns(sets: Sequence[int] | np.ndarray, lengths: int) -> dict[str, np.ndarray]:
    """Columns that number the rows of a block with one row for each data set and prefix length."""
    return {"data_set": np.repeat(np.asarray(sets), lengths), "length": np.tile(np.arange(1, lengths + 1), len(sets))}


def data_sets(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Numbers of the data sets of a block, (sets,), whose rows stand together."""
    numbers = columns["data_set"]
    return numbers[np.flatnonzero(np.diff(numbers, prepend=-1))]


def experiment_columns(sets: Sequence[int] | np.ndarray, experiments: Experiments) -> dict[str, np.ndarray]:
    """Block of the experiments table."""
    columns = index_columns(sets, experiments.joint_angles.shape[1])
    for j in range(experiments.joint_angles.shape[-1]):
        columns[f"q{j + 1}"] = experiments.joint_angles[..., j].ravel()
    for k, name in enumerate(WRENCH_NAMES):
        columns[name] = experiments.wrench[..., k].ravel()
    return columns


def deflection_columns(
    point_name: str, sets: Sequence[int] | np.ndarray, deflections: np.ndarray
) -> dict[str, np.ndarray | str]:
    """Block of the deflections table for one measuring point, from deflections (sets, configurations, 6)."""
    columns: dict[str, np.ndarray | str] = {"point": point_name} | index_columns(sets, deflections.shape[1])
    for k, name in enumerate(COMPONENT_NAMES):
        columns[name] = deflections[..., k].ravel()
    return columns


def block_shape(columns: Mapping[str, np.ndarray]) -> tuple[int, int]:
    """(data sets, configurations) of a block."""
    configurations = int(columns["configuration"].max()) + 1
    return len(columns["configuration"]) // configurations, configurations


def to_experiments(columns: Mapping[str, np.ndarray]) -> Experiments:
    """Experiments of a block, with component-first memory."""
    shape = block_shape(columns)
    joints = sum(name[0] == "q" for name in columns)
    angles = np.stack([columns[f"q{j + 1}"].reshape(shape) for j in range(joints)])
    wrench = np.stack([columns[name].reshape(shape) for name in WRENCH_NAMES])
    return Experiments(np.moveaxis(angles, 0, -1), np.moveaxis(wrench, 0, -1))


def to_deflections(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Deflections (sets, configurations, 6) of a block, with component-first memory."""
    shape = block_shape(columns)
    return np.moveaxis(np.stack([columns[name].reshape(shape) for name in COMPONENT_NAMES]), 0, -1)
