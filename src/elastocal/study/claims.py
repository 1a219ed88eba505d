"""The paper's sentences, one by one: our number, its interval, and whether the sentence
holds.

A sentence about averaged models is judged by further studies: it holds if it is true in
at least 97.5 % of them, it does not if it is true in at most 2.5 %, and otherwise it
is undecided. A sentence about other quantities is judged by their 95 %
interval in the same way: it holds if it is true at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from elastocal.io.data_frames import read_robot_tables
from elastocal.study.jobs import MICRO, MILLI, Job, write_csvs
from elastocal.study.joint_test import pivot_studies
from elastocal.study.metrics import extrapolate_length
from elastocal.study.points import QUANTILE
from elastocal.study.schemas import REPEATED
from elastocal.study.uses import REFERENCE

if TYPE_CHECKING:
    from collections.abc import Callable

    from elastocal.io.data_frames import Frames

HOLDS = "holds"
FAILS = "does not hold"
OPEN = "undecided"
NOT_STUDIED = "not studied"
_CENTRAL = (0.025, 0.975)
CLASSICAL = "6DoF"
COMB = "3+6DoF comb"
STAGED_COMB = "4-6DoF after 6+3DoF"
SAME_AS_CLASSICAL = (CLASSICAL, "6DoF after 3DoF", "6DoF after 3+3DoF")
ROBOTS = ("kuka", "fanuc")


@dataclass(frozen=True)
class Judgement:
    """Our number for a sentence, its 95 % interval, the share of studies in which the
    sentence is true (NaN without studies), and the verdict."""

    ours: float
    low: float
    high: float
    true_share: float
    verdict: str


def judge_by_studies(
    values: np.ndarray, is_true: Callable[[np.ndarray], np.ndarray]
) -> Judgement:
    """Judge a sentence by its number in every study, (studies,)."""
    if np.isnan(values).any() or not len(values):
        return Judgement(np.nan, np.nan, np.nan, np.nan, NOT_STUDIED)
    low, high = np.quantile(values, _CENTRAL)
    share = float(is_true(values).mean())
    verdict = OPEN
    if share >= _CENTRAL[1]:
        verdict = HOLDS
    elif share <= _CENTRAL[0]:
        verdict = FAILS
    return Judgement(float(np.median(values)), float(low), float(high), share, verdict)


def judge_by_interval(
    interval: tuple[float, float, float], is_true: Callable[[float], bool]
) -> Judgement:
    """Judge a sentence by a value with the ends of its interval."""
    value, low, high = map(float, interval)
    if np.isnan([value, low, high]).any():
        return Judgement(value, low, high, np.nan, NOT_STUDIED)
    at_ends = (is_true(low), is_true(high))
    verdict = OPEN
    if all(at_ends):
        verdict = HOLDS
    elif not any(at_ends):
        verdict = FAILS
    return Judgement(value, low, high, np.nan, verdict)


@dataclass(frozen=True)
class StudyScores:
    """Scores of all strategies in further studies.

    Attributes
    ----------
    cells : dict
        By robot and strategy, a table with a row for each study and a column for each
        score and length.
    length : int
        Data set length of the scores.
    """

    cells: dict[tuple[str, str], pd.DataFrame]
    length: int

    @classmethod
    def of_studies(cls, studies: pd.DataFrame, length: int) -> StudyScores:
        """Arrange the rows of the table of repeated studies."""
        return cls(pivot_studies(studies), length)

    @property
    def count(self) -> int:
        """Number of studies."""
        return len(next(iter(self.cells.values())))

    @property
    def strategies(self) -> list[str]:
        """Names of all strategies."""
        return list(dict.fromkeys(strategy for _, strategy in self.cells))

    def get(self, robot: str, strategy: str, score: str = "deviation") -> np.ndarray:
        """A score (studies,); NaN if it is not studied."""
        cell = self.cells.get((robot, strategy))
        if cell is None:
            return np.full(self.count, np.nan)
        return cell[score][self.length].to_numpy()

    def find_length(
        self, robot: str, strategy: str, score: str, limit: float
    ) -> np.ndarray:
        """Length (studies,) from which on a score stays within a limit."""
        cell = self.cells.get((robot, strategy))
        if cell is None:
            return np.full(self.count, np.nan)
        return extrapolate_length(cell[score].to_numpy(), limit)

    def compute_lead(self, strategy: str, score: str) -> np.ndarray:
        """The smallest score of other estimators over that of a strategy, (studies,), of
        the robot where it is smaller."""
        leads = []
        for robot in ROBOTS:
            of_further_estimators = [
                self.get(robot, name, score)
                for name in self.strategies
                if name not in (COMB, STAGED_COMB)
            ]
            smallest = np.min(of_further_estimators, axis=0)
            leads.append(smallest / self.get(robot, strategy, score))
        return np.min(leads, axis=0)


def judge_by_scores(scores: StudyScores, initial_m: float) -> dict[str, Judgement]:
    """Judge the sentences about averaged models.

    Parameters
    ----------
    scores
    initial_m : float
        Mean deflection of the KUKA before calibration.
    """
    fixed = "k_sigma_fixed_joints"
    ratios = [scores.get(r, CLASSICAL) / scores.get(r, COMB) for r in ROBOTS]
    spreads = []
    for robot in ROBOTS:
        same = [scores.get(robot, name) for name in SAME_AS_CLASSICAL]
        spreads.append(np.max(same, axis=0) / np.min(same, axis=0))
    comb = scores.get("kuka", COMB, "k_sigma")
    staged = scores.get("kuka", STAGED_COMB, "k_sigma")
    lengths = [
        scores.find_length(robot, CLASSICAL, "deviation", 2 / MICRO) for robot in ROBOTS
    ]
    partial = "3-6DoF after 2DoF"
    between = [
        scores.get("fanuc", strategy, score) / scores.get("kuka", strategy, score)
        for strategy in scores.strategies
        for score in ("deviation", fixed)
    ]
    removed = 100 * (1 - scores.get("kuka", CLASSICAL) / initial_m)
    values: dict[str, tuple[np.ndarray, Callable[[np.ndarray], np.ndarray]]] = {
        "S1": (scores.compute_lead(COMB, "deviation"), lambda x: x > 1),
        "S2": (np.min(ratios, axis=0), lambda x: x >= 1.855),
        "S3": (np.max(spreads, axis=0), lambda x: x < 1 + 1e-6),
        "S4": (scores.compute_lead(STAGED_COMB, fixed), lambda x: x > 1),
        "S5": (comb / staged, lambda x: x >= 2.745),
        "S6": (np.max(lengths, axis=0), lambda x: x < 50),
        "S7": (scores.find_length("fanuc", partial, fixed, 1.0), lambda x: x <= 30),
        "S8": (
            scores.get("kuka", partial, fixed) / scores.get("fanuc", partial, fixed),
            lambda x: x > 1,
        ),
        "S9": (np.max(between, axis=0), lambda x: x < 1),
        "S12": (removed, lambda x: x >= 98.5),
    }
    return {name: judge_by_studies(*value) for name, value in values.items()}


def judge_by_tables(tables: Frames, length: int) -> dict[str, Judgement]:
    """Judge the sentences about other quantities.

    Parameters
    ----------
    tables
        extended, scores, budget, pairs, score_pairs and simulated, as the rules name
        them.
    length : int
        Configurations of the scores.
    """
    extended = tables["extended"]
    largest = extended[extended.residual_mean_um == extended.residual_mean_um.max()]
    classical = extended[extended.strategy == CLASSICAL]
    scores = tables["scores"]
    comb = scores[(scores.strategy == COMB) & (scores.metric == REFERENCE)]
    pairs = tables["pairs"]
    equal = pairs[pairs.points == "3+6DoF"]
    score_pairs = tables["score_pairs"]
    metrics = score_pairs.groupby("metric").reversed.any()
    agreeing = 100 * (1 - metrics.mean()) if len(metrics) else np.nan
    intervals: dict[str, tuple[tuple[float, float, float], Callable[[float], bool]]] = {
        "S10": (_take_interval(largest, "residual_mean_um"), lambda x: x < 366),
        "S11": (
            _take_interval(classical, "share_compensated_percent"),
            lambda x: x >= 79.5,
        ),
        "S13": (_take_ratio(comb, -1), lambda x: x < 1),
        "S14": (_take_ratio(equal, 0), lambda x: x < 1),
        "S15": (_compare_twice(tables["budget"], length), lambda x: x <= 1.05),
        "S16": ((agreeing,) * 3, lambda x: x > 50),
        "S17": (_compare_designs(tables["simulated"], length), lambda x: x <= 1.1),
    }
    return {name: judge_by_interval(*value) for name, value in intervals.items()}


_NO_INTERVAL = (np.nan, np.nan, np.nan)


def _take_interval(rows: pd.DataFrame, column: str) -> tuple[float, float, float]:
    """The first row's value with its 95 % interval."""
    if rows.empty:
        return _NO_INTERVAL
    value = float(rows[column].iloc[0])
    half_width = QUANTILE * float(rows[f"{column}_std_error"].iloc[0])
    return value, value - half_width, value + half_width


