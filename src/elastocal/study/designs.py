"""How much chosen configurations are worth over random ones (RQ3).

Candidates are random configurations with their loads; a design is some of them. Its worth is the Cramér-Rao bound of the RMS
end-effector error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elastocal.application.planning.designs import (
    CRITERIA,
    Criterion,
    best_value,
    choose_greedily,
    criterion,
    exchange_candidates,
    matrix_of,
    mean_squares,
)

RANDOM, CONTINUOUS = "random", "bound"
# Random designs of each size.
_RANDOM_DESIGNS = 400


@dataclass(frozen=True)
class Worth:
    """RMS error that designs of one kind and size leave, m.

    `kind`: one of `CRITERIA`, `RANDOM` or `CONTINUOUS`. `rms`: of random designs, the root of the mean square. `low`, `high`: 5
    and 95 % of random designs; else as `rms`.
    """

    kind: str
    configurations: int
    rms: float
    low: float
    high: float


def rate_designs(rows: np.ndarray, accuracy_rows: np.ndarray, sizes: Sequence[int], draws: np.random.Generator) -> list[Worth]:
    """Random, chosen and best possible designs.

    `rows` (N, rows, n): regressors of the candidates over the noise, in plausible sizes of the compliances. `accuracy_rows`
    (tests, 3, n): of the end-effector position where the robot shall be accurate, m per plausible size. `sizes`: configurations
    of a design.
    """
    weight = mean_squares(accuracy_rows)
    exact = Criterion(weight)
    found = []
    for size in sizes:
        random = np.array([_error(rows, draws.choice(len(rows), size, replace=False), exact) for _ in range(_RANDOM_DESIGNS)])
        low, high = np.quantile(random, [0.05, 0.95])
        found.append(Worth(RANDOM, size, float(np.sqrt((random**2).mean())), float(low), float(high)))
        for kind in CRITERIA:
            rule = criterion(kind, accuracy_rows)
            chosen = exchange_candidates(rows, choose_greedily(rows, size, rule), rule)
            error = _error(rows, chosen, exact)
            found.append(Worth(kind, size, error, error, error))
        least = float(np.sqrt(-best_value(rows, size, exact, chosen)))
        found.append(Worth(CONTINUOUS, size, least, least, least))
    return found


def _error(rows: np.ndarray, chosen: np.ndarray | list[int], exact: Criterion) -> float:
    return float(np.sqrt(-exact.value(matrix_of(rows, chosen))))
