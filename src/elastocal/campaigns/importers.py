"""Public measurements of real robots as campaigns: where they are, what their contents must be, how each format is read.

config/public_data.yaml says all of it, see its schema, but for two MAT files that are read here. All are targets on an unloaded
flange, measured by a tracker in a frame that nobody knows.
"""

from __future__ import annotations

import csv
import hashlib
import io
import logging
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from functools import cache, reduce
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # Its parts load as they are used: the rules ask importers for their files alone, at each start of Snakemake.

from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.writing import write_campaign
from elastocal.counting import counted
from elastocal.errors import InputError
from elastocal.io.documents import check_document, read_document
from elastocal.io.texts import read_bytes, read_text

# Of the sources here the largest has four megabytes.
LARGEST_BYTES = 200_000_000
# Names a folder that already has the files, for machines without a network.
FOLDER_VARIABLE = "ELASTOCAL_DATA"
_MAT = "a MAT file of version 5"


@dataclass(frozen=True)
class PublicFile:
    """One file of a public repository.

    `repository`: owner/name on GitHub. `path`: in the repository. `local`: where the file stands below a folder that has it.
    `excerpt`: a part of it, which comes with this project and cannot be downloaded.
    """

    repository: str
    commit: str
    path: str
    sha256: str
    local: str
    licence: str
    excerpt: bool = False

    @property
    def address(self) -> str:
        """Where the file is downloaded from; the commit fixes its contents."""
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{self.path}"


def find_missing(names: Iterable[str], files: Mapping[str, PublicFile], kept: str | Path, box: str | Path) -> str | None:
    """What of some files is missing where `FOLDER_VARIABLE` stands for a network.

    `files`, `box`: as in `fetch`. `kept`: folder of what was downloaded before. Returns the first file that is missing, below
    the folder of `FOLDER_VARIABLE`; None where all are there, or may be downloaded.
    """
    for name in names if os.environ.get(FOLDER_VARIABLE) else ():
        if _at_hand(files[name], box) is None and not (Path(kept) / _name_copy(name, files[name])).is_file():
            return files[name].local
    return None


def _at_hand(file: PublicFile, box: str | Path) -> Path | None:
    """The file in the project's own folder, else in that of `FOLDER_VARIABLE`."""
    folders = [box, *filter(None, [os.environ.get(FOLDER_VARIABLE)])]
    return next((path for folder in folders if (path := Path(folder) / file.local).is_file()), None)


def _name_copy(name: str, file: PublicFile) -> str:
    return f"{name}{Path(file.path).suffix}"


def fetch(name: str, files: Mapping[str, PublicFile], folder: str | Path, box: str | Path) -> Path:
    """A file of public data with the contents that this project knows: from `box` or `FOLDER_VARIABLE`, else downloaded once.

    `files`: those of the importer that reads it. `folder`: keeps what is downloaded. `box`: has what comes with this project.
    Raises `InputError`: an unknown name, a file of other contents, or no way to get it.
    """
    if name not in files:
        raise InputError("public data", "", repr(name), ", ".join(files))
    file = files[name]
    if local := _at_hand(file, box):
        found = hashlib.sha256(local.read_bytes()).hexdigest()
        if found != file.sha256:
            origin = "an excerpt of" if file.excerpt else "as in"
            raise InputError(local, "", f"SHA-256 {found}", f"{file.sha256}, {origin} {file.address}")
        return local
    if file.excerpt:
        raise InputError(Path(box) / file.local, "", "no such file", "the one that comes with this project")
    # Loads what asks a network, which the rules, who look for files alone, do without.
    import pooch

    pooch.get_logger().setLevel(logging.ERROR)
    try:
        kept = pooch.retrieve(file.address, f"sha256:{file.sha256}", _name_copy(name, file), folder)
    except ValueError as error:
        raise InputError(file.address, "", f"other contents ({error})", f"SHA-256 {file.sha256}") from None
    except OSError as error:
        allowed = f"a network, or the folder in {FOLDER_VARIABLE} with {file.local}"
        raise InputError(file.address, "", f"no download ({error})", allowed) from None
    return Path(kept)


