"""Find the campaigns that a configuration names: public measurements of real robots,
which are imported, simulated ones, and the user's own.

config/public_data.yaml states where public measurements are, their digests, and how
each table is read; two MAT files are read by functions of this module. All are targets
on an unloaded flange, measured by a tracker whose frame is unknown.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from elastocal.campaigns.campaign import GEOMETRY
from elastocal.campaigns.campaign_folder import (
    CampaignFolder,
    check_workflow_path,
    read_campaign_folder,
)
from elastocal.campaigns.holdout import number_close_points
from elastocal.campaigns.measurements import (
    name_joint_columns,
    tabulate_single_measurements,
)
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.socket_recordings import (
    SOCKET_DISTANCE_M,
    describe_sockets,
    read_recording,
    tabulate_recordings,
)
from elastocal.campaigns.writing import write_campaign
from elastocal.errors import InputError
from elastocal.io.documents import (
    check_document,
    locate_document,
    read_document,
    read_named_document,
)
from elastocal.io.json_files import read_json
from elastocal.io.plugins import IMPORTERS, load_plugins
from elastocal.io.records import refuse_other_contents

# Environment variable: a folder that already has the files, for machines without a
# network.
FOLDER_VARIABLE = "ELASTOCAL_DATA"
# Robots with more joints than this are the last of an importer's robots.
_JOINTS_OF_FIRST_ROBOT = 6


@dataclass(frozen=True)
class PublicFile:
    """One file of a public repository, or an excerpt of it that comes with this
    project.

    Attributes
    ----------
    repository : owner/name on GitHub.
    commit : version of the repository.
    path : file in the repository.
    sha256 : digest of the contents.
    local : path of the file below a folder that has it.
    licence : licence of the data.
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
    """Find the first file that is missing on a machine without a network.

    Parameters
    ----------
    names : files to look for.
    files : all files of the importer, by name.
    kept : folder with downloads.
    box : folder with the files that come with this project.

    Returns
    -------
    Path of the file below a folder that has it; None if all files are present, or if
    `FOLDER_VARIABLE` is not set and missing files are downloaded.
    """
    if not os.environ.get(FOLDER_VARIABLE):
        return None
    for name in names:
        if _find_copy(name, files[name], kept, box) is None:
            return files[name].local
    return None


def _find_copy(
    name: str, file: PublicFile, kept: str | Path, box: str | Path
) -> Path | None:
    """Find the file in the project's own folder, in that of `FOLDER_VARIABLE`, or among
    the downloads."""
    candidates = [Path(box, file.local)]
    if folder := os.environ.get(FOLDER_VARIABLE):
        candidates.append(Path(folder, file.local))
    candidates.append(Path(kept, _name_download(name, file)))
    return next((path for path in candidates if path.is_file()), None)


def _name_download(name: str, file: PublicFile) -> str:
    return f"{name}{Path(file.path).suffix}"


def fetch(
    name: str, files: Mapping[str, PublicFile], folder: str | Path, box: str | Path
) -> Path:
    """Return a file of public data: from `box` or `FOLDER_VARIABLE`, or downloaded once.

    Parameters
    ----------
    name : name of the file.
    files : all files of the importer, by name.
    folder : folder that keeps downloads.
    box : folder with the files that come with this project.

    Raises
    ------
    InputError
        If the name is unknown, if the file has other contents than this project knows,
        or if it cannot be downloaded.
    """
    if name not in files:
        raise InputError("public data", "", repr(name), ", ".join(files))
    file = files[name]
    if path := _find_copy(name, file, folder, box):
        refuse_other_contents(path, file.sha256, f"{file.sha256}, of {file.address}")
        return path
    # The rules only look for files, so that they need no library for downloads.
    import pooch

    pooch.get_logger().setLevel(logging.ERROR)
    # The name of a file may have folders.
    download = Path(folder, _name_download(name, file))
    known_hash = f"sha256:{file.sha256}"
    try:
        path = pooch.retrieve(file.address, known_hash, download.name, download.parent)
        return Path(path)
    except ValueError as error:
        finding = f"other contents ({error})"
        allowed = f"SHA-256 {file.sha256}"
        raise InputError(file.address, "", finding, allowed) from None
    except OSError as error:
        allowed = f"a network, or the folder in {FOLDER_VARIABLE} with {file.local}"
        raise InputError(file.address, "", f"no download ({error})", allowed) from None