def _take_ratio(rows: pd.DataFrame, position: int) -> tuple[float, float, float]:
    """The smallest (0) or largest (-1) ratio of some rows with its interval."""
    if rows.empty:
        return _NO_INTERVAL
    row = rows.sort_values("ratio").iloc[position]
    return row.ratio, row.ratio_low, row.ratio_high


def _divide(
    numerator: np.ndarray, denominator: np.ndarray
) -> tuple[float, float, float]:
    """Ratio of two independent values, each followed by its standard error, with its
    interval."""
    ratio = float(numerator[0] / denominator[0])
    relative = np.hypot(numerator[1] / numerator[0], denominator[1] / denominator[0])
    factor = float(np.exp(QUANTILE * relative))
    return ratio, ratio / factor, ratio * factor


def _compare_twice(budget: pd.DataFrame, length: int) -> tuple[float, float, float]:
    """Error of the end-effector measured twice over that with a second point, at the same
    number of configurations; the larger robot."""
    cells = budget[budget.configurations == length].set_index(["robot", "points"])
    ratios = []
    for robot in dict.fromkeys(budget.robot):
        if {(robot, "6DoF twice"), (robot, "3+6DoF")} <= {*cells.index}:
            twice = cells.loc[(robot, "6DoF twice"), ["rms_um", "std_error_um"]]
            both = cells.loc[(robot, "3+6DoF"), ["rms_um", "std_error_um"]]
            ratios.append(_divide(twice.to_numpy(float), both.to_numpy(float)))
    return max(ratios, default=_NO_INTERVAL)


