"""Rows of the report, interleaved timing, and robots and strategies for benchmarks."""

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
ROBOTS = ROOT / "config" / "robots"
# Seconds of `_yardstick` on the machine for which limits in seconds are stated: two idle
# cores of an AMD EPYC, the smallest CPU time of 40 runs.
YARDSTICK_S = 0.14
Result = TypeVar("Result")


@dataclass(frozen=True)
class Row:
    """One line of reports/benchmarks.csv.

    Attributes
    ----------
    benchmark : str
        Its first word is the module that measures it.
    ours_s, theirs_s : float, optional
        Seconds; None if the benchmark does not compare times.
    ratio : float
    target : str
        Required ratio; empty if there is none.
    holds : bool, optional
    how : str
        One sentence on the measurement.
    """

    benchmark: str
    ours_s: float | None
    theirs_s: float | None
    ratio: float
    target: str
    holds: bool | None
    how: str

    @classmethod
    def of_slowdown(
        cls, benchmark: str, ours_s: float, theirs_s: float, largest: float, how: str
    ) -> "Row":
        """Require that ours takes at most `largest` times as long as theirs."""
        ratio = ours_s / theirs_s
        target = f"<= {largest:g}"
        return cls(benchmark, ours_s, theirs_s, ratio, target, ratio <= largest, how)

    @classmethod
    def of_speedup(
        cls, benchmark: str, ours_s: float, theirs_s: float, smallest: float, how: str
    ) -> "Row":
        """Require that theirs takes at least `smallest` times as long as ours."""
        ratio = theirs_s / ours_s
        target = f">= {smallest:g}"
        return cls(benchmark, ours_s, theirs_s, ratio, target, ratio >= smallest, how)

    @classmethod
    def of_limit(
        cls, benchmark: str, seconds: float, allowed_s: float, how: str
    ) -> "Row":
        """Compare seconds with those that are allowed on this machine."""
        return cls.of_slowdown(benchmark, seconds, allowed_s, 1.0, how)


def interleaved(
    functions: Mapping[str, Callable[[], Any]], repetitions: int
) -> list[list[float]]:
    """Measure the CPU seconds of several functions, including their processes.

    The functions are called in turn, so that a busy spell of the machine affects all of
    them. Other processes can only add to a time, so the smallest of several is that of
    the function itself (documentation of `timeit`).

    Parameters
    ----------
    functions : mapping
        Functions without arguments by the names to print.
    repetitions : int

    Returns
    -------
    list of lists
        Seconds of all calls, a list for each function.
    """
    seconds: list[list[float]] = [[] for _ in functions]
    for repetition in range(1, repetitions + 1):
        for times, function in zip(seconds, functions.values(), strict=True):
            times.append(measure_cpu(function)[1])
        last = ", ".join(
            f"{name} {times[-1]:.3f} s"
            for name, times in zip(functions, seconds, strict=True)
        )
        print(f"  {repetition}/{repetitions}: {last}", flush=True)
    return seconds


def measure_cpu(function: Callable[[], Result]) -> tuple[Result, float]:
    """Call a function; return its result and the CPU seconds that it takes, those of
    its processes included."""
    start = _cpu_seconds()
    result = function()
    return result, _cpu_seconds() - start


def _cpu_seconds() -> float:
    """CPU seconds of this process and of its ended child processes."""
    usages = [
        resource.getrusage(who)
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    ]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def beside_yardstick(function: Callable[[], Result]) -> tuple[Result, float]:
    """Call a function, and compare this machine with that of the stated limits.

    A fixed piece of work is timed just before and just after the call, so that a slow
    or busy machine is allowed more time.

    Returns
    -------
    result
        Return value of the function.
    float
        How many times as long this machine takes for the same work.
    """
    before = _yardstick()
    result = function()
    return result, (before + _yardstick()) / 2 / YARDSTICK_S


def compare_processor() -> float:
    """Compare the CPU time of a fixed piece of work with that of the machine of the
    stated limits: how many times as long this one takes."""
    return _yardstick(time.process_time) / YARDSTICK_S


def _yardstick(clock: Callable[[], float] = time.perf_counter) -> float:
    """Time least-squares problems of the engine's size; mean seconds of three rounds."""
    rounds = 3
    matrix = np.random.default_rng(1).standard_normal((200, 40))
    start = clock()
    for end in 3 * rounds * [*range(41, 201)]:
        np.linalg.lstsq(matrix[:end, :-1], matrix[:end, -1])
    return (clock() - start) / rounds


def read_robot_document(name: str) -> dict[str, Any]:
    """Read a file of config/robots."""
    return read_document(ROBOTS / f"{name}.yaml")


def load_robot(name: str) -> Robot:
    """Load a robot of config/robots."""
    return parse_robot(read_robot_document(name), f"{name}.yaml")


def load_strategy(name: str) -> Strategy:
    """Load a strategy of config/strategies."""
    return strategy_from_document(
        read_document(ROOT / "config" / "strategies" / f"{name}.yaml")
    )
