"""Joint angles that were recorded while a ball on the robot sat in printed sockets.

This is the format of MUKCa [1]_: a folder for each place where the printed tool stood,
with a file of joint angles for each of its sockets. Nothing else is measured. Each place
is a session. A socket is a point that the ball touches; the distance between
neighbouring sockets is known.

References
----------
.. [1] Franzese, Spahn, Kober and Della Santina, MUKCa: accurate and affordable cobot
   calibration without external measurement devices, arXiv:2503.12584, 2025.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.campaign import DEFAULT_HOLDOUT, GEOMETRY
from elastocal.campaigns.measurements import tabulate_single_measurements
from elastocal.campaigns.tables import LARGEST_BYTES
from elastocal.errors import InputError
from elastocal.io.texts import parse_number, read_text

# Distance of neighbouring sockets of the tool that MUKCa prints.
SOCKET_DISTANCE_M = 0.05
TARGET = "ball"
# Standard deviation of the printed distance; the makers of the tool check it with a
# caliper.
DISTANCE_STD_M = 1.0e-4
# Play of a printed ball in a printed socket; MUKCa reports 0.1 mm of repeatability.
SOCKET_STD_M = 1.0e-4
# Name of a file of joint angles, with the number of its socket.
_SOCKET_FILE = re.compile(r"hole_(\d)\.csv")
_SOCKET_PATTERN = "hole_*.csv"
_ALLOWED_FILE = (
    "joint angles in rad separated by commas, one line for each pose, no header"
)
# No joint turns further than this; a larger number is an angle in degrees.
_LARGEST_ANGLE_RAD = 4 * np.pi


@dataclass(frozen=True)
class Recording:
    """Poses in which the ball was in one socket.

    Attributes
    ----------
    stand : name of the place where the tool stood.
    socket : number of the socket, from 0.
    angles : (N, n) joint angles as the controller reported them, rad.
    """

    stand: str
    socket: int
    angles: np.ndarray


def read_recording(path: str | Path) -> Recording:
    """Read a file of joint angles; its folder names the place.

    Raises `InputError`: the name states no socket, or the file is not such a table.
    """
    path = Path(path)
    match = _SOCKET_FILE.fullmatch(path.name)
    if match is None:
        allowed = "hole_0.csv, hole_1.csv and so on, numbered by socket"
        raise InputError(path, "name", repr(path.name), allowed)
    rows: list[list[float]] = []
    for number, line in enumerate(read_text(path, LARGEST_BYTES).splitlines(), 1):
        cells = line.partition("#")[0]
        if cells.strip():
            angles = _read_angles(path, number, cells.split(","))
            if rows and len(angles) != len(rows[0]):
                allowed = f"{len(rows[0])}, as in the lines above"
                count = f"{len(angles)} angles"
                raise InputError(path, f"line {number}", count, allowed)
            rows.append(angles)
    if not rows:
        raise InputError(path, "", "no line of joint angles", _ALLOWED_FILE)
    return Recording(path.parent.name, int(match[1]), np.array(rows))


def _read_angles(path: Path, number: int, cells: Sequence[str]) -> list[float]:
    """Read the angles of one line, rad; `number` counts lines from 1."""
    angles = []
    for joint, cell in enumerate(cells, 1):
        text = cell.strip()
        angle = parse_number(text)
        key = f"line {number}, joint {joint}"
        if angle is None:
            raise InputError(path, key, repr(text), _ALLOWED_FILE)
        if abs(angle) > _LARGEST_ANGLE_RAD:
            raise InputError(path, key, text, "rad, not degrees: at most two turns")
        angles.append(angle)
    return angles


def find_recordings(folder: str | Path) -> list[Path]:
    """Find the files of joint angles in a folder and in the folders below it.

    Raises `InputError`: there is none.
    """
    paths = sorted(Path(folder).rglob(_SOCKET_PATTERN))
    paths = [path for path in paths if _SOCKET_FILE.fullmatch(path.name)]
    if not paths:
        allowed = "a folder for each place of the tool, with hole_0.csv and hole_1.csv"
        raise InputError(folder, "", f"no file {_SOCKET_PATTERN}", allowed)
    return paths


def describe_sockets(
    name: str,
    robot: str,
    recordings: Sequence[Recording],
    point: str,
    distance_m: float = SOCKET_DISTANCE_M,
) -> dict[str, Any]:
    """Return ``campaign.yaml`` of recordings.

    Parameters
    ----------
    name : name of the campaign.
    robot : as in ``campaign.yaml``.
    recordings : all sockets of all places.
    point : measuring point of the robot behind which the ball sits.
    distance_m : distance between the centres of neighbouring sockets.
    """
    sockets = sorted({recording.socket for recording in recordings})
    document: dict[str, Any] = {
        "campaign": name,
        "robot": robot,
        "measured": "point",
        "frame": "unknown",
        "targets": {TARGET: {"point": point, "offset_m": "unknown"}},
        "features": {name_socket(socket): {} for socket in sockets},
        "compliance": "nominal",
        "declared": [*GEOMETRY],
        "noise": {"position_m": SOCKET_STD_M},
        "holdout": {**DEFAULT_HOLDOUT},
    }
    if len(sockets) == 2:
        distance = {
            "between": [name_socket(socket) for socket in sockets],
            "distance_m": distance_m * (sockets[1] - sockets[0]),
            "std_m": DISTANCE_STD_M,
        }
        document["distances"] = [distance]
    elif len(sockets) > 2:
        for socket in sockets:
            place_m = [distance_m * socket, 0.0, 0.0]
            feature = {"position_m": place_m, "std_m": DISTANCE_STD_M}
            document["features"][name_socket(socket)] = feature
    return document


def name_socket(socket: int) -> str:
    """Return the name of a socket among the features of a campaign."""
    return f"hole_{socket}"


def tabulate_recordings(recordings: Sequence[Recording]) -> dict[str, np.ndarray]:
    """Return the columns of ``measurements.csv``, one row for each recorded pose.

    A place is one session. Raises `InputError`: recordings have different numbers of
    joints, or a place has one socket twice.
    """
    joints = recordings[0].angles.shape[1]
    stands = list(dict.fromkeys(recording.stand for recording in recordings))
    read_sockets = set()
    columns: dict[str, list[np.ndarray]] = {"session": [], "feature": [], "angles": []}
    for recording in recordings:
        label = (recording.stand, recording.socket)
        source = f"{recording.stand}/{name_socket(recording.socket)}.csv"
        if recording.angles.shape[1] != joints:
            width = f"{recording.angles.shape[1]} angles in a line"
            raise InputError(source, "", width, f"{joints}, as in the first file")
        if label in read_sockets:
            raise InputError(source, "", "the same socket twice", "each socket once")
        read_sockets.add(label)
        count = len(recording.angles)
        columns["session"].append(np.full(count, stands.index(recording.stand)))
        columns["feature"].append(np.full(count, name_socket(recording.socket)))
        columns["angles"].append(recording.angles)
    table = {name: np.concatenate(arrays) for name, arrays in columns.items()}
    angles = table.pop("angles")
    return table | tabulate_single_measurements(angles, TARGET)
