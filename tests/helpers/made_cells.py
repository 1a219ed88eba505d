"""A small campaign's folder that tests spoil before they read it."""

import csv
from dataclasses import fields
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from elastocal.campaigns.campaign import Measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_campaign

ARM, DOCUMENT = yaml.safe_load(
    Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")
).values()
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
POSES = 10
LOADS = 2
REPEATS = 2


def measured():
    """Columns of a campaign: each pose unloaded and loaded, twice, two targets; numbers
    that cannot be confused."""
    rng = np.random.default_rng(3)
    angles = rng.uniform(-0.9, 0.7, (POSES, 3))
    rows = []
    for pose in range(POSES):
        for load in range(LOADS):
            wrench = load * (100.0 + np.arange(6) + pose)
            for repeat in range(REPEATS):
                for target in ("A", "B"):
                    at = angles[pose] + rng.uniform(-1e-4, 1e-4, 3)
                    seen = rng.uniform(-1, 1, 6)
                    approach = rng.choice([-1, 1], 3)
                    cells = (pose, load, repeat, target, *at, *wrench, *seen, *approach)
                    rows.append((*cells, 60.0 * len(rows), 20.0 + 0.01 * len(rows)))
    names = [
        "pose",
        "load",
        "repeat",
        "target",
        "q1",
        "q2",
        "q3",
        *WRENCH,
        *"xyz",
        "rx",
        "ry",
        "rz",
    ]
    names += ["approach1", "approach2", "approach3", "time_s", "temperature_c"]
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


class Cell:
    """A campaign's folder that a test spoils before it reads it."""

    def __init__(self, folder):
        self.robots = folder / "robots"
        self.folder = folder / "cell7"
        self.document = dict(DOCUMENT)
        self.arm = dict(ARM)
        self.table = measured()

    def without(self, *names):
        for name in names:
            del self.table[name]

    def keep(self, rows):
        """Take these rows alone, counted from 0, in this order."""
        self.table = {
            name: [column[row] for row in rows] for name, column in self.table.items()
        }

    def repeat_as_session_7(self):
        """The same rows again as another session, with targets of its own."""
        count = len(self.table["pose"])
        targets = self.document["targets"]
        names = self.table["target"] + [f"{name}2" for name in self.table["target"]]
        again = {name: 2 * column for name, column in self.table.items()}
        self.table = again | {"session": count * [0] + count * [7], "target": names}
        self.document["targets"] = targets | {
            f"{name}2": target for name, target in targets.items()
        }

    def spoil(self, row, column, cell):
        """Put something into a cell; rows are counted from 1 as in messages."""
        self.table[column][row - 1] = cell

    def write(self, kind="csv", separator=","):
        self.folder.mkdir(parents=True, exist_ok=True)
        self.robots.mkdir(exist_ok=True)
        (self.robots / "planar.yaml").write_text(yaml.safe_dump(ARM), encoding="utf-8")
        (self.folder / "arm.yaml").write_text(
            yaml.safe_dump(self.arm), encoding="utf-8"
        )
        (self.folder / "campaign.yaml").write_text(
            yaml.safe_dump(self.document, sort_keys=False), encoding="utf-8"
        )
        if kind == "parquet":
            pq.write_table(pa.table(self.table), self.folder / "measurements.parquet")
            return
        with open(
            self.folder / "measurements.csv", "w", encoding="utf-8", newline=""
        ) as file:
            writer = csv.writer(file, delimiter=separator)
            writer.writerow(self.table)
            writer.writerows(zip(*self.table.values(), strict=True))

    def read(self, **arguments):
        self.write()
        return read_campaign(self.open(), **arguments)

    def open(self):
        """The folder as it was written."""
        return read_campaign_folder(self.folder, self.robots)

    @property
    def source(self):
        return (self.folder / "campaign.yaml").as_posix()

    @property
    def measurements(self):
        return (self.folder / "measurements.csv").as_posix()


def assert_same(one, other):
    """The same measurements, value for value."""
    for field in fields(Measurements):
        left = getattr(one, field.name)
        right = getattr(other, field.name)
        assert (left is None) == (right is None), field.name
        if left is not None:
            assert left.dtype == right.dtype, field.name
            np.testing.assert_array_equal(left, right, err_msg=field.name)