@dataclass(frozen=True)
class Readings:
    """N measurements: `angles` (N, n) as the controller reports them, rad; `positions` (N, 3) by target, m; `others` (N,)."""

    angles: np.ndarray
    positions: Mapping[str, np.ndarray]
    others: Mapping[str, np.ndarray]


@dataclass(frozen=True)
class TextFormat:
    """How a table of angles and positions (mm) is read; keys are those of the schema."""

    kind: str
    angles: Sequence[str]
    positions: Mapping[str, Sequence[Sequence[str]]]
    separator: str = ","
    decimal: str = "."
    names: Sequence[str] = ()
    fewer_joints: int = 0
    orientation: Sequence[str] = ()
    time: str = ""
    temperature: str = ""
    angles_in: str = "deg"

    def read(self, path: str | Path) -> Readings:
        """An `InputError` names a column that is missing, or row and column of what is no number."""
        cells = self._cells(path)

        def table(names: Sequence[str]) -> np.ndarray:
            return np.column_stack([self._numbers(path, name, cells[name]) for name in names])

        there = [name for name in self.angles if name in cells]
        if there != list(self.angles) and there != list(self.angles[: self.fewer_joints] or self.angles):
            raise InputError(path, "header", f"{', '.join(there) or 'no joint'}", ", ".join(self.angles))
        angles = table(there)
        positions = {t: 1e-3 * reduce(np.add, [table(names) for names in parts]) for t, parts in self.positions.items()}
        others: dict[str, np.ndarray] = {}
        if self.orientation:
            turn = scipy.spatial.transform.Rotation.from_euler("XYZ", table(self.orientation), degrees=True)
            others |= dict(zip(("rx", "ry", "rz"), turn.as_rotvec().T, strict=True))
        if self.temperature in cells:
            others["temperature_c"] = self._numbers(path, self.temperature, cells[self.temperature])
        if (times := _times(cells.get(self.time, ()))) is not None:
            others["time_s"] = times
        return Readings(angles if self.angles_in == "rad" else np.radians(angles), positions, others)

    def _cells(self, path: str | Path) -> dict[str, tuple[str, ...]]:
        text = read_text(path, LARGEST_BYTES)
        try:
            if self.separator == "blanks":
                lines = [line.split() for line in text.split("\n")]
            else:
                lines = [*csv.reader(io.StringIO(text, newline=""), delimiter=self.separator, strict=True)]
        except csv.Error as error:
            raise InputError(path, "", str(error), f"text with columns separated by {self.separator}") from None
        lines = [line for line in lines if line]
        header, rows = (self.names, lines) if self.names else (lines[0] if lines else [], lines[1:])
        if not rows:
            raise InputError(path, "", "no row of data", self.kind)
        for number, line in enumerate(rows, 1):
            if len(line) != len(header):
                raise InputError(path, f"row {number}", counted(len(line), "cell"), f"{len(header)}, one for each column")
        needed = (*(name for parts in self.positions.values() for names in parts for name in names), *self.orientation)
        for name in (*self.angles[: self.fewer_joints or None], *needed):
            if name not in header:
                raise InputError(path, "header", f"no column {name!r}", self.kind)
        return dict(zip(header, zip(*rows, strict=True), strict=True))

    def _numbers(self, path: str | Path, name: str, cells: Sequence[str]) -> np.ndarray:
        values = np.full(len(cells), np.nan)
        for index, cell in enumerate(cells):
            with suppress(ValueError):
                values[index] = float(cell.replace(self.decimal, "."))
            if not np.isfinite(values[index]):
                allowed = f"a number with a decimal {'comma' if self.decimal == ',' else 'point'}, not infinite"
                raise InputError(path, f"row {index + 1}, column {name}", repr(cell), allowed)
        return values


def _times(cells: Iterable[str]) -> np.ndarray | None:
    """Seconds since the first row; None where there are none, or a spreadsheet has cut the stamps down to 2,02011E+13."""
    try:
        stamps = [datetime.strptime(cell, "%Y%m%d%H%M%S") for cell in cells]
    except ValueError:
        return None
    return np.array([(stamp - stamps[0]).total_seconds() for stamp in stamps]) if stamps else None


