"""How far the corrected robot misses, by part and model, with intervals over cases; and whether that is what was stated."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from statsmodels.stats.proportion import proportion_confint

from elastocal.campaigns.reading import read_robot
from elastocal.io.data_frames import read_frame, write_csv
from elastocal.random_streams import stream
from elastocal_proof.blind import schemas
from elastocal_proof.blind.closed_loop import FOUND, MODELS, PARTS, STATED_OF, TRUE

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

_REPLICATES = 2000
# The goal where the effect was named: so many times what the true model leaves.
GOAL = 1.2
_CASE = ["robot", "effect", "seed"]
# Verdicts under which one model stands for the robot.
_SETTLED = ("named", "adequate")


def case_errors(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """RMS errors of each case.

    `tables`: rows of `closed_loop` by robot. Returns one row for each case and part: ``robot, effect, seed, verdict, named,
    part``, the measured RMS of each model (m), the same as the robot reached it, without the tracker's noise (``.._reached``),
    that of the model found over that of the true one (``over_floor``), and ``calibration``: mean square error reached over mean
    square predicted. Poses that some model could not correct are left out for all.
    """
    frame = pd.concat([table.assign(robot=robot) for robot, table in tables.items()], ignore_index=True)
    frame = frame[frame.groupby([*_CASE, "part", "pose"])["corrected"].transform("all")]
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

            def drawn(name: str, mine: pd.DataFrame = mine, draws: np.ndarray = draws) -> tuple[float, np.ndarray]:
                squares = mine[name].to_numpy() ** 2
                return float(np.sqrt(squares.mean())), np.sqrt(squares[draws].mean(axis=1))

            floor = drawn(TRUE)
            for model in MODELS:
                (rms, many), (reached, many_reached) = drawn(model), drawn(f"{model}_reached")
                row = {"robot": robot, "part": part, "model": model, "cases": len(mine)}
                row |= _with_limits("rms_mm", 1e3 * rms, 1e3 * many)
                row |= _with_limits("over_floor", rms / floor[0], many / floor[1])
                rows.append(row | _with_limits("reached_mm", 1e3 * reached, 1e3 * many_reached))
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


def coverage(rows: pd.DataFrame) -> pd.DataFrame:
    """How often the truth is below the stated bounds, and how often it denies a decision, with Clopper-Pearson intervals.

    `rows`: of `stated_accuracy`. Returns one row for each frame (and all), part, kind of verdict (and all) and question:
    ``cases, hits, share, low, high``, and the root of mean true over mean predicted squares.
    """
    settled, always = rows["verdict"].isin(_SETTLED), rows["verdict"].notna()
    questions = {
        "rms below its 95 % bound": (always, rows["true_rms_m"] <= rows["rms_bound_m"]),
        "worst below its 95 % bound": (always, rows["true_worst_m"] <= rows["worst_bound_m"]),
        "pass that the truth denies": (rows["decision"] == "pass", rows["true_rms_m"] > rows["tolerance_m"]),
        "fail that the truth denies": (rows["decision"] == "fail", rows["true_rms_m"] <= rows["tolerance_m"]),
    }
    found = []
    for frame in ("base", "tracker", "all"):
        for part in STATED_OF:
            for verdict, chosen in (("one model", settled), ("several, class, unexplained", ~settled), ("all", always)):
                mine = chosen & (rows["part"] == part) & ((rows["frame"] == frame) | (frame == "all"))
                squares = [(rows.loc[mine, name] ** 2).mean() for name in ("true_rms_m", "rms_m")]
                for question, (asked, hit) in questions.items():
                    cases, hits = int((mine & asked).sum()), int((mine & asked & hit).sum())
                    low, high = proportion_confint(hits, cases, method="beta") if cases else (0.0, 1.0)
                    found.append(
                        {"frame": frame, "part": part, "verdict": verdict, "question": question, "cases": cases, "hits": hits}
                        | {"share": hits / max(cases, 1), "low": low, "high": high}
                        | {"true_over_predicted": float(np.sqrt(squares[0] / squares[1]))}
                    )
    return pd.DataFrame(found)


def _with_limits(name: str, value: float, drawn: np.ndarray) -> dict[str, float]:
    low, high = np.quantile(drawn, [0.025, 0.975])
    return {name: float(value), f"{name}_low": float(low), f"{name}_high": float(high)}


def summarize_closed_loop(job: Any) -> None:
    """Errors of the closed loop: by case, and together with intervals."""
    joints = [read_robot(Path(robot)).joints for robot in job.input.robots]
    files = zip(job.params.robots, job.input.moved, joints, strict=True)
    errors = case_errors({robot: read_frame(path, schemas.closed_loop(count)) for robot, path, count in files})
    write_csv(job.output.errors, errors)
    write_csv(job.output.summary, summary(errors, job.params.seed))
    write_csv(job.output.goals, goals(errors))


def tabulate_coverage(job: Any) -> None:
    """How often stated accuracies hold: all cases, and their coverage with intervals."""
    rows = pd.concat([pd.read_csv(path) for path in job.input.stated], ignore_index=True)
    write_csv(job.output.cases, rows)
    write_csv(job.output.coverage, coverage(rows))
