"""What an audit has at hand: the finished run's folder and what was configured; tables are read by pyarrow and pandas alone."""

from __future__ import annotations

import json
import zlib
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from elastocal_proof.audit.arm import Arm

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path


COMPONENTS = ("dx", "dy", "dz", "rx", "ry", "rz")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
_KEPT_TABLES, _KEPT_ARRAYS = 40, 8


class Audited:
    """A finished run; files, arms and regressors are kept once they have been read or worked out.

    `folder`: with data/, results/ and reports/. `configuration`: as in config.yaml. `robots`, `strategies`: the files of these
    names. `sample`: rows of each file that are recomputed.
    """

    def __init__(
        self,
        folder: Path,
        configuration: Mapping[str, Any],
        robots: Mapping[str, Mapping[str, Any]],
        strategies: Mapping[str, Mapping[str, Any]],
        sample: int,
    ) -> None:
        self.folder, self.configuration, self.sample = folder, configuration, sample
        self.robots, self.strategies = robots, strategies
        # Of a whole study all tables together are too large for a small machine.
        self.table = lru_cache(_KEPT_TABLES)(self._read)
        self.experiments = lru_cache(_KEPT_ARRAYS)(self._experiments)
        self.deflections = lru_cache(_KEPT_ARRAYS)(self._deflections)
        self.arm = lru_cache(None)(self._arm)
        self.regressor = lru_cache(None)(self._regressor)

    @property
    def seed(self) -> int:
        """Seed of the run."""
        return int(self.configuration["seed"])

    @property
    def wrench_at(self) -> str:
        """Interpretation R6."""
        return str(self.configuration["interpretations"]["wrench_at"])

    @property
    def noise_m(self) -> float:
        """Noise of the tables."""
        return 1e-6 * float(self.configuration["tables"]["noise_um"])

    @property
    def rows(self) -> int:
        """Measurements of a point in a configuration."""
        return 6 if self.configuration["interpretations"]["measured"] == "pose" else 3

    @cached_property
    def keys(self) -> dict[str, str]:
        """Names of the files of strategies by the names that they print."""
        return {document["name"]: key for key, document in self.strategies.items()}

    @property
    def reduced(self) -> list[str]:
        """Robots of the study without elastic links."""
        return [name for name in self.configuration["robots"] if "links" not in self.robots[name]]

    @property
    def extended(self) -> list[str]:
        """Robots of the study with elastic links."""
        return [name for name in self.configuration["robots"] if "links" in self.robots[name]]

    def cell(self, kind: str, robot: str, key: str, noise_um: float | None = None) -> pd.DataFrame:
        """Results of one kind, robot and strategy, at the noise of the tables where no other is named."""
        noise = self.configuration["tables"]["noise_um"] if noise_um is None else noise_um
        return self.table(f"results/{kind}/{robot}/{noise:g}um/{key}.parquet")

    def pick(self, file: str, count: int, most: int | None = None) -> np.ndarray:
        """Some of so many rows, in order, drawn by the seed and the file's name."""
        generator = np.random.default_rng([self.seed, zlib.crc32(file.encode())])
        return np.sort(generator.choice(count, min(count, most or self.sample), replace=False))

    def pick_rows(self, file: str, frame: pd.DataFrame, most: int | None = None) -> Iterator[pd.Series]:
        """Some rows of a table."""
        return (frame.iloc[place] for place in self.pick(file, len(frame), most))

    def document(self, file: str) -> Any:
        """A JSON file."""
        return json.loads((self.folder / file).read_text("utf-8"))

    def metadata(self, file: str) -> dict[str, Any]:
        """The entries of a Parquet file's own metadata that the pipeline wrote."""
        raw = pq.ParquetFile(self.folder / file).metadata.metadata or {}
        return {key.decode(): json.loads(value) for key, value in raw.items() if key.startswith(b"elastocal.")}

    def has(self, file: str) -> bool:
        """Whether the run has made a file."""
        return (self.folder / file).is_file()

    def regressors(self, robot: str, data_set: int, length: int, points: list[str]) -> np.ndarray:
        """Regressors of the first configurations of a data set, one below the other, point by point."""
        rows = [self.regressor(robot, data_set, k, point)[: self.rows] for point in points for k in range(length)]
        return np.concatenate(rows)

    def _read(self, file: str) -> pd.DataFrame:
        """A Parquet or CSV file; `table` is the same, read once."""
        path = self.folder / file
        return pq.ParquetFile(path).read().to_pandas() if file.endswith(".parquet") else pd.read_csv(path)

    def _arm(self, robot: str, diameter: float = 1.0) -> Arm:
        """The robot by pinocchio and MuJoCo."""
        return Arm(self.robots[robot], self.configuration["interpretations"]["tool_offset_m"], diameter)

    def _experiments(self, robot: str, test: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles (sets, configurations, n) and wrenches (sets, configurations, 6) as the file has them."""
        frame = self.table(f"data/simulated/{robot}{'/test' * test}/experiments.parquet")
        sets, joints = frame["data_set"].nunique(), self.arm(robot).joints
        angles = frame[[f"q{j}" for j in range(1, joints + 1)]].to_numpy().reshape(sets, -1, joints)
        return angles, frame[list(WRENCH)].to_numpy().reshape(sets, -1, 6)

    def _deflections(self, file: str, point: str) -> np.ndarray:
        """Deflections (sets, configurations, 6) of a measuring point as a file has them."""
        rows = self.table(file).query("point == @point")
        return rows[list(COMPONENTS)].to_numpy().reshape(rows["data_set"].nunique(), -1, 6)

    def _regressor(self, robot: str, data_set: int, configuration: int, point: str, test: bool = False) -> np.ndarray:
        """Matrix A (6, n) of equation 10 by pinocchio."""
        angles, wrench = (each[data_set, configuration] for each in self.experiments(robot, test))
        return self.arm(robot).regressor(angles, wrench, point, self.wrench_at)
