"""Summarize the verdicts and held-out errors of all campaigns in one table; the folds of
a campaign are pooled."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.loop.schemas import RESIDUALS
from elastocal.random_streams import open_stream
from elastocal.validation.held_out import (
    PositionErrors,
    compute_error_intervals,
    summarize_errors,
)
from elastocal.verdict import Verdict, read_verdict

if TYPE_CHECKING:
    from collections.abc import Mapping

# Replicates of the bootstrap over poses.
_REPLICATES = 1000
_STAGES = ("before", "after")


def summarize_campaigns(job: Any) -> None:
    """Write the table of all campaigns of one kind. Called by a rule of the workflow."""
    settings = job.params
    verdicts = {
        name: read_verdict(path)
        for name, path in zip(settings.campaigns, job.input.verdicts, strict=True)
    }
    held_out = {}
    for name, path in zip(settings.campaigns, job.input.residuals, strict=True):
        schema = RESIDUALS.for_joints(len(verdicts[name].noise.joint_rad))
        held_out[name] = read_frame(path, schema).query("held_out and not gross_error")
    write_csv(
        job.output.table,
        tabulate_campaigns(verdicts, held_out, settings.folds, settings.seed),
    )


def tabulate_campaigns(
    verdicts: Mapping[str, Verdict],
    residuals: Mapping[str, pd.DataFrame],
    folds: dict[str, list[str]],
    seed: int,
) -> pd.DataFrame:
    """Return one row for each campaign and session, and one for all folds of a campaign.

    Parameters
    ----------
    verdicts : mapping of Verdict
        Verdicts by name of the campaign.
    residuals : mapping of pd.DataFrame
        Held-out rows of the residuals tables.
    folds : dict
        Campaigns that hold out the folds of one set of measurements, by a common name.
    seed : int
        Seed of the bootstrap over poses.
    """
    pooled = {name for names in folds.values() for name in names}
    groups = {name: [name] for name in verdicts if name not in pooled} | folds
    rows = []
    for name, members in groups.items():
        held_out = pd.concat([residuals[member] for member in members])
        head = {
            "campaign": name,
            "verdict": _count_values([verdicts[member].verdict for member in members]),
            "effects": _count_values(
                [_format_effects(verdicts[member]) for member in members]
            ),
        }
        session: Any
        for session, measurements in held_out.groupby("session"):
            draws = open_stream(seed, name, "summary", session)
            errors = _summarize_session(measurements, draws)
            rows.append(head | {"session": session} | errors)
    return pd.DataFrame(rows)


def _format_effects(verdict: Verdict) -> str:
    """Return the names of the missing effects with their joints."""
    effects = []
    for effect in verdict.effects:
        joints = ", ".join(map(str, effect.joints))
        effects.append(f"{effect.name} (joint {joints})" if joints else effect.name)
    return " + ".join(effects) or "none"


def _count_values(values: list[str]) -> str:
    """Return the value of a campaign, or how many of its folds have each value."""
    if len(values) == 1:
        return values[0]
    counts = pd.Series(values).value_counts()
    return "; ".join(
        f"{count} of {len(values)}: {value}" for value, count in counts.items()
    )


def _summarize_session(
    measurements: pd.DataFrame, draws: np.random.Generator
) -> dict[str, float]:
    """Return the error columns of a session; repeats of a state count once, as their
    mean."""
    columns = [f"{stage}_{axis}" for stage in _STAGES for axis in ("dx", "dy", "dz")]
    means = measurements.groupby(["pose", "load", "target"], sort=True)[columns].mean()
    poses = means.index.get_level_values("pose")
    cluster = np.unique(poses, return_inverse=True)[1]
    errors = []
    for first in (0, 3):
        residual = means[columns[first : first + 3]]
        errors.append(PositionErrors(np.linalg.norm(residual, axis=1), cluster))
    limits, reductions = compute_error_intervals(errors, _REPLICATES, draws)
    row: dict[str, float] = {"poses": errors[0].poses}
    for stage, error, limit in zip(_STAGES, errors, limits, strict=True):
        for name, value in summarize_errors(error.distance).items():
            row[f"{stage}_{name.removesuffix('_m')}_mm"] = 1e3 * value
        row[f"{stage}_rms_low_mm"], row[f"{stage}_rms_high_mm"] = 1e3 * limit["rms_m"]
    row["rms_reduction_low"] = reductions[1].low
    row["rms_reduction_high"] = reductions[1].high
    return row