class PublicMeasurements(NamedTuple):
    """N measurements of each target.

    Attributes
    ----------
    angles : (N, n) joint angles as the controller reports them, rad.
    positions : (N, 3) by target, m.
    further : further columns (N,) of the file of measurements.
    """

    angles: np.ndarray
    positions: Mapping[str, np.ndarray]
    further: Mapping[str, np.ndarray]


def _read_text(entry: Mapping[str, Any], path: str | Path) -> PublicMeasurements:
    """Read a text table as ``table`` of its entry in ``public_data.yaml`` states.

    An `InputError` refuses a file that is not such a table or lacks a column.
    """
    # Each start of Snakemake imports this module, but only asks importers for their
    # files. Neither pandas nor scipy.spatial is needed for that.
    import pandas as pd

    separator = entry.get("separator", ",")
    further: dict[str, np.ndarray] = {}
    try:
        table = pd.read_csv(
            path,
            sep=r"\s+" if separator == "blanks" else separator,
            decimal=entry.get("decimal", "."),
            names=entry.get("names"),
            index_col=False,
        )
        joints = [name for name in entry["angles"] if name in table]
        angles = table[joints].to_numpy(float)
        positions = {}
        for target, summands in entry["positions"].items():
            vectors_mm = [table[columns].to_numpy(float) for columns in summands]
            positions[target] = 1e-3 * sum(vectors_mm)
        if euler_columns := entry.get("orientation"):
            euler_deg = table[euler_columns].to_numpy(float)
            rotation = scipy.spatial.transform.Rotation.from_euler(
                "XYZ", euler_deg, degrees=True
            )
            vectors = rotation.as_rotvec()
            further |= dict(zip(("rx", "ry", "rz"), vectors.T, strict=True))
        if entry.get("temperature") in table:
            further["temperature_c"] = table[entry["temperature"]].to_numpy(float)
    except (KeyError, ValueError, OSError) as error:
        raise InputError(path, "", str(error), entry["kind"]) from None
    # A spreadsheet may have shortened the time stamps to 2,02011E+13. They are useless
    # then, and not integers.
    time = entry.get("time")
    if time in table and pd.api.types.is_integer_dtype(table[time]):
        stamps = pd.to_datetime(table[time].astype(str), format="%Y%m%d%H%M%S")
        further["time_s"] = (stamps - stamps[0]).dt.total_seconds().to_numpy()
    if entry.get("angles_in") != "rad":
        angles = np.radians(angles)
    return PublicMeasurements(angles, positions, further)


def _read_fanuc_static(path: str | Path) -> PublicMeasurements:
    arrays = scipy.io.loadmat(path)
    positions = {target: arrays[f"m{target}"] for target in "ABC"}
    return PublicMeasurements(arrays["q"], positions, {})


def _read_motoman_poses(path: str | Path) -> np.ndarray:
    """Read the rows (N, C) of a file, one for each pose: the file has a row for each
    camera image, and those of one pose repeat its joint angles and its reflector."""
    rows = scipy.io.loadmat(path)["dataset"]
    first_of_pose = np.unique(rows[:, 0], return_index=True)[1]
    poses: np.ndarray = rows[first_of_pose]
    return poses


def _read_motoman(path: str | Path) -> PublicMeasurements:
    """Read the joint angles of the right arm and its reflector.

    Poses whose reflector the tracker did not see are left out. So is the 13th of the
    larger file's 587 poses, as in the source's own reader (loadNewLeicaDataset.m). The
    turntable stands still; the last digits of its encoder change.
    """
    rows = _read_motoman_poses(path)
    rows = rows[np.isfinite(rows[:, 19:22]).all(axis=1)]
    if len(rows) == 587:
        rows = np.delete(rows, 12, axis=0)
    return PublicMeasurements(rows[:, 7:13], {"reflector": rows[:, 19:22]}, {})


def _read_motoman_contacts(path: str | Path) -> PublicMeasurements:
    """Read the joint angles (N, 12) of the left and the right arm at each contact."""
    rows = _read_motoman_poses(path)
    angles = np.concatenate([rows[:, 13:19], rows[:, 7:13]], axis=1)
    return PublicMeasurements(angles, {}, {})


