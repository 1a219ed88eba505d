"""The campaigns that a configuration names: public measurements of real robots, read as
campaigns, and the user's own.

config/public_data.yaml says where public measurements are, what their contents must be
and how each table is read, see its schema, but for two MAT files that are read here.
All are targets on an unloaded flange, measured by a tracker in a frame that nobody
knows.
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from elastocal.campaigns.campaign_folder import CampaignFolder, read_campaign_folder
from elastocal.campaigns.holdout import number_close_points
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.writing import write_campaign
from elastocal.errors import InputError
from elastocal.io.documents import (
    check_document,
    document_path,
    read_document,
    read_named_document,
)
from elastocal.io.json_files import read_json
from elastocal.io.plugins import IMPORTERS, load_plugins

# Names a folder that already has the files, for machines without a network.
FOLDER_VARIABLE = "ELASTOCAL_DATA"


@dataclass(frozen=True)
class PublicFile:
    """One file of a public repository, or an excerpt of it that comes with this
    project.

    `repository`: owner/name on GitHub. `path`: in the repository. `local`: where the
    file stands below a folder that has it.
    """

    repository: str
    commit: str
    path: str
    sha256: str
    local: str
    licence: str

    @property
    def address(self) -> str:
        """Where the file is downloaded from; the commit fixes its contents."""
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{self.path}"


def find_missing(
    names: Iterable[str],
    files: Mapping[str, PublicFile],
    kept: str | Path,
    box: str | Path,
) -> str | None:
    """The first of some files that is missing where `FOLDER_VARIABLE` stands for a
    network, see `fetch`; None without it."""
    offline = os.environ.get(FOLDER_VARIABLE)
    return next(
        (
            files[name].local
            for name in names
            if offline and not _at_hand(name, files[name], kept, box)
        ),
        None,
    )


def _at_hand(
    name: str, file: PublicFile, kept: str | Path, box: str | Path
) -> Path | None:
    """The file in the project's own folder, in that of `FOLDER_VARIABLE`, or as it was
    downloaded."""
    given = os.environ.get(FOLDER_VARIABLE)
    places = [
        Path(box, file.local),
        *([Path(given, file.local)] if given else []),
        Path(kept, _name_copy(name, file)),
    ]
    return next((path for path in places if path.is_file()), None)


def _name_copy(name: str, file: PublicFile) -> str:
    return f"{name}{Path(file.path).suffix}"


def fetch(
    name: str, files: Mapping[str, PublicFile], folder: str | Path, box: str | Path
) -> Path:
    """A file of public data with the contents that this project knows: from `box` or
    `FOLDER_VARIABLE`, else downloaded once.

    `files`: those of the importer that reads it. `folder`: keeps what is downloaded.
    `box`: has what comes with this project. Raises `InputError`: an unknown name, a
    file of other contents, or no way to get it.
    """
    if name not in files:
        raise InputError("public data", "", repr(name), ", ".join(files))
    file = files[name]
    if path := _at_hand(name, file, folder, box):
        if (found := hashlib.sha256(path.read_bytes()).hexdigest()) != file.sha256:
            raise InputError(
                path, "", f"SHA-256 {found}", f"{file.sha256}, of {file.address}"
            )
        return path
    # Loads what asks a network, which the rules, who look for files alone, do without.
    import pooch

    pooch.get_logger().setLevel(logging.ERROR)
    try:
        return Path(
            pooch.retrieve(
                file.address, f"sha256:{file.sha256}", _name_copy(name, file), folder
            )
        )
    except ValueError as error:
        raise InputError(
            file.address, "", f"other contents ({error})", f"SHA-256 {file.sha256}"
        ) from None
    except OSError as error:
        allowed = f"a network, or the folder in {FOLDER_VARIABLE} with {file.local}"
        raise InputError(file.address, "", f"no download ({error})", allowed) from None


class PublicMeasurements(NamedTuple):
    """N measurements: `angles` (N, n) as the controller reports them, rad; `positions`
    (N, 3) by target, m; `others` (N,)."""

    angles: np.ndarray
    positions: Mapping[str, np.ndarray]
    others: Mapping[str, np.ndarray]


def _read_text(table: Mapping[str, Any], path: str | Path) -> PublicMeasurements:
    """A table of text as its entry, `table`, says; an `InputError` names what is no
    such table, or a column that is missing."""
    # Neither pandas nor the parts of scipy load at each start of Snakemake, whose rules
    # ask importers for their files alone.
    import pandas as pd

    separator = (
        r"\s+" if table.get("separator") == "blanks" else table.get("separator", ",")
    )
    others: dict[str, np.ndarray] = {}
    try:
        text = pd.read_csv(
            path,
            sep=separator,
            decimal=table.get("decimal", "."),
            names=table.get("names"),
            index_col=False,
        )
        angles = text[[name for name in table["angles"] if name in text]].to_numpy(
            float
        )
        positions = {
            target: 1e-3 * sum(text[part].to_numpy(float) for part in parts)
            for target, parts in table["positions"].items()
        }
        if turn := table.get("orientation"):
            vectors = scipy.spatial.transform.Rotation.from_euler(
                "XYZ", text[turn].to_numpy(float), degrees=True
            ).as_rotvec()
            others |= dict(zip(("rx", "ry", "rz"), vectors.T, strict=True))
        if table.get("temperature") in text:
            others["temperature_c"] = text[table["temperature"]].to_numpy(float)
    except (KeyError, ValueError, OSError) as error:
        raise InputError(path, "", str(error), table["kind"]) from None
    # Where a spreadsheet has cut the stamps down to 2,02011E+13 there are none.
    if table.get("time") in text and pd.api.types.is_integer_dtype(text[table["time"]]):
        stamps = pd.to_datetime(text[table["time"]].astype(str), format="%Y%m%d%H%M%S")
        others["time_s"] = (stamps - stamps[0]).dt.total_seconds().to_numpy()
    return PublicMeasurements(
        angles if table.get("angles_in") == "rad" else np.radians(angles),
        positions,
        others,
    )


def _read_fanuc_static(path: str | Path) -> PublicMeasurements:
    found = scipy.io.loadmat(path)
    return PublicMeasurements(
        found["q"], {target: found[f"m{target}"] for target in "ABC"}, {}
    )


def _read_motoman(path: str | Path) -> PublicMeasurements:
    """A row for each camera image that was taken of a pose; rows of one pose repeat its
    joint angles and its reflector.

    Poses whose reflector the tracker did not see are left out, and so is the 13th of
    the larger file's 587, which the source's own reader (loadNewLeicaDataset.m) leaves
    out. The turntable stands still; its encoder's last digits move.
    """
    rows = scipy.io.loadmat(path)["dataset"]
    rows = rows[np.unique(rows[:, 0], return_index=True)[1]]
    rows = rows[np.isfinite(rows[:, 19:22]).all(axis=1)]
    rows = np.delete(rows, 12, axis=0) if len(rows) == 587 else rows
    return PublicMeasurements(rows[:, 7:13], {"reflector": rows[:, 19:22]}, {})


_MAT_FILES = {"fanuc_static": _read_fanuc_static, "motoman": _read_motoman}


@dataclass(frozen=True)
class Importer:
    """What makes campaigns of a public source: an entry of ``public_data.yaml``, whose
    schema says what its keys mean.

    `files`: by the names that campaigns have for them, those of its parts too. `read`:
    makes measurements of a file; of an importer with parts each has its own. `robots`:
    that its campaigns name, and those of its parts, which it reads.
    """

    files: Mapping[str, PublicFile]
    read: Callable[[str | Path], PublicMeasurements]
    robots: tuple[str, ...]
    noise: Mapping[str, float] | None = None
    same_pose_rad: float = 0.0
    parts: tuple[Importer, ...] = ()

    def write_campaign(
        self,
        paths: Sequence[str | Path],
        folder: str | Path,
        robots_folder: str | Path,
        name: str,
        **test: Mapping[str, Any],
    ) -> None:
        """Write one file, or one of each part, as a campaign's folder.

        `test`: ``holdout`` as in ``campaign.yaml``, or ``fold``: which `number`, from
        1, `of` so many folds is held out, whose poses are dealt out in turn:
        cross-validation by whole poses (Geisser, The predictive sample reuse method
        with applications, JASA 70, 1975).
        """
        import pandas as pd

        tables = []
        targets = list[str]()
        joints = 6
        for session, (part, path) in enumerate(
            zip(self.parts or (self,), paths, strict=True)
        ):
            angles, positions, others = part.read(path)
            joints = angles.shape[1]
            # Poses are numbered as they first come.
            pose = number_close_points(angles, part.same_pose_rad)
            repeat = pd.Series(pose).groupby(pose).cumcount().to_numpy()
            if self.parts:
                angles = read_robot(
                    Path(robots_folder) / f"{part.robots[0]}.yaml"
                ).model_angles(angles)
            # One row for each target of each measurement.
            names = list(positions)
            rows = np.repeat(np.arange(len(pose)), len(positions))
            table = {"session": np.full(len(rows), session)} if self.parts else {}
            table |= {
                "pose": pose[rows],
                "load": np.zeros(len(rows), int),
                "repeat": repeat[rows],
            }
            table |= {"target": np.tile(names, len(pose))} | {
                f"q{j + 1}": column[rows] for j, column in enumerate(angles.T)
            }
            place = np.stack([*positions.values()], axis=1).reshape(-1, 3)
            tables.append(table | dict(zip("xyz", place.T, strict=True)) | dict(others))
            targets += names
        whole = {
            column: np.concatenate([table[column] for table in tables])
            for column in tables[0]
        }
        document: dict[str, Any] = {
            "campaign": name,
            "robot": self.robots[-1] if joints > 6 else self.robots[0],
            "measured": "pose" if "rx" in whole else "position",
            "frame": "tracker",
            "targets": {
                target: {"point": f"{joints}DoF", "offset_m": "unknown"}
                for target in targets
            },
            "compliance": "nominal",
            # What such data can be fitted with at all before any physics is looked for.
            "declared": ["joint_offset", "link_geometry"],
        }
        document |= {"noise": dict(self.noise)} if self.noise else {}
        if fold := test.get("fold"):
            pairs = np.unique(
                np.column_stack(
                    [whole.get("session", 0 * whole["pose"]), whole["pose"]]
                ),
                axis=0,
            )
            test = {
                "holdout": {"poses": pairs[fold["number"] - 1 :: fold["of"]].tolist()}
            }
        document |= {key: dict(value) for key, value in test.items()}
        write_campaign(folder, document, whole, joints)


@cache
def read_importers(path: Path) -> dict[str, Importer]:
    """Importers of ``public_data.yaml`` by the names that ``find_importer`` of a campaign
    may have."""
    document = read_document(path)
    check_document(document, "public_data", path.as_posix())
    found: dict[str, Importer] = {}
    for name, entry in document.items():
        files = {
            each: PublicFile(**(entry["source"] | file))
            for each, file in entry.get("files", {}).items()
        }
        parts = tuple(found[part] for part in entry.get("parts", ()))
        own = (
            partial(_read_text, entry["table"])
            if "table" in entry
            else _MAT_FILES.get(name)
        )
        if (read := parts[0].read if parts else own) is None:
            raise InputError(path, name, "no format", "a table, or parts that have one")
        files |= {each: file for part in parts for each, file in part.files.items()}
        stated = {key: entry[key] for key in ("noise", "same_pose_rad") if key in entry}
        robots = (*entry["robots"], *(robot for part in parts for robot in part.robots))
        found[name] = Importer(files, read, robots, **stated, parts=parts)
    return found


def find_importer(name: str, config: str | Path, source: str | Path) -> Importer:
    """An importer of the folder ``config``, or one that an installed package offers.

    Raises `InputError`, which names `source`, the file that asks for the importer:
    there is no importer of this name.
    """
    importers = read_importers(Path(config) / "public_data.yaml")
    if name not in importers:
        # Look for plug-ins only now: each start of Snakemake asks for importers.
        importers = importers | load_plugins(IMPORTERS, Importer, importers)
    if name not in importers:
        raise InputError(source, "importer", repr(name), ", ".join(importers))
    return importers[name]


def read_campaign_sources(
    config: Mapping[str, Any], folder: str | Path, source: str = "config.yaml"
) -> dict[str, dict[str, Any]]:
    """Documents of the campaigns that a configuration names, by the names of their
    files in `folder`, checked.

    A simulated one has the document of its robot under ``robot_document``. `source`:
    file of the configuration.
    """
    found = {}
    for name in list_campaigns(config):
        document = read_named_document(
            folder, "campaigns", "campaign_source", name, source
        )
        path = document_path(folder, "campaigns", name)
        if document["source"] == "public":
            find_importer(document["importer"], folder, path)
        else:
            document["robot_document"] = read_named_document(
                folder, "robots", "robot", document["robot"], path
            )
            read_named_document(
                folder, "robots", "robot", document["declared_robot"], path
            )
        found[name] = document
    return found


def list_campaigns(config: Mapping[str, Any]) -> list[str]:
    """Campaigns that a configuration names, each once: simulated, measured, of the
    default run and of the league."""
    looped = (
        name
        for key in ("campaigns", "measured", "main")
        for name in config["loop"][key]
    )
    return list(dict.fromkeys((*looped, *list_league_data(config))))


def list_league_data(config: Mapping[str, Any]) -> list[str]:
    """Data sets of all leagues, each once."""
    return list(
        dict.fromkeys(
            data
            for robots in config["league"]["data"].values()
            for names in robots.values()
            for data in names
        )
    )


def find_user_campaign(
    config: Mapping[str, Any], robots_folder: str | Path, results: str | Path
) -> dict[str, CampaignFolder]:
    """Return the user's own campaign by its name; empty if the configuration has none.

    The path of the folder is spelled in one way, however the user spelled it.

    Parameters
    ----------
    config : configuration; ``campaign`` is the user's folder.
    robots_folder : folder with the robot files that a campaign may name.
    results : folder with the results of each campaign in a folder of its name.

    Raises
    ------
    InputError
        If a document of the campaign is faulty, or if its name belongs to a campaign of
        this project or to another folder whose results are there.
    """
    if not config.get("campaign"):
        return {}
    # YAML reads a folder named 2026 as a number.
    path = Path(str(config["campaign"])).resolve()
    # Snakemake would take another spelling of the same folder for another folder.
    if path.is_relative_to(Path.cwd()):
        path = path.relative_to(Path.cwd())
    folder = read_campaign_folder(path, robots_folder)
    for file in folder.files():
        if set(file) & set("{}"):
            allowed = "a path without braces, which Snakemake takes for wildcards"
            raise InputError(file, "", "braces", allowed)
    name = folder.name
    if name in list_campaigns(config):
        allowed = "a name that no campaign of config.yaml has"
        raise InputError(folder.source, "campaign", repr(name), allowed)
    earlier_path = _folder_of_results(Path(results, name))
    if earlier_path is not None and not earlier_path.samefile(path):
        found = f"{name!r}, whose results are of {earlier_path.as_posix()}"
        allowed = f"another name, or first take away {Path(results, name).as_posix()}"
        raise InputError(folder.source, "campaign", found, allowed)
    return {name: folder}


def _folder_of_results(results: Path) -> Path | None:
    """Return the campaign's folder whose results lie in a folder; None if there are no
    results, if they do not name it, or if it no longer exists."""
    try:
        source = read_json(results / "campaign.json")["source"]
        folder = Path(source).parent
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return folder if folder.is_dir() else None
