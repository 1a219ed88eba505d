"""Read the numbers, kinds and features of the rows of a campaign."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.campaigns.campaign import DOCUMENT
from elastocal.campaigns.measurements import POSITION, ROTATION
from elastocal.errors import suggest_names

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elastocal.campaigns.campaign import Measurements
    from elastocal.campaigns.tables import Cells
    from elastocal.measuring.channels import MeasuringPlan
    from elastocal.measuring.protocol import Kind


def list_required_columns(plan: MeasuringPlan) -> list[str]:
    """List the columns of numbers, kinds and features that a table must have."""
    names = [name for kind in plan.kinds if not kind.touches for name in kind.columns]
    if plan.features:
        names.append("feature")
    if sum(kind.reads_poses for kind in plan.kinds) > 1:
        names.append("kind")
    return list(dict.fromkeys(names))


def read_numbers(
    measurements: Measurements,
    table: Cells,
    plan: MeasuringPlan,
    noise: Mapping[str, Any] | None,
) -> Measurements:
    """Read the numbers that each row measured.

    Parameters
    ----------
    measurements : N rows, without their numbers.
    table : their table.
    plan : measuring plan of the campaign.
    noise : declared noise, which determines the spread of the measurements.

    Returns
    -------
    Measurements
        One for each row, or one for each number if kinds differ in their number of
        components.
    """
    if not plan.channels:
        return _read_poses(measurements, table, plan)
    channels, numbers = _read_components(table, plan)
    row, component = np.nonzero(channels >= 0)
    measurements = measurements.select(row)
    channel = channels[row, component]
    if plan.rows == 1:
        position = numbers[row, component][:, None]
    else:
        position = numbers[row, :3]
    # A component of a rotation means nothing without the others.
    rotation_vector = numbers[row, 3:] if plan.has_orientations else None
    return replace(
        measurements,
        position=position,
        rotation_vector=rotation_vector,
        channel=channel,
        spread=_compute_spread(channel, plan, noise),
    )


def _read_components(
    table: Cells, plan: MeasuringPlan
) -> tuple[np.ndarray, np.ndarray]:
    """Read the channels of the N rows and the numbers that they measured.

    Returns
    -------
    channels : (N, 6) int array, -1 where a row has no further channel.
    numbers : (N, 6) array, m and rad, 0 where the table has no column.
    """
    kind_of_row, feature_of_row = _find_kinds(table, plan)
    channels = np.full((len(kind_of_row), 6), -1)
    numbers = np.zeros((len(kind_of_row), 6))
    for kind_index, kind in enumerate(plan.kinds):
        rows = np.flatnonzero(kind_of_row == kind_index)
        if not len(rows):
            continue
        width = len(kind.columns)
        if width and set(kind.columns) <= set(table.columns):
            numbers[rows, :width] = table.select(rows).matrix(list(kind.columns))
        for feature in np.unique(feature_of_row[rows]).tolist():
            of_feature = rows[feature_of_row[rows] == feature]
            indices = plan.find_channels(kind, None if feature < 0 else feature)
            channels[of_feature, : len(indices)] = indices
    return channels, numbers


def _read_poses(
    measurements: Measurements, table: Cells, plan: MeasuringPlan
) -> Measurements:
    """Read rows that are poses or positions of the target."""
    kind = plan.kinds[0]
    position = table.matrix(POSITION)
    if kind.numbers == 3:
        return replace(measurements, position=position)
    rotation_vector = table.matrix(ROTATION)
    if kind.is_converted:
        position, rotation_vector = _convert_poses(
            kind, position, rotation_vector, plan.camera
        )
    return replace(measurements, position=position, rotation_vector=rotation_vector)


def _convert_poses(
    kind: Kind, position: np.ndarray, rotation_vector: np.ndarray, camera: str
) -> tuple[np.ndarray, np.ndarray]:
    """Convert positions and rotation vectors (N, 3) to poses of the target."""
    # Import scipy only here, because reading other campaigns does not need it.
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_rotvec(rotation_vector).as_matrix()
    converted, turned = kind.convert(position, rotation, {"camera": camera})
    return converted, Rotation.from_matrix(turned).as_rotvec()


def _find_kinds(table: Cells, plan: MeasuringPlan) -> tuple[np.ndarray, np.ndarray]:
    """Find the kind and the feature of each row, (N,) int arrays; -1 for no feature.

    A row that names no kind has that of its feature, or else the only kind that reads
    poses.
    """
    kinds = _read_optional(table, "kind")
    features = _read_optional(table, "feature")
    kind_of_row = np.zeros(len(kinds), int)
    feature_of_row = np.full(len(kinds), -1)
    for row, (kind, feature) in enumerate(zip(kinds, features, strict=True)):
        feature_index = _find_feature(table, row, feature, plan)
        implied = _imply_kind(feature_index, plan)
        kind_of_row[row] = _find_kind(table, row, kind or implied, plan)
        feature_of_row[row] = -1 if feature_index is None else feature_index
        _check_feature(table, row, plan.kinds[kind_of_row[row]], implied)
    return kind_of_row, feature_of_row


def _read_optional(table: Cells, column: str) -> list[str]:
    """Read the texts of a column; empty texts if the table does not have it."""
    if column in table.columns:
        return list(table.texts(column))
    return [""] * len(table.rows)


def _find_feature(table: Cells, row: int, name: str, plan: MeasuringPlan) -> int | None:
    """Find the index of the feature that a row names; None if it names none."""
    if not name:
        return None
    names = [feature.name for feature in plan.features]
    if name not in names:
        allowed = f"a feature of {DOCUMENT}: {suggest_names(name, names)}"
        raise table.fault(row, "feature", allowed)
    return names.index(name)


def _imply_kind(feature_index: int | None, plan: MeasuringPlan) -> str:
    """Name the kind of a row that states only its feature; empty if it is ambiguous."""
    if feature_index is not None:
        return plan.features[feature_index].kind
    names = [kind.name for kind in plan.kinds if kind.reads_poses]
    return names[0] if len(names) == 1 else ""


def _find_kind(table: Cells, row: int, name: str, plan: MeasuringPlan) -> int:
    """Find the index of a kind among those of the campaign."""
    names = [kind.name for kind in plan.kinds]
    if name in names:
        return names.index(name)
    if "kind" in table.columns:
        allowed = f"a kind of `measured` of {DOCUMENT}: {', '.join(names)}"
        raise table.fault(row, "kind", allowed)
    features = ", ".join(feature.name for feature in plan.features)
    raise table.fault(row, "feature", f"a feature of {DOCUMENT}: {features}")


def _check_feature(table: Cells, row: int, kind: Kind, implied: str) -> None:
    """Refuse a row of a kind with features that names none of this kind."""
    if not kind.reads_poses and implied != kind.name:
        allowed = f"a feature of kind {kind.name}"
        raise table.fault(row, "feature", allowed)


def _compute_spread(
    channel: np.ndarray, plan: MeasuringPlan, noise: Mapping[str, Any] | None
) -> np.ndarray | None:
    """Standard deviation of each measurement (N,) over that of the declared noise; None
    if nothing is declared by kind."""
    if noise is None or "position_m" not in noise:
        return None
    by_kind = noise.get("by_kind", {})
    position_m = noise["position_m"]
    ratios = []
    for entry in plan.channels:
        std = by_kind.get(entry.kind.name, position_m)
        if entry.is_angle:
            std = noise.get("orientation_rad", position_m)
        ratios.append(std / position_m)
    spread = np.array(ratios)[channel]
    return None if (spread == 1.0).all() else spread