def _read_motoman_planes(path: str | Path) -> PublicMeasurements:
    """Read the joint angles (N, 6) of the right arm, while the left arm stands still."""
    both = _read_motoman_contacts(path)
    return both._replace(angles=both.angles[:, _JOINTS_OF_FIRST_ROBOT:])


@dataclass(frozen=True)
class _ImportedCampaign:
    """Contents of a campaign's folder.

    Attributes
    ----------
    document : contents of ``campaign.yaml``.
    table : columns of the measurements.
    joints : number of joints of the robot.
    """

    document: dict[str, Any]
    table: Mapping[str, np.ndarray]
    joints: int


_MAT_FILES = {
    "fanuc_static": _read_fanuc_static,
    "motoman": _read_motoman,
    "motoman_planes": _read_motoman_planes,
    "motoman_contacts": _read_motoman_contacts,
}


@dataclass(frozen=True)
class Importer:
    """Writes campaigns from a public source: an entry of ``public_data.yaml``, whose
    schema defines its keys.

    Attributes
    ----------
    files : files by the names that campaigns have for them, including those of the
        parts.
    read : reads a file; each part of an importer with parts has its own.
    robots : robots that the campaigns name, including those of the parts.
    noise : noise that the campaigns declare.
    same_pose_rad : largest difference of joint angles within a pose.
    parts : importers whose files are the sessions of one campaign.
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

        Parameters
        ----------
        paths : files.
        folder : folder of the new campaign.
        robots_folder : folder with the robot files.
        name : name of the campaign.
        test : ``holdout`` as in ``campaign.yaml``, or ``fold``: ``number``, from 1, of
            the fold that is held out, ``of`` so many. Poses are assigned to folds in
            turn: cross-validation by whole poses [1].

        References
        ----------
        [1] Geisser, S., The predictive sample reuse method with applications, Journal
            of the American Statistical Association 70, 1975.
        """
        campaign = self._read_campaign(paths, robots_folder, name)
        if fold := test.get("fold"):
            test = {"holdout": {"poses": _poses_of_fold(campaign.table, **fold)}}
        held_out = {key: dict(value) for key, value in test.items()}
        document = campaign.document | held_out
        write_campaign(folder, document, campaign.table, campaign.joints)

    def _read_campaign(
        self, paths: Sequence[str | Path], robots_folder: str | Path, name: str
    ) -> _ImportedCampaign:
        """Read files as `write_campaign` gets them."""
        importers = self.parts or (self,)
        tables = []
        targets: list[str] = []
        for session, (importer, path) in enumerate(zip(importers, paths, strict=True)):
            measured = importer.read(path)
            joints = measured.angles.shape[1]
            targets += measured.positions
            if self.parts:
                tables.append(
                    importer._tabulate_session(session, measured, robots_folder)
                )
            else:
                tables.append(_tabulate(measured, self.same_pose_rad))
        table = {}
        for column in tables[0]:
            table[column] = np.concatenate([columns[column] for columns in tables])
        has_first_robot = joints <= _JOINTS_OF_FIRST_ROBOT
        document: dict[str, Any] = {
            "campaign": name,
            "robot": self.robots[0] if has_first_robot else self.robots[-1],
            "measured": "pose" if "rx" in table else "position",
            "frame": "tracker",
            "targets": {
                target: {"point": f"{joints}DoF", "offset_m": "unknown"}
                for target in targets
            },
            "compliance": "nominal",
            "declared": [*GEOMETRY],
        }
        if self.noise:
            document["noise"] = dict(self.noise)
        return _ImportedCampaign(document, table, joints)

    def _tabulate_session(
        self, session: int, measured: PublicMeasurements, robots_folder: str | Path
    ) -> dict[str, np.ndarray]:
        """Return the columns of one session, with the angles of the model's joints:
        parts may have different controllers."""
        robot = read_robot(Path(robots_folder) / f"{self.robots[0]}.yaml")
        table = _tabulate(measured, self.same_pose_rad)
        angles = robot.model_angles(measured.angles)
        rows = np.repeat(np.arange(len(angles)), len(measured.positions))
        return (
            {"session": np.full(len(rows), session)}
            | table
            | name_joint_columns(angles[rows])
        )


