"""The folder of a small campaign that tests change before they read it."""

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


def make_columns():
    """Make the columns of a campaign: each pose is measured unloaded and loaded, with
    two repeats of two targets. All numbers differ."""
    rng = np.random.default_rng(3)
    angles = rng.uniform(-0.9, 0.7, (POSES, 3))
    rows = []
    for pose in range(POSES):
        for load in range(LOADS):
            wrench = load * (100.0 + np.arange(6) + pose)
            for repeat in range(REPEATS):
                for target in ("A", "B"):
                    reported = angles[pose] + rng.uniform(-1e-4, 1e-4, 3)
                    measured = rng.uniform(-1, 1, 6)
                    approach = rng.choice([-1, 1], 3)
                    cells = (pose, load, repeat, target, *reported, *wrench)
                    cells = (*cells, *measured, *approach)
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
    """The folder of a campaign that a test changes before it reads it."""

    def __init__(self, folder):
        self.robots = folder / "robots"
        self.folder = folder / "cell7"
        self.document = dict(DOCUMENT)
        self.arm = dict(ARM)
        self.table = make_columns()

    def without(self, *names):
        """Remove columns of the measurements."""
        for name in names:
            del self.table[name]

    def keep(self, rows):
        """Keep only these rows, counted from 0, in this order."""
        for name, column in self.table.items():
            self.table[name] = [column[row] for row in rows]

    def repeat_as_session_7(self):
        """Add the same rows as another session, with its own targets."""
        count = len(self.table["pose"])
        targets = self.document["targets"]
        names = self.table["target"] + [f"{name}2" for name in self.table["target"]]
        doubled = {name: 2 * column for name, column in self.table.items()}
        self.table = doubled | {"session": count * [0] + count * [7], "target": names}
        self.document["targets"] = targets | {
            f"{name}2": target for name, target in targets.items()
        }

    def spoil(self, row, column, cell):
        """Replace a cell; rows are counted from 1, as in messages."""
        self.table[column][row - 1] = cell

    def write(self, kind="csv", separator=","):
        """Write the folder and the robots next to it."""
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
        """Write the folder, and read the campaign from it."""
        self.write()
        return read_campaign(self.open(), **arguments)

    def open(self):
        """Open the folder as it was written."""
        return read_campaign_folder(self.folder, self.robots)

    @property
    def source(self):
        return (self.folder / "campaign.yaml").as_posix()

    @property
    def measurements(self):
        return (self.folder / "measurements.csv").as_posix()


def assert_same(measurements, expected):
    """Check that two measurements are equal, value for value."""
    for field in fields(Measurements):
        values = getattr(measurements, field.name)
        expected_values = getattr(expected, field.name)
        assert (values is None) == (expected_values is None), field.name
        if values is not None:
            assert values.dtype == expected_values.dtype, field.name
            np.testing.assert_array_equal(values, expected_values, err_msg=field.name)
