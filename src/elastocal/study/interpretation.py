"""How the paper's open points are read, and how large a study is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from elastocal.study.simulation import Loading


@dataclass(frozen=True)
class Interpretation:
    """How the paper's open points are read, see ``schemas/config.yaml``.

    Attributes
    ----------
    loading : Loading
        R3, R4.
    rows : int
        6 where poses are measured, 3 where positions are (R5).
    wrench_at : {"end_effector", "measuring_point"}
        R6.
    average, deviation_of : str
        R7 and R8, see `evaluation.average`.
    """

    loading: Loading
    rows: int
    wrench_at: str
    average: str
    deviation_of: str


@dataclass(frozen=True)
class Size:
    """How large a study is.

    Attributes
    ----------
    data_sets, configurations, tests : int
    noise : float
        Standard deviation, the same number in m and rad.
    """

    data_sets: int
    configurations: int
    tests: int
    noise: float