@dataclass(frozen=True)
class SocketImporter(Importer):
    """Writes campaigns of a ball in printed sockets, from files of joint angles.

    Attributes
    ----------
    distance_m : distance between the centres of neighbouring sockets.
    """

    distance_m: float = SOCKET_DISTANCE_M

    def _read_campaign(
        self, paths: Sequence[str | Path], robots_folder: str | Path, name: str
    ) -> _ImportedCampaign:
        """Read files of one robot, each folder of them as a session."""
        recordings = [read_recording(path) for path in paths]
        table = tabulate_recordings(recordings)
        joints = recordings[0].angles.shape[1]
        document = describe_sockets(
            name, self.robots[0], recordings, f"{joints}DoF", self.distance_m
        )
        if self.noise is not None:
            document["noise"] = dict(self.noise)
        return _ImportedCampaign(document, table, joints)


@dataclass(frozen=True)
class ContactImporter(Importer):
    """Writes campaigns of a target that touches planes and spheres, from files of joint
    angles.

    Attributes
    ----------
    targets : the only target as ``campaign.yaml`` has it, by its name.
    features : keys of each feature as ``campaign.yaml`` has them, and ``files``: names
        of the files with its contacts.
    """

    targets: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    features: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def _read_campaign(
        self, paths: Sequence[str | Path], robots_folder: str | Path, name: str
    ) -> _ImportedCampaign:
        """Read files of contacts, in the frame of the robot's base."""
        angles = []
        names = []
        for path in paths:
            read = self.read(path).angles
            angles.append(read)
            names += [self._find_feature(path)] * len(read)
        contacts = np.concatenate(angles)
        (target,) = self.targets
        table = tabulate_single_measurements(contacts, target)
        table["feature"] = np.array(names)
        features = {}
        for feature in dict.fromkeys(names):
            keys = self.features[feature].items()
            features[feature] = {key: value for key, value in keys if key != "files"}
        kinds = dict.fromkeys(keys["kind"] for keys in features.values())
        document: dict[str, Any] = {
            "campaign": name,
            "robot": self.robots[0],
            "measured": [*kinds],
            "frame": "base",
            "targets": {target: dict(self.targets[target])},
            "features": features,
            "compliance": "nominal",
            "declared": [*GEOMETRY],
        }
        if self.noise is not None:
            document["noise"] = dict(self.noise)
        return _ImportedCampaign(document, table, contacts.shape[1])

    def _find_feature(self, path: str | Path) -> str:
        """Find the feature that the contacts of a file touch, by the file's name."""
        stem = Path(path).stem
        for feature, keys in self.features.items():
            if stem in keys["files"]:
                return feature
        allowed = [name for keys in self.features.values() for name in keys["files"]]
        raise InputError(path, "name", repr(stem), ", ".join(allowed))


def _tabulate(
    measured: PublicMeasurements, same_pose_rad: float
) -> dict[str, np.ndarray]:
    """Return the columns of a file of measurements, one row for each target of each
    measurement. Poses are numbered in the order of the file."""
    import pandas as pd

    pose = number_close_points(measured.angles, same_pose_rad)
    repeat = pd.Series(pose).groupby(pose).cumcount().to_numpy()
    targets = list(measured.positions)
    rows = np.repeat(np.arange(len(pose)), len(targets))
    position = np.stack([*measured.positions.values()], axis=1).reshape(-1, 3)
    return {
        "pose": pose[rows],
        "load": np.zeros(len(rows), int),
        "repeat": repeat[rows],
        "target": np.tile(targets, len(pose)),
        **name_joint_columns(measured.angles[rows]),
        **dict(zip("xyz", position.T, strict=True)),
        **measured.further,
    }


def _poses_of_fold(
    table: Mapping[str, np.ndarray], number: int, of: int
) -> list[list[int]]:
    """Return session and pose of the poses of a fold, from 1, of several folds."""
    session = table.get("session", 0 * table["pose"])
    labels = np.unique(np.column_stack([session, table["pose"]]), axis=0)
    poses: list[list[int]] = labels[number - 1 :: of].tolist()
    return poses


