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
    `deviation_of`: R7 and R8, see `evaluation.average`. `reflectors_m`: from each measuring point, in its frame, to the
    reflectors whose positions are measured there; without, the target of the robot itself is measured.
    """

    loading: Loading
    rows: int
    wrench_at: str
    average: str
    deviation_of: str
    reflectors_m: tuple[tuple[float, ...], ...] = ()

    @property
    def independent_rows(self) -> int:
        """Independent measurements of one point in one configuration: a rigid body moves in six ways."""
        return min(6, self.rows * max(1, len(self.reflectors_m)))


@dataclass(frozen=True)
class Size:
    """How large a study is.

    `noise`: standard deviation, the same number in m and rad.
    """

    data_sets: int
    configurations: int
    tests: int
    noise: float
