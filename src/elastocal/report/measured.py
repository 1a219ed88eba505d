"""Summarize the measurements of a campaign as rows of a table of its report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.counting import format_count, format_integer
from elastocal.report import words as say

if TYPE_CHECKING:
    from elastocal.io.documents import Document
    from elastocal.io.storage import Columns

# Targets that are listed by name.
_MAX_TARGETS = 12


def tabulate_measured(table: Columns, descriptions: Document) -> list[list[str]]:
    """Return rows on the measurements: name, at fitted poses, at validation poses.

    Parameters
    ----------
    table : mapping of (N,) arrays
        Columns of the residuals table.
    descriptions : mapping
        Contents of campaign.json.
    """
    held_out = table["held_out"].astype(bool)
    validation = descriptions["held_out"] or descriptions
    fitted_cells = _describe_measurements(
        _select_rows(table, ~held_out), descriptions["campaign"]
    )
    validation_cells = _describe_measurements(
        _select_rows(table, held_out), validation["campaign"]
    )
    return [
        [name, cell, validation_cells.get(name, "")]
        for name, cell in fitted_cells.items()
    ]


def _select_rows(table: Columns, mask: np.ndarray) -> dict[str, np.ndarray]:
    return {name: values[mask] for name, values in table.items()}


def _describe_measurements(table: Columns, campaign: Document) -> dict[str, str]:
    """Return the cells of one part of the measurements, by the name of their row."""
    count = len(table["pose"])
    if not count:
        return dict.fromkeys(("campaign", "measurements"), "none")
    repeats = _count_combinations(table, "session", "pose", "load", "target")
    poses = len(_count_combinations(table, "session", "pose"))
    sessions = len(_count_combinations(table, "session"))
    states = len(_count_combinations(table, "session", "pose", "load"))
    measured = campaign["measured"]
    names = [measured] if isinstance(measured, str) else measured
    has_orientations = not {"pose", "board", "relative"}.isdisjoint(names)
    kind = "position and orientation" if measured == "pose" else " or ".join(names)
    repeat_range = str(repeats.min())
    if repeats.min() < repeats.max():
        repeat_range += f" to {repeats.max()}, median {np.median(repeats):g}"
    frame = "the base's"
    if campaign["frame"] == "tracker":
        frame = "the tracker's; its placement is fitted"
    elif campaign["frame"] == "unknown":
        frame = "that of the features in each session; its placement is fitted"
    has_time = np.isfinite(table["time_s"]).any()
    return {
        "campaign": campaign["campaign"],
        "measurements": f"{format_integer(count)}, each a {kind}",
        "poses": f"{format_count(poses, 'pose')} in {format_count(sessions, 'session')}",
        "states (pose and load)": format_integer(states),
        "loads": _describe_loads(table),
        "targets": _describe_targets(
            table, campaign, has_orientations=has_orientations
        ),
        "repeats of a state": repeat_range,
        "coordinate frame": frame,
        "time": "recorded" if has_time else "not recorded",
    }


def _count_combinations(table: Columns, *names: str) -> np.ndarray:
    """Return how often each combination of values of some columns occurs."""
    columns = np.column_stack([table[name] for name in names])
    return np.unique(columns, axis=0, return_counts=True)[1]


def _describe_loads(table: Columns) -> str:
    """Return number, range and share of the loads in words."""
    force = np.linalg.norm([table[name] for name in ("fx", "fy", "fz")], axis=0)
    loaded = force[force > 0]
    if not len(loaded):
        return "none"
    size = say.format_number(loaded.min())
    if not np.isclose(loaded.min(), loaded.max(), rtol=1e-3):
        size += f" to {say.format_number(loaded.max())}"
    loads = format_count(len(np.unique(table["load"][force > 0])), "load")
    share = say.format_percent(len(loaded) / len(force))
    return f"{loads} of {size} N on {share} of the measurements"


def _describe_targets(
    table: Columns,
    campaign: Document,
    *,
    has_orientations: bool,
) -> str:
    """Return the targets that were measured, with their measuring points and mounts."""
    targets = list(campaign["targets"].items())
    descriptions = []
    for index in np.unique(table["target"]):
        name, target = targets[index]
        prefix = "" if name == target["point"] else f"{name} "
        mount = _describe_mount(target, has_orientations=has_orientations)
        descriptions.append(f"{prefix}at the measuring point {target['point']}{mount}")
    return say.join_items(descriptions, _MAX_TARGETS)


def _describe_mount(target: Document, *, has_orientations: bool) -> str:
    """Return the rotation of a target's mount, and which parts of its placement are
    fitted; only orientations say anything of the rotation."""
    offset = target["offset_m"]
    rotation = target.get("rotation", offset) if has_orientations else ""
    text = ""
    is_declared = "rotation" in target and has_orientations and rotation != "unknown"
    if is_declared and any(rotation):
        text = f", turned by {np.degrees(np.linalg.norm(rotation)):.4g}°"
    fitted = []
    if offset == "unknown":
        fitted.append("place")
    if rotation == "unknown":
        fitted.append("rotation")
    return f"{text}, {' and '.join(fitted)} fitted" if fitted else text
