"""The paper's printed figures against how studies of the same size scatter.

The paper is one study. Where k studies of one size have a mean m and a standard deviation s, a further one lies at
m + s sqrt(1 + 1/k) t, with t of Student's distribution with k - 1 degrees of freedom [1]: its density at a printed figure is
how well an interpretation predicts it, and its tails are the p value of the difference. Many figures are judged at once by
Holm's procedure [2].

[1] Geisser, S., Predictive Inference: An Introduction, Chapman and Hall, 1993.
[2] Holm, S., A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics 6, 1979.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtr

from elastocal.study.comparison import FITTED
from elastocal.study.metrics import length_to_reach
from elastocal.study.tables import MILLI, find_statistics

MICRO = 1e6
# A figure differs from the study where its p value, corrected for all figures, is below this.
LEVEL = 0.05
# Last printed digit, by the first letters of a quantity.
_DIGIT = {"c": 1e-3, "k_sigma": 1e-3, "dev_": 1e-3, "n_": 1.0}


@dataclass(frozen=True)
class Predicted:
    """How studies of one size scatter in one figure.

    `values` (k,): of each study; lengths as logarithms. `digit`: last printed one: a printed figure is rounded.
    """

    values: np.ndarray
    logarithmic: bool
    digit: float

    @property
    def mean(self) -> float:
        """Mean, of lengths the geometric one."""
        middle = float(self.values.mean())
        return float(np.exp(middle)) if self.logarithmic else middle

    @property
    def std(self) -> float:
        """Standard deviation between studies; of lengths in configurations."""
        spread = float(self.values.std(ddof=1))
        return spread * self.mean if self.logarithmic else spread

    def p_value(self, printed: float) -> float:
        """Two-sided, of a further study that lies so far out."""
        standard, _ = self._standardize(printed)
        return float(2 * stdtr(len(self.values) - 1, -abs(standard)))

    def log_density(self, printed: float) -> float:
        """Log predictive density of the printed figure; of lengths, of their logarithm."""
        from scipy.stats import t as student

        standard, scale = self._standardize(printed)
        return float(student.logpdf(standard, len(self.values) - 1) - np.log(scale))

    def leave_out_each(self) -> list[Predicted]:
        """The same by all studies but one, for each of them."""
        return [replace(self, values=np.delete(self.values, place)) for place in range(len(self.values))]

    def _standardize(self, printed: float) -> tuple[float, float]:
        digit, value = (self.digit / printed, np.log(printed)) if self.logarithmic else (self.digit, printed)
        count = len(self.values)
        variance = self.values.var(ddof=1) * (1 + 1 / count) + digit**2 / 12
        return float((value - self.values.mean()) / np.sqrt(variance)), float(np.sqrt(variance))


def predict_scatter(
    studies: pd.DataFrame, robot: str, strategy: str, quantity: str, length: int, fixed_joints: bool = True
) -> Predicted | None:
    """How one figure of Table 3 or 4 scatters between studies.

    `studies`: robot and the columns of `table_schemas.repeated`. `quantity`: c1.., k_sigma_20, dev_20, n_k_sigma_1_percent,
    n_dev_2_um: with its length or its limit. `length`: data set length of figures that name none. `fixed_joints`: whether
    k_sigma counts the joints fixed in the last stage alone (interpretation R10). Returns None where the studies do not have it.
    """
    rows = studies[(studies.robot == robot) & (studies.strategy == strategy)]
    if rows.empty or not (quantity[1:].isdigit() or quantity.startswith(("k_sigma_", "dev_", "n_"))):
        return None
    digit = next(digit for start, digit in _DIGIT.items() if quantity.startswith(start))
    column = "deviation" if "dev" in quantity else "k_sigma_fixed_joints" if fixed_joints else "k_sigma"
    if not quantity.startswith("n_"):
        place = int(quantity.rpartition("_")[2]) if "_" in quantity else length
        column, scale = (f"compliance_{quantity[1:]}", MICRO) if quantity[1:].isdigit() else (column, _scale(column))
        values = scale * rows.loc[rows.length == place, column].to_numpy()
        return Predicted(values, False, digit) if len(values) > 1 else None
    limit = float(quantity.split("_")[-2]) / _scale(column)
    curves = rows.pivot(index="study", columns="length", values=column).to_numpy()
    return Predicted(np.log(length_to_reach(curves, limit)), True, digit) if len(curves) > 1 else None


def comparison_table(
    beside: pd.DataFrame, studies: pd.DataFrame, initial: Mapping[str, pd.DataFrame], length: int
) -> pd.DataFrame:
    """The printed figures judged by further studies.

    `beside`: by `comparison.beside_paper`. `studies`: as in `predict_scatter`. `initial`: the initial table of each robot.
    `length`: of Table 3. Returns `beside` with studies_mean, studies_std, p_value and p_holm: of further studies for Tables 3
    and 4, of single data sets for Table 2; without a p value where the study was fitted to the figure.
    """
    scattered = [_scatter(figure, studies, initial, length) for figure in beside.itertuples()]
    found = pd.DataFrame(scattered, beside.index, ["studies_mean", "studies_std", "p_value"], float)
    return beside.join(found.assign(p_holm=holm(found.p_value.to_numpy())))


def _scatter(
    figure: Any, studies: pd.DataFrame, initial: Mapping[str, pd.DataFrame], length: int
) -> tuple[float, float, float]:
    """Mean, standard deviation and p value of a printed figure where one study, or one data set, stands beside many."""
    if figure.table == "2" and figure.robot in initial:
        values = MILLI * find_statistics(initial[figure.robot])[figure.quantity.removeprefix("deviation_")].to_numpy()
        below, above = (values <= figure.paper).sum(), (values >= figure.paper).sum()
        p_value = min(2 * (min(below, above) + 1) / (len(values) + 1), 1.0)
        fitted = (figure.robot, figure.quantity) == FITTED
        return values.mean(), values.std(ddof=1), np.nan if fitted else p_value
    found = None
    if figure.table in ("3", "4"):
        found = predict_scatter(studies, figure.robot, figure.strategy, figure.quantity, length)
    return (found.mean, found.std, found.p_value(figure.paper)) if found else (np.nan, np.nan, np.nan)


def holm(p_values: np.ndarray) -> np.ndarray:
    """p values corrected for their number, ndarray (N,); not a number where there is none."""
    order = np.argsort(p_values)[: np.count_nonzero(~np.isnan(p_values))]
    found = np.full(len(p_values), np.nan)
    found[order] = np.minimum(np.maximum.accumulate(p_values[order] * np.arange(len(order), 0, -1)), 1.0)
    return found


def _scale(column: str) -> float:
    return MICRO if column == "deviation" else 1.0
