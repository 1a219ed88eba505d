"""How far the corrected robot misses, by part and model, with intervals over cases; and whether that is the floor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from statsmodels.stats.proportion import proportion_confint

from elastocal.random_streams import stream
from elastocal_proof.blind.closed_loop import FOUND, MODELS, PARTS, TRUE

if TYPE_CHECKING:
    from collections.abc import Mapping

_REPLICATES = 2000
# The goal where the effect was named: so many times what the true model leaves.
GOAL = 1.2
_CASE = ["robot", "effect", "seed"]


def case_errors(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """RMS errors of each case.

    `tables`: rows of `closed_loop` by robot. Returns one row for each case and part: ``robot, effect, seed, verdict, named,
    part``, the measured RMS of each model (m), the same as the robot reached it, without the tracker's noise (``.._reached``),
    that of the model found over that of the true one (``over_floor``), and ``calibration``: mean square error reached over mean
    square predicted. Poses that some model could not correct are left out for all.
    """
    frame = pd.concat([table.assign(robot=robot) for robot, table in tables.items()], ignore_index=True)
    pose = [*_CASE, "part", "pose"]
    frame = frame[frame.groupby(pose)["corrected"].transform("all")]
    key, columns = [*_CASE, "verdict", "named", "part", "model"], ["measured_error_m", "reached_error_m", "predicted_std_m"]
    means = (frame[columns] ** 2).groupby([frame[name] for name in key]).mean().unstack("model")
    measured, reached, predicted = (means[name] for name in columns)
    errors = np.sqrt(measured[[*MODELS]]).join(np.sqrt(reached[[*MODELS]]).add_suffix("_reached"))
    errors = errors.assign(calibration=reached[FOUND] / predicted[FOUND], over_floor=errors[FOUND] / errors[TRUE])
    return errors.rename_axis(columns=None).reset_index()


def summary(errors: pd.DataFrame, seed: int) -> pd.DataFrame:
    """Errors of all cases together.

    `errors`: of `case_errors`. `seed`: of the bootstrap over cases. Returns one row for each robot (and "all"), part and model:
    ``cases, rms_mm`` with 95 % limits, ``over_floor`` with limits, and ``reached_mm``, without the tracker's noise.
    """
    rows = []
    for robot in (*dict.fromkeys(errors["robot"]), "all"):
        for part in PARTS:
            mine = errors[(errors["part"] == part) & ((errors["robot"] == robot) | (robot == "all"))]
            draws = stream(seed, robot, f"closed loop {part}", 0).integers(len(mine), size=(_REPLICATES, len(mine)))
            squares = {model: mine[model].to_numpy() ** 2 for model in MODELS}
            drawn = {model: np.sqrt(values[draws].mean(axis=1)) for model, values in squares.items()}
            reached = {model: mine[f"{model}_reached"].to_numpy() ** 2 for model in MODELS}
            for model in MODELS:
                ratio = drawn[model] / drawn[TRUE]
                rows.append(
                    {"robot": robot, "part": part, "model": model, "cases": len(mine)}
                    | _with_limits("rms_mm", 1e3 * np.sqrt(squares[model].mean()), 1e3 * drawn[model])
                    | _with_limits("over_floor", np.sqrt(squares[model].mean() / squares[TRUE].mean()), ratio)
                    | _with_limits(
                        "reached_mm",
                        1e3 * np.sqrt(reached[model].mean()),
                        1e3 * np.sqrt(reached[model][draws].mean(axis=1)),
                    )
                )
    return pd.DataFrame(rows)


def goals(errors: pd.DataFrame) -> pd.DataFrame:
    """How many cases reach the goal, where the effect was named and where not.

    `errors`: of `case_errors`. Returns one row for each part, named and not: ``cases``, those within `GOAL` of the floor, their
    share with 95 % limits [1], the median of ``over_floor`` and of ``calibration``.

    [1] Wilson, E. B., Probable inference, the law of succession, and statistical inference, Journal of the American Statistical
        Association 22, 1927.
    """
    rows = []
    for part in PARTS:
        for named in (True, False):
            mine = errors[(errors["part"] == part) & (errors["named"] == named)]
            if len(mine):
                within = int((mine["over_floor"] <= GOAL).sum())
                low, high = proportion_confint(within, len(mine), method="wilson")
                rows.append(
                    {"part": part, "named": named, "cases": len(mine), "within": within}
                    | {"share": within / len(mine), "share_low": low, "share_high": high}
                    | {f"median_{name}": mine[name].median() for name in ("over_floor", "calibration")}
                )
    return pd.DataFrame(rows)


def _with_limits(name: str, value: float, drawn: np.ndarray) -> dict[str, float]:
    low, high = np.quantile(drawn, [0.025, 0.975])
    return {name: float(value), f"{name}_low": float(low), f"{name}_high": float(high)}
