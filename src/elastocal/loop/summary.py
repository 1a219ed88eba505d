"""All campaigns on one page: verdicts, and held-out errors before and after; folds of
one campaign are pooled."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.loop.schemas import residuals
from elastocal.random_streams import open_stream
from elastocal.validation.held_out import (
    PositionErrors,
    compute_error_intervals,
    summarize_errors,
)
from elastocal.verdict import Verdict, read_verdict

if TYPE_CHECKING:
    from collections.abc import Mapping

_REPLICATES = 1000
_STAGES = ("before", "after")


def summarize_campaigns(job: Any) -> None:
    """The step of a rule: all campaigns of one kind as one table."""
    settings = job.params
    verdicts = {
        name: read_verdict(path)
        for name, path in zip(settings.campaigns, job.input.verdicts, strict=True)
    }
    held_out = {
        name: read_frame(path, residuals(len(verdicts[name].noise.joint_rad))).query(
            "held_out and not gross_error"
        )
        for name, path in zip(settings.campaigns, job.input.residuals, strict=True)
    }
    write_csv(
        job.output.table,
        campaign_rows(verdicts, held_out, settings.folds, settings.seed),
    )


def campaign_rows(
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
        stated = pd.Series(
            [verdicts[member].verdict for member in members]
        ).value_counts()
        named = pd.Series(
            [_effects(verdicts[member]) for member in members]
        ).value_counts()
        head = {
            "campaign": name,
            "verdict": _counted(stated, len(members)),
            "effects": _counted(named, len(members)),
        }
        session: Any
        for session, part in held_out.groupby("session"):
            rows.append(
                head
                | {"session": session}
                | _errors(part, open_stream(seed, name, "summary", session))
            )
    return pd.DataFrame(rows)


def _effects(verdict: Verdict) -> str:
    at = [
        (effect.name, ", ".join(map(str, effect.joints))) for effect in verdict.effects
    ]
    return (
        " + ".join(
            f"{name} (joint {joints})" if joints else name for name, joints in at
        )
        or "none"
    )


def _counted(counts: pd.Series, total: int) -> str:
    if total == 1:
        return counts.index[0]
    return "; ".join(f"{count} of {total}: {value}" for value, count in counts.items())


def _errors(part: pd.DataFrame, draws: np.random.Generator) -> dict[str, float]:
    """Errors of averaged measurements: repeats of a state count once."""
    state = ["pose", "load", "target"]
    columns = [f"{stage}_{axis}" for stage in _STAGES for axis in ("dx", "dy", "dz")]
    mean = part.groupby(state, sort=True)[columns].mean()
    cluster = np.unique(mean.index.get_level_values("pose"), return_inverse=True)[1]
    errors = [
        PositionErrors(
            np.linalg.norm(mean[columns[3 * k : 3 * k + 3]], axis=1), cluster
        )
        for k in range(len(_STAGES))
    ]
    limits, reductions = compute_error_intervals(errors, _REPLICATES, draws)
    row: dict[str, float] = {"poses": errors[0].poses}
    for stage, error, limit in zip(_STAGES, errors, limits, strict=True):
        for name, value in summarize_errors(error.distance).items():
            row[f"{stage}_{name.removesuffix('_m')}_mm"] = 1e3 * value
        row[f"{stage}_rms_low_mm"], row[f"{stage}_rms_high_mm"] = 1e3 * limit["rms_m"]
    row["rms_reduction_low"] = reductions[1].low
    row["rms_reduction_high"] = reductions[1].high
    return row
