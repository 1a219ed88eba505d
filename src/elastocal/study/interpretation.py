"""How the paper's open points are read, and how large a study is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from elastocal.study.simulation import Loading


@dataclass(frozen=True)
class Interpretation:
    """How the paper's open points are read, see ``schemas/config.yaml``.

    `loading`: R3, R4. `rows`: 6 where poses are measured, 3 where positions are (R5). `wrench_at`: R6. `average`,
    `deviation_of`: R7 and R8, see `evaluation.average`.
    """

    loading: Loading
    rows: int
    wrench_at: str
    average: str
    deviation_of: str


@dataclass(frozen=True)
class Size:
    """How large a study is.

    `noise`: standard deviation, the same number in m and rad.
    """

    data_sets: int
    configurations: int
    tests: int
    noise: float
