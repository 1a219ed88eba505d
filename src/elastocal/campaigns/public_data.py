"""Measured data of other people: where they are, what their contents must be, how to get them. Never part of this project."""

from __future__ import annotations

import hashlib
import logging
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pooch

from elastocal.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable

# Names a folder that already has the files, for machines without a network.
FOLDER_VARIABLE = "ELASTOCAL_DATA"


@dataclass(frozen=True)
class PublicFile:
    """One file of a public repository.

    Attributes
    ----------
    repository : str
        owner/name on GitHub.
    commit : str
    path : str
        In the repository.
    sha256 : str
    local : str
        Where the file stands below a folder that has all of them.
    licence : str
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


_UR10 = "christianlandgraf/ipa-robot-accuracy", "507fba69bdaf6c43c2faf306e70a7e37c5e39b89"
_JACOBI = "pauljac7700/serial_robots_datasets", "759068d85a8b95183cd71ff96d9dfc5173bc57fc"
_MOTOMAN = "ctu-vras/multirobot-calibration", "a20f0454732bc36f1d980ff08c3d30536b8b1b19"
# The toolbox that holds these files says so in its sources; it has no licence file.
_LGPL = "LGPL-3.0-or-later"
FILES = {
    "fanuc_static": PublicFile(
        "Sarrasor/RoboticManipulators",
        "4e05acfe0052b90da43e3074bbecb4bb89104301",
        "data/calibration_dataset.mat",
        "19face499435c165be81c02de841e0d8e0106686daaf63550d0bf02bbea8c8eb",
        "fanuc_static/calibration_dataset.mat",
        "MIT",
    ),
    "fanuc_cpa": PublicFile(
        "RABKKK/LaserTrackerPoseData4KinIdent",
        "e143dda2bf5280359912ed7618f2b63d7e262b58",
        "N1N2N3Jval.csv",
        "7d3d2a860cc79ce31162e2756618f32182aad418ebd26d822c1cfac0bb36385e",
        "fanuc_cpa/N1N2N3Jval.csv",
        "none stated: for the user's own use, not to be passed on",
    ),
    "ur10_ipa_a": PublicFile(
        *_UR10,
        "Series_A/measurements_grid.csv",
        "84d5c81234cab58ebe88b4c73c582c26ad0e407f0de5350571c91f5ce6f28b76",
        "ur10_ipa/Series_A/measurements_grid.csv",
        "MIT",
    ),
    "ur10_ipa_b": PublicFile(
        *_UR10,
        "Series_B/measurements_joint_configurations.csv",
        "12b69a4e6ff7be68e67d3f70245a3ab7bb6ec3a2c63bc5eae002b15a1f863d7e",
        "ur10_ipa/Series_B/measurements_joint_configurations.csv",
        "MIT",
    ),
    "jacobi_ur5_grid": PublicFile(
        *_JACOBI,
        "UR5/3D_UR5_uncalibrated_grid_cleaned.csv",
        "3de63c38b4338a1fb23437a9c6ecb7e0441a9e132fc055544619b8c580f767c0",
        "jacobi_ur5/3D_UR5_uncalibrated_grid_cleaned.csv",
        "MIT",
    ),
    "jacobi_ur5_random": PublicFile(
        *_JACOBI,
        "UR5/3D_UR5_uncalibrated_random_cleaned.csv",
        "3cd7a4aae072f9757ce9bd156e7470cc8caa89d8af9164c07390953ae808095a",
        "jacobi_ur5/3D_UR5_uncalibrated_random_cleaned.csv",
        "MIT",
    ),
    "jacobi_wam_grid": PublicFile(
        *_JACOBI,
        "WAM/3D_WAM_uncalibrated_grid_cleaned.csv",
        "f013c0ce152cffb5f529e747681457d359a9869c46fdbb4f4e1eefb8234835ad",
        "jacobi_wam/3D_WAM_uncalibrated_grid_cleaned.csv",
        "MIT",
    ),
    "jacobi_wam_random": PublicFile(
        *_JACOBI,
        "WAM/3D_WAM_uncalibrated_random_cleaned.csv",
        "b9b6f5ee9f4e9fce0ed8a70d458b08b6af7f473afe98bb92ac2ff379d398e5e2",
        "jacobi_wam/3D_WAM_uncalibrated_random_cleaned.csv",
        "MIT",
    ),
    "motoman_workspace": PublicFile(
        *_MOTOMAN,
        "UserData/Robots/Motoman/Dataset/leica_dataset/updated_leica_dataset.mat",
        "a4e62319d0d9ba35590032648ccd260ee7c8261b0d73eea97995da7f3e68f3ca",
        "motoman_leica/updated_leica_dataset.mat",
        _LGPL,
    ),
    "motoman_grid": PublicFile(
        *_MOTOMAN,
        "UserData/Robots/Motoman/Dataset/leica_dataset/leica_right_hand_6x6x6_dataset.mat",
        "170ef4301d0ca949e5e1bc39d6a6c8d0f722f47c0afaf5215e4b6b36637bee4f",
        "motoman_leica/leica_right_hand_6x6x6_dataset.mat",
        _LGPL,
    ),
}


def not_at_hand(names: Iterable[str], kept: str | Path) -> str | None:
    """What of some files is missing where `FOLDER_VARIABLE` stands for a network.

    Parameters
    ----------
    names : iterable of str
        Keys of `FILES`.
    kept : str or Path
        Folder of what was downloaded before.

    Returns
    -------
    str or None
        The first file that is missing, below that folder; None where all are there, or may be downloaded.
    """
    given = os.environ.get(FOLDER_VARIABLE)
    for name in names if given else ():
        file = FILES[name]
        if not (Path(given or "") / file.local).is_file() and not (Path(kept) / _kept_as(name)).is_file():
            return file.local
    return None


def _kept_as(name: str) -> str:
    return f"{name}{Path(FILES[name].path).suffix}"


def fetch(name: str, folder: str | Path) -> Path:
    """A file of public data with the contents that this project knows: from `FOLDER_VARIABLE`, else downloaded once.

    Parameters
    ----------
    name : str
        A key of `FILES`.
    folder : str or Path
        Keeps what is downloaded.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        An unknown name, a file of other contents, or no way to download it.
    """
    if name not in FILES:
        raise InputError("public data", "", repr(name), ", ".join(FILES))
    file = FILES[name]
    given = os.environ.get(FOLDER_VARIABLE)
    local = Path(given or "") / file.local
    if given and local.is_file():
        found = hashlib.sha256(local.read_bytes()).hexdigest()
        if found != file.sha256:
            raise InputError(local, "", f"SHA-256 {found}", f"{file.sha256}, as in {file.address}")
        return local
    pooch.get_logger().setLevel(logging.ERROR)
    try:
        kept = pooch.retrieve(file.address, f"sha256:{file.sha256}", _kept_as(name), folder)
    except ValueError as error:
        raise InputError(file.address, "", f"other contents ({error})", f"SHA-256 {file.sha256}") from None
    except OSError as error:
        allowed = f"a network, or the folder in {FOLDER_VARIABLE} with {file.local}"
        raise InputError(file.address, "", f"no download ({error})", allowed) from None
    return Path(kept)