@cache
def read_importers(path: Path) -> dict[str, Importer]:
    """Read the importers of ``public_data.yaml``, by the names that ``importer`` of a
    campaign may have."""
    document = read_document(path)
    check_document(document, "public_data", path.as_posix())
    importers: dict[str, Importer] = {}
    for name, entry in document.items():
        files = {
            file_name: PublicFile(**(entry["source"] | file))
            for file_name, file in entry.get("files", {}).items()
        }
        robots = [*entry["robots"]]
        parts = tuple(importers[session] for session in entry.get("parts", ()))
        for session_importer in parts:
            files |= session_importer.files
            robots += session_importer.robots
        options = {
            key: entry[key] for key in ("noise", "same_pose_rad") if key in entry
        }
        if "sockets" in entry:
            _refuse_keys_of_tables(name, entry, path)
            importers[name] = SocketImporter(
                files, _refuse_table, tuple(robots), **options, **entry["sockets"]
            )
            continue
        read = _find_reader(name, entry, parts, path)
        if "contacts" in entry:
            importers[name] = ContactImporter(
                files, read, tuple(robots), **options, **entry["contacts"]
            )
            continue
        importers[name] = Importer(files, read, tuple(robots), **options, parts=parts)
    return importers


def _refuse_keys_of_tables(name: str, entry: Mapping[str, Any], path: Path) -> None:
    """Refuse keys that have no meaning where only joint angles were recorded."""
    for key in ("same_pose_rad", "table", "parts"):
        if key in entry:
            allowed = "source, files, robots and noise, because each row is a pose"
            raise InputError(path, f"{name}.{key}", "a key beside sockets", allowed)


def _refuse_table(path: str | Path) -> PublicMeasurements:
    """Refuse a recording where measured positions are asked for: an InputError."""
    raise InputError(path, "", "joint angles alone", "a table with measured positions")


def _find_reader(
    name: str, entry: Mapping[str, Any], parts: Sequence[Importer], path: Path
) -> Callable[[str | Path], PublicMeasurements]:
    """Return the function that reads a file of an entry of ``public_data.yaml``."""
    if parts:
        return parts[0].read
    if "table" in entry:
        return partial(_read_text, entry["table"])
    if name in _MAT_FILES:
        return _MAT_FILES[name]
    raise InputError(path, name, "no format", "a table, or parts that have one")


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
    """Read and check the documents of the campaigns that a configuration names.

    Parameters
    ----------
    config : configuration.
    folder : folder of the documents.
    source : file of the configuration, for messages.

    Returns
    -------
    Documents by the names of their files. That of a simulated campaign has the document
    of its robot under ``robot_document``.
    """
    documents = {}
    for name in list_campaigns(config):
        document = read_named_document(
            folder, "campaigns", "campaign_source", name, source
        )
        path = locate_document(folder, "campaigns", name)
        if document["source"] == "public":
            find_importer(document["importer"], folder, path)
        elif document["source"] == "simulated":
            document["robot_document"] = read_named_document(
                folder, "robots", "robot", document["robot"], path
            )
            read_named_document(
                folder, "robots", "robot", document["declared_robot"], path
            )
        documents[name] = document
    return documents


def list_campaigns(config: Mapping[str, Any]) -> list[str]:
    """List the campaigns that a configuration names, each once: simulated, measured, of
    the default run, without a laser tracker, and of the league."""
    names = []
    for key in ("campaigns", "measured", "main", "cameras", "sockets"):
        names += config["loop"].get(key, ())
    return list(dict.fromkeys([*names, *list_league_data(config)]))


def refuse_project_name(
    name: str, config: Mapping[str, Any], source: str | Path
) -> None:
    """Refuse a user's campaign, read from `source` or to be written there, that has the
    name of a campaign of this project: an InputError."""
    if name in list_campaigns(config):
        raise InputError(
            source,
            "campaign",
            f"{name!r}, a campaign of elastocal",
            "a name that no campaign of config.yaml has",
        )


def list_league_data(config: Mapping[str, Any]) -> list[str]:
    """List the data sets of all leagues, each once."""
    data_sets = []
    for robots in config["league"]["data"].values():
        for names in robots.values():
            data_sets += names
    return list(dict.fromkeys(data_sets))


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
        check_workflow_path(file)
    name = folder.name
    refuse_project_name(name, config, folder.source)
    earlier_path = _folder_of_results(Path(results, name))
    if earlier_path is not None and not earlier_path.samefile(path):
        finding = f"{name!r}, whose results are of {earlier_path.as_posix()}"
        allowed = f"another name, or first delete {Path(results, name).as_posix()}"
        raise InputError(folder.source, "campaign", finding, allowed)
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
