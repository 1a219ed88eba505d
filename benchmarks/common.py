"""What the benchmarks share: a row of the report, interleaved timing, and the robots and strategies of the repository."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elastocal.io.documents import read_document
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.strategies import Strategy, strategy_from_document

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Row:
    """One line of reports/benchmarks.csv.

    Attributes
    ----------
    benchmark : str
        Its first word is the module that measures it.
    ours_s, theirs_s : float or None
        Seconds; none where the benchmark does not compare times.
    ratio : float
    target : str
        What the ratio should be; empty for a row that informs only.
    holds : bool or None
    how : str
        One sentence.
    """

    benchmark: str
    ours_s: float | None
    theirs_s: float | None
    ratio: float
    target: str
    holds: bool | None
    how: str


def interleaved(functions: Mapping[str, Callable[[], Any]], repetitions: int) -> list[list[float]]:
    """Seconds of several functions, called in turn so that a busy spell of the machine hits all of them.

    Parameters
    ----------
    functions : dict of str to callable
        Without arguments, by the names to print.
    repetitions : int

    Returns
    -------
    list of list of float
        For each function its seconds, one for each repetition.
    """
    seconds: list[list[float]] = [[] for _ in functions]
    for repetition in range(1, repetitions + 1):
        for taken, function in zip(seconds, functions.values(), strict=True):
            start = time.perf_counter()
            function()
            taken.append(time.perf_counter() - start)
        last = ", ".join(f"{name} {taken[-1]:.3f} s" for name, taken in zip(functions, seconds, strict=True))
        print(f"  {repetition}/{repetitions}: {last}", flush=True)
    return seconds


def load_robot(name: str) -> Robot:
    """Robot of config/robots."""
    path = ROOT / "config" / "robots" / f"{name}.yaml"
    return robot_from_document(read_document(path), path.name)


def load_strategy(name: str) -> Strategy:
    """Strategy of config/strategies."""
    return strategy_from_document(read_document(ROOT / "config" / "strategies" / f"{name}.yaml"))
