"""What the benchmarks share: a row of the report, interleaved timing, and the robots
and strategies of the repository."""

import resource
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from elastocal.io.documents import read_document
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import parse_robot
from elastocal.study.strategies import Strategy, strategy_from_document

ROOT = Path(__file__).resolve().parents[1]
# Seconds of `_yardstick` where limits in seconds are stated: two idle cores of an AMD
# EPYC; CPU time, the least of 40.
YARDSTICK_S = 0.14
Found = TypeVar("Found")


@dataclass(frozen=True)
class Row:
    """One line of reports/benchmarks.csv.

    `benchmark`: its first word is the module that measures it. `ours_s`, `theirs_s`:
    seconds; none where the benchmark does not compare times. `target`: what the ratio
    should be; empty for a row that informs only. `how`: one sentence.
    """

    benchmark: str
    ours_s: float | None
    theirs_s: float | None
    ratio: float
    target: str
    holds: bool | None
    how: str

    @classmethod
    def of_limit(
        cls, benchmark: str, seconds: float, allowed_s: float, how: str
    ) -> "Row":
        """Seconds against those that are allowed on this machine."""
        return cls(
            benchmark,
            seconds,
            allowed_s,
            seconds / allowed_s,
            "<= 1",
            seconds <= allowed_s,
            how,
        )


def interleaved(
    functions: Mapping[str, Callable[[], Any]], repetitions: int
) -> list[list[float]]:
    """CPU seconds of several functions without arguments, by the names to print, their
    processes included; a list for each.

    They are called in turn so that a busy spell of the machine hits all of them. Other
    processes only ever add to them: the least of a few is the function's own
    (documentation of `timeit`).
    """
    seconds: list[list[float]] = [[] for _ in functions]
    for repetition in range(1, repetitions + 1):
        for taken, function in zip(seconds, functions.values(), strict=True):
            start = _cpu_seconds()
            function()
            taken.append(_cpu_seconds() - start)
        last = ", ".join(
            f"{name} {taken[-1]:.3f} s"
            for name, taken in zip(functions, seconds, strict=True)
        )
        print(f"  {repetition}/{repetitions}: {last}", flush=True)
    return seconds


def _cpu_seconds() -> float:
    """Of this process and those that it has ended."""
    used = [
        resource.getrusage(who)
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    ]
    return sum(each.ru_utime + each.ru_stime for each in used)


def beside_yardstick(function: Callable[[], Found]) -> tuple[Found, float]:
    """What a function returns, and how many times as long this machine takes as the one
    for which limits in seconds are stated.

    A fixed piece of work just before and just after says so: a machine that is slow, or
    busy, is allowed more.
    """
    before = _yardstick()
    found = function()
    return found, (before + _yardstick()) / 2 / YARDSTICK_S


def _yardstick() -> float:
    """Seconds of least-squares problems of the engine's size, the mean of three
    rounds."""
    rounds = 3
    matrix = np.random.default_rng(1).standard_normal((200, 40))
    start = time.perf_counter()
    for end in 3 * rounds * [*range(41, 201)]:
        np.linalg.lstsq(matrix[:end, :-1], matrix[:end, -1])
    return (time.perf_counter() - start) / rounds


def load_robot(name: str) -> Robot:
    """Robot of config/robots."""
    path = ROOT / "config" / "robots" / f"{name}.yaml"
    return parse_robot(read_document(path), path.name)


def load_strategy(name: str) -> Strategy:
    """Strategy of config/strategies."""
    return strategy_from_document(
        read_document(ROOT / "config" / "strategies" / f"{name}.yaml")
    )