def _compare_designs(designs: pd.DataFrame, length: int) -> tuple[float, float, float]:
    """Error of random over that of I-optimal configurations; the smaller robot."""
    cells = designs[(designs.load == "random") & (designs.configurations == length)]
    ratios = []
    for _, cell in cells.groupby("robot"):
        rows = cell.set_index("design")[["rms_um", "rms_um_std_error"]]
        random = rows.loc["random"].to_numpy(float)
        optimal = rows.loc["I"].to_numpy(float)
        ratios.append(_divide(random, optimal))
    return min(ratios, default=_NO_INTERVAL)


def judge_claims(job: Job) -> None:
    """Write the paper's sentences with our numbers and verdicts."""
    tables = {
        name: pd.read_csv(job.input[name])
        for name in ("extended", "scores", "budget", "pairs", "score_pairs")
    }
    tables["simulated"] = pd.read_csv(job.input.simulated, dtype={"unobservable": str})
    table2 = pd.read_csv(job.input.table2).set_index("robot")
    initial_m = table2.mean_mm.get("kuka", np.nan) / MILLI
    length = job.params.length
    studies = read_robot_tables(job.input.studies, REPEATED)
    judgements = judge_by_scores(StudyScores.of_studies(studies, length), initial_m)
    judgements |= judge_by_tables(tables, length)
    claims = pd.read_csv(job.input.claims)
    rows = [vars(judgements[number]) for number in claims.number]
    write_csvs(job, table=claims.join(pd.DataFrame(rows)))
