"""What an audit has at hand, by pyarrow and pandas alone, and what it finds: each check
of a file is one row."""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from elastocal_proof.audit.arm import Arm

_Document = Mapping[str, Any]
_Documents = Mapping[str, _Document]

POSITION = ("x", "y", "z")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
COMPONENTS = ("dx", "dy", "dz", "rx", "ry", "rz")


class FinishedRun:
    """A finished run: its folder, config.yaml, robot and strategy files by name, and
    how many rows of a file are recomputed.

    Files, arms and deflections are kept once they have been read.
    """

    def __init__(
        self,
        folder: Path,
        configuration: _Document,
        robots: _Documents,
        strategies: _Documents,
        sample: int,
    ) -> None:
        self.folder = folder
        self.configuration = configuration
        self.sample = sample
        self.robots = robots
        self.strategies = strategies
        self.seed = int(configuration["seed"])
        read = configuration["interpretations"]
        self.wrench_at = str(read["wrench_at"])
        # Of a whole study all tables together are too large for a small machine.
        self.table = lru_cache(40)(self._read)
        self.experiments = lru_cache(8)(self._experiments)
        self.deflections = lru_cache(8)(self._deflections)
        self.arm = lru_cache(None)(
            lambda robot: Arm(robots[robot], tool_m=read["tool_offset_m"])
        )

    def at(self, point: str) -> tuple[str, ...]:
        """What the wrench acts on (interpretation R6) where a point is looked at: where
        none is named, the last one."""
        return () if self.wrench_at == "end_effector" else (point,)

    def pick(self, file: str, count: int) -> np.ndarray:
        """Some of so many rows, in order, drawn by the seed and the file's name."""
        generator = np.random.default_rng([self.seed, zlib.crc32(file.encode())])
        return np.sort(generator.choice(count, min(count, self.sample), replace=False))

    def document(self, file: str) -> Any:
        """A JSON file."""
        return json.loads((self.folder / file).read_text("utf-8"))

    def has(self, file: str) -> bool:
        """Whether the run has made a file."""
        return (self.folder / file).is_file()

    def _read(self, file: str) -> pd.DataFrame:
        """A Parquet or CSV file; `table` is the same, read once."""
        path = self.folder / file
        return (
            pq.ParquetFile(path).read().to_pandas()
            if file.endswith(".parquet")
            else pd.read_csv(path)
        )

    def _experiments(
        self, robot: str, test: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles (sets, configurations, n) and wrenches (sets, configurations, 6)
        as the file has them."""
        frame = self.table(
            f"data/simulated/{robot}{'/test' * test}/experiments.parquet"
        )
        sets = frame["data_set"].nunique()
        joints = self.arm(robot).joints
        angles = (
            frame[[f"q{j}" for j in range(1, joints + 1)]]
            .to_numpy()
            .reshape(sets, -1, joints)
        )
        return angles, frame[list(WRENCH)].to_numpy().reshape(sets, -1, 6)

    def _deflections(self, file: str, point: str) -> np.ndarray:
        """Deflections (sets, configurations, 6) of a measuring point as a file has
        them."""
        rows = self.table(file).query("point == @point")
        return (
            rows[list(COMPONENTS)].to_numpy().reshape(rows["data_set"].nunique(), -1, 6)
        )


def open_philox_stream(
    seed: int, robot: str, purpose: str, data_set: int = 0
) -> np.random.Generator:
    """The stream of random numbers of one purpose in one data set; `robot` is the name
    of its file.

    A Philox counter generator: its key is the first 16 bytes of the SHA-256 of
    ``seed/robot``, the third word of its counter the data set, the fourth the first 8
    bytes of the SHA-256 of what the numbers are for.
    """
    key = hashlib.sha256(f"{seed}/{robot}".encode()).digest()
    words = [int.from_bytes(key[start : start + 8], "little") for start in (0, 8)]
    use = int.from_bytes(hashlib.sha256(purpose.encode()).digest()[:8], "little")
    return np.random.Generator(
        np.random.Philox(key=np.array(words, np.uint64), counter=[0, 0, data_set, use])
    )


# Two programs that do the same in double precision, in another order.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Finding:
    """One check of one file, by an independent path.

    `compared`: how many values. `worst`: largest difference over what is allowed; a
    check holds up to 1. `note`: where it does not hold: what was found and what was
    expected.
    """

    checked: str
    by: str
    compared: int
    worst: float
    note: str = ""
    file: str = ""

    @property
    def holds(self) -> bool:
        """Whether no value is further off than allowed."""
        return bool(self.worst <= 1.0)


def compare(
    checked: str,
    by: str,
    found: object,
    expected: object,
    relative: float = ROUNDING,
    absolute: float = 0.0,
) -> Finding:
    """Values of a file beside those of an independent path; allowed: `relative` to the
    largest expected one, and `absolute`."""
    left, right = (np.asarray(each, float).ravel() for each in (found, expected))
    if left.shape != right.shape:
        return Finding(
            checked,
            by,
            len(right),
            np.inf,
            f"found {len(left)} values, expected {len(right)}",
        )
    if not len(left):
        return Finding(checked, by, 0, 0.0)
    same = (left == right) | (np.isnan(left) & np.isnan(right))
    allowed = absolute + relative * np.max(
        np.abs(right[np.isfinite(right)]), initial=0.0
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.where(same, 0.0, np.abs(left - right) / allowed)
    # Not a number beside a number, or a difference where none is allowed.
    off = np.where(np.isnan(off), np.inf, off)
    place = int(np.argmax(off))
    note = (
        ""
        if off[place] <= 1
        else f"value {place}: found {left[place]:.9g}, expected {right[place]:.9g}"
    )
    return Finding(checked, by, len(left), float(off[place]), note)


def require(
    checked: str, by: str, holds: Any, note: str = "", count: int = 1
) -> Finding:
    """A statement about so many values that holds or does not; the note is for where it
    does not."""
    return Finding(checked, by, count, 0.0 if holds else np.inf, "" if holds else note)


def require_each_once(frame: pd.DataFrame, **ranges: Iterable[int]) -> Finding:
    """Whether rows are numbered by all combinations of ranges, the last one changing
    fastest."""
    expected = pd.MultiIndex.from_product([*ranges.values()]).to_frame()
    checked = f"each {' and '.join(ranges).replace('_', ' ')} once"
    return compare(checked, "counting", frame[list(ranges)], expected, 0.0)