def read_mat(path: str | Path, **shapes: int) -> dict[str, np.ndarray]:
    """Variables (rows, columns) of a MAT file, by how many columns each has; all have the rows of the first."""
    content = read_bytes(path, LARGEST_BYTES, _MAT)
    # The stubs of scipy know paths alone.
    stream: Any = io.BytesIO(content)
    try:
        found: dict[str, Any] = scipy.io.loadmat(stream, variable_names=list(shapes))
    except Exception:
        # The reader lets through whatever broken bytes make of its parts; its words say nothing of the file.
        found_words = f"no readable MAT file, or one that is damaged ({counted(len(content), 'byte')})"
        raise InputError(path, "", found_words, _MAT) from None
    for name, width in shapes.items():
        shape, rows = np.shape(found.get(name, ())), len(found.get(next(iter(shapes)), ()))
        if not rows or shape != (rows, width) or found[name].dtype.kind != "f":
            raise InputError(path, name, f"shape {shape}" if name in found else "nothing", f"(measurements, {width}) numbers")
    return {name: found[name] for name in shapes}


def _read_fanuc_static(path: str | Path) -> Readings:
    found = read_mat(path, q=6, mA=3, mB=3, mC=3)
    return Readings(found["q"], {target: found[f"m{target}"] for target in "ABC"}, {})


def _read_motoman(path: str | Path) -> Readings:
    """A row for each camera image that was taken of a pose; rows of one pose repeat its joint angles and its reflector.

    Poses whose reflector the tracker did not see are left out, and so is the 13th of the larger file's 587, which the source's
    own reader (loadNewLeicaDataset.m) leaves out. The turntable stands still; its encoder's last digits move.
    """
    rows = read_mat(path, dataset=26)["dataset"]
    rows = rows[np.unique(rows[:, 0], return_index=True)[1]]
    angles, position, turntable = slice(7, 13), slice(19, 22), 6
    rows = rows[np.isfinite(rows[:, position]).all(axis=1)]
    rows = np.delete(rows, 12, axis=0) if len(rows) == 587 else rows
    if not len(rows) or not np.isfinite(rows[:, angles]).all():
        raise InputError(path, "dataset", "no pose with angles and a position", "poses of the right arm with a reflector")
    if (turned := np.abs(rows[:, turntable]).max()) > 1e-3:
        raise InputError(path, f"dataset column {turntable + 1}", f"a turntable at {turned:g} rad", "one that stands at 0")
    return Readings(rows[:, angles], {"reflector": rows[:, position]}, {})


@dataclass(frozen=True)
class Importer:
    """What makes campaigns of a public source.

    `files`: of the source, by the names that a campaign of config/campaigns has for them. `read`: a file of them. `robots`: of
    config/robots, for arms of six joints and, last, of more. `noise`: as in ``campaign.yaml``. `same_pose_rad`: as in
    `pose_and_repeat`. `parts`: importers whose files, one of each, are the sessions of one campaign; each robot's file then
    says how its source counts the angles.
    """

    files: Mapping[str, PublicFile]
    read: Callable[[str | Path], Readings]
    robots: tuple[str, ...]
    noise: Mapping[str, float] | None = None
    same_pose_rad: float = 0.0
    parts: tuple[Importer, ...] = ()

    @property
    def all_robots(self) -> tuple[str, ...]:
        """Robots that its campaigns name or that it reads."""
        return (*self.robots, *(robot for part in self.parts for robot in part.robots))

    def write_campaign(
        self,
        paths: Sequence[str | Path],
        folder: str | Path,
        robots_folder: str | Path,
        name: str,
        holdout: Mapping[str, Any] | None = None,
    ) -> None:
        """Write one file, or one of each part, as a campaign's folder; `holdout` is as in ``campaign.yaml``."""
        found = [(part, part.read(path)) for part, path in zip(self.parts or (self,), paths, strict=True)]
        tables = []
        for session, (part, readings) in enumerate(found):
            pose, repeat = pose_and_repeat(readings.angles, part.same_pose_rad)
            angles = readings.angles
            if self.parts:
                angles = read_robot(Path(robots_folder) / f"{part.robots[0]}.yaml").model_angles(angles)
            table = _table(pose, repeat, angles, readings.positions, session if self.parts else None)
            tables.append(table | dict(readings.others))
        joints = found[0][1].angles.shape[1]
        document: dict[str, Any] = {
            "campaign": name,
            "robot": self.robots[-1] if joints > 6 else self.robots[0],
            "measured": "pose" if "rx" in tables[0] else "position",
            "frame": "tracker",
            "targets": {
                target: {"point": f"{joints}DoF", "offset_m": "unknown"}
                for _, readings in found
                for target in readings.positions
            },
            "compliance": "nominal",
            # What such data can be fitted with at all before any physics is looked for.
            "declared": ["joint_offset", "link_geometry"],
        }
        document |= {"noise": dict(self.noise)} if self.noise else {}
        document |= {"holdout": dict(holdout)} if holdout else {}
        whole = {column: np.concatenate([table[column] for table in tables]) for column in tables[0]}
        write_campaign(folder, document, whole, joints)


