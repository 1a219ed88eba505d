"""The files of a finished run, read by pyarrow and pandas alone, and the findings of an
audit: each check of a file is one row."""

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

# Relative difference of two programs that compute the same in double precision, in
# another order.
ROUNDING = 1e-9


class FinishedRun:
    """A finished run and its configuration.

    Files, arms and deflections are cached.

    Attributes
    ----------
    folder : folder of the run
    configuration : contents of config.yaml
    robots, strategies : contents of their files, by name
    sample : number of rows of a large file that are computed again
    seed : seed of the random numbers
    wrench_at : "end_effector" or "measuring_point" (interpretation R6)
    table, experiments, deflections, arm : cached readers
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
        self.robots = robots
        self.strategies = strategies
        self.sample = sample
        self.seed = int(configuration["seed"])
        self.wrench_at = str(configuration["interpretations"]["wrench_at"])
        # Bound the caches, because all tables of a whole study do not fit into the
        # memory of a small machine.
        self.table = lru_cache(40)(self._read_table)
        self.experiments = lru_cache(8)(self._read_experiments)
        self.deflections = lru_cache(8)(self._read_deflections)
        self.arm = lru_cache(None)(self._build_arm)

    def at(self, point: str) -> tuple[str, ...]:
        """Name the target on which the wrench acts (interpretation R6) when a point is
        observed; an empty tuple means the last target."""
        return () if self.wrench_at == "end_effector" else (point,)

    def pick(self, file: str, count: int) -> np.ndarray:
        """Draw a sample of `count` rows, in order, by the seed and the file's name."""
        generator = np.random.default_rng([self.seed, zlib.crc32(file.encode())])
        return np.sort(generator.choice(count, min(count, self.sample), replace=False))

    def document(self, file: str) -> Any:
        """Read a JSON file."""
        return json.loads((self.folder / file).read_text("utf-8"))

    def has(self, file: str) -> bool:
        """Whether the run has written a file."""
        return (self.folder / file).is_file()

    def _build_arm(self, robot: str) -> Arm:
        """Build the arm of a robot file, with the configured target offset."""
        tool_m = self.configuration["interpretations"]["tool_offset_m"]
        return Arm(self.robots[robot], tool_m=tool_m)

    def _read_table(self, file: str) -> pd.DataFrame:
        """Read a Parquet or CSV file."""
        path = self.folder / file
        if file.endswith(".parquet"):
            return pq.ParquetFile(path).read().to_pandas()
        return pd.read_csv(path)

    def _read_experiments(self, robot: str, use: str) -> tuple[np.ndarray, np.ndarray]:
        """Read joint angles (sets, configurations, n) and wrenches (sets,
        configurations, 6) for a use, "identification" or "test"."""
        subfolder = "/test" if use == "test" else ""
        frame = self.table(f"data/simulated/{robot}{subfolder}/experiments.parquet")
        sets = frame["data_set"].nunique()
        joints = self.arm(robot).joints
        angles = frame[[f"q{j}" for j in range(1, joints + 1)]].to_numpy()
        wrenches = frame[list(WRENCH)].to_numpy()
        return angles.reshape(sets, -1, joints), wrenches.reshape(sets, -1, 6)

    def _read_deflections(self, file: str, point: str) -> np.ndarray:
        """Read the deflections (sets, configurations, 6) of a measuring point."""
        rows = self.table(file).query("point == @point")
        sets = rows["data_set"].nunique()
        return rows[list(COMPONENTS)].to_numpy().reshape(sets, -1, 6)


def open_philox_stream(
    seed: int, robot: str, purpose: str, data_set: int = 0
) -> np.random.Generator:
    """Open the stream of random numbers of one purpose in one data set.

    A Philox counter generator: its key is the first 16 bytes of the SHA-256 of
    ``seed/robot``, the third word of its counter the data set, and the fourth the first
    8 bytes of the SHA-256 of the purpose.

    Parameters
    ----------
    seed : seed of the run
    robot : name of the robot's file
    purpose : purpose of the numbers
    data_set : number of the data set
    """
    digest = hashlib.sha256(f"{seed}/{robot}".encode()).digest()
    key = np.frombuffer(digest[:16], "<u8")
    use = int.from_bytes(hashlib.sha256(purpose.encode()).digest()[:8], "little")
    return np.random.Generator(np.random.Philox(key=key, counter=[0, 0, data_set, use]))


@dataclass(frozen=True)
class Finding:
    """One check of one file by an independent path.

    Attributes
    ----------
    checked : property of the file
    by : independent path
    compared : number of values
    worst : largest difference over its tolerance; a check holds up to 1
    note : found and expected value, if the check does not hold
    file : path of the file
    """

    checked: str
    by: str
    compared: int
    worst: float
    note: str = ""
    file: str = ""

    @property
    def holds(self) -> bool:
        """Whether all differences are within their tolerance."""
        return bool(self.worst <= 1.0)


def compare(
    checked: str,
    by: str,
    found: object,
    expected: object,
    relative: float = ROUNDING,
    absolute: float = 0.0,
) -> Finding:
    """Compare values of a file with those of an independent path.

    Parameters
    ----------
    checked, by : as in `Finding`
    found, expected : arrays of equal size, of the file and of the independent path
    relative : tolerance relative to the largest expected value
    absolute : tolerance to add to it
    """
    actual = np.asarray(found, float).ravel()
    desired = np.asarray(expected, float).ravel()
    count = len(desired)
    if len(actual) != count:
        note = f"found {len(actual)} values, expected {count}"
        return Finding(checked, by, count, np.inf, note)
    if not count:
        return Finding(checked, by, 0, 0.0)
    equal = (actual == desired) | (np.isnan(actual) & np.isnan(desired))
    scale = np.max(np.abs(desired[np.isfinite(desired)]), initial=0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.abs(actual - desired) / (absolute + relative * scale)
    ratio[equal] = 0.0
    # Only one value is not a number, or both differ without any tolerance.
    ratio[np.isnan(ratio)] = np.inf
    index = int(np.argmax(ratio))
    worst = float(ratio[index])
    note = f"value {index}: found {actual[index]:.9g}, expected {desired[index]:.9g}"
    return Finding(checked, by, count, worst, note if worst > 1 else "")


def require(
    checked: str, by: str, holds: Any, note: str = "", count: int = 1
) -> Finding:
    """State whether a condition on `count` values holds; the note is used only if it
    does not."""
    if holds:
        return Finding(checked, by, count, 0.0)
    return Finding(checked, by, count, np.inf, note)


def require_each_once(frame: pd.DataFrame, **ranges: Iterable[int]) -> Finding:
    """Require rows for all combinations of the ranges of some columns, with the last
    column changing fastest."""
    expected = pd.MultiIndex.from_product([*ranges.values()]).to_frame()
    checked = f"each {' and '.join(ranges).replace('_', ' ')} once"
    return compare(checked, "counting", frame[list(ranges)], expected, 0.0)