def _table(
    pose: np.ndarray, repeat: np.ndarray, angles: np.ndarray, positions: Mapping[str, np.ndarray], session: int | None
) -> dict[str, np.ndarray]:
    """Columns of measurements, one row for each target of each measurement."""
    names, count = list(positions), len(pose)
    measured = np.stack([positions[name] for name in names], axis=1).reshape(-1, 3)
    rows = np.repeat(np.arange(count), len(names))
    table = {} if session is None else {"session": np.full(len(rows), session)}
    table |= {"pose": pose[rows], "load": np.zeros(len(rows), int), "repeat": repeat[rows], "target": np.tile(names, count)}
    table |= {f"q{j + 1}": column[rows] for j, column in enumerate(angles.T)}
    return table | dict(zip("xyz", measured.T, strict=True))


def pose_and_repeat(joint_angles: np.ndarray, tolerance_rad: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Number poses by their joint angles: single-linkage clusters by the largest difference, cut at the tolerance.

    Gower and Ross, Minimum spanning trees and single linkage cluster analysis, Applied Statistics 18, 1969. `joint_angles`
    (N, n). Returns `pose`, `repeat` (N,): poses from 0 in the order in which they first come, repeats of each from 0.
    """
    # Not at each start of Snakemake either.
    import pandas as pd

    count = len(joint_angles)
    pairs = scipy.spatial.KDTree(joint_angles).query_pairs(tolerance_rad, p=np.inf, output_type="ndarray")
    graph = scipy.sparse.coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    label = scipy.sparse.csgraph.connected_components(graph, directed=False)[1]
    pose = pd.Series(pd.factorize(label)[0], dtype=np.int32)
    return pose.to_numpy(), pose.groupby(pose).cumcount().to_numpy(np.int32)


_MAT_FILES: dict[str, Callable[[str | Path], Readings]] = {"fanuc_static": _read_fanuc_static, "motoman": _read_motoman}


@cache
def read_importers(path: Path) -> dict[str, Importer]:
    """Importers of ``public_data.yaml`` by the names that ``importer`` of a campaign may have."""
    document = read_document(path)
    check_document(document, "public_data", path.as_posix())
    found: dict[str, Importer] = {}
    for name, entry in document.items():
        files = {each: PublicFile(**(entry["source"] | file)) for each, file in entry.get("files", {}).items()}
        read = TextFormat(**entry["table"]).read if "table" in entry else _MAT_FILES.get(name, _no_file)
        parts = tuple(found[part] for part in entry.get("parts", ()))
        files |= {each: file for part in parts for each, file in part.files.items()}
        stated = {key: entry[key] for key in ("noise", "same_pose_rad") if key in entry}
        found[name] = Importer(files, read, tuple(entry["robots"]), **stated, parts=parts)
    return found


def _no_file(path: str | Path) -> Readings:
    raise InputError(path, "", "no format", "an importer with a table, or parts that have one")


def importer(name: str, config: str | Path, source: str | Path) -> Importer:
    """An importer of the folder ``config``; an InputError that names `source`, the file that names it, refuses another name."""
    known = read_importers(Path(config) / "public_data.yaml")
    if name not in known:
        raise InputError(source, "importer", repr(name), ", ".join(known))
    return known[name]
