"""Universal Robots UR10 with a T-Mac on its flange (christianlandgraf/ipa-robot-accuracy): Series A and B as campaigns."""

from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from elastocal.campaigns.importers.csv_columns import numbers, read_columns, table
from elastocal.campaigns.importers.reflectors import pose_and_repeat, reflector_table, unloaded_document
from elastocal.campaigns.public_data import PublicFile
from elastocal.campaigns.writing import write_campaign as write_folder

_SOURCE = "christianlandgraf/ipa-robot-accuracy", "507fba69bdaf6c43c2faf306e70a7e37c5e39b89"


def _file(path: str, sha256: str) -> PublicFile:
    return PublicFile(*_SOURCE, path, sha256, f"ur10_ipa/{path}", "MIT")


FILES = {
    "ur10_ipa_a": _file("Series_A/measurements_grid.csv", "84d5c81234cab58ebe88b4c73c582c26ad0e407f0de5350571c91f5ce6f28b76"),
    "ur10_ipa_b": _file(
        "Series_B/measurements_joint_configurations.csv", "12b69a4e6ff7be68e67d3f70245a3ab7bb6ec3a2c63bc5eae002b15a1f863d7e"
    ),
}
ROBOT, TARGET = "ur10", "TMac"
ROBOTS = (ROBOT,)
# One measurement of one coordinate. Positions: the 300 pairs of poses of Series A within 2 mrad of each other, by their median
# and less what the chain explains of their distance. Orientations: the 255 repeats of Series B, by their median.
NOISE = {"position_m": 2.1e-5, "orientation_rad": 3.0e-5}
TIME, TEMPERATURE = "Timestamp", "measurement_temperature"
ANGLES = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
POSITION = ("measurement_x", "measurement_y", "measurement_z")
ORIENTATION = ("measurement_rx", "measurement_ry", "measurement_rz")
# Turned about x, then the new y, then the new z: the angle between any two measured orientations must be that of the flange's,
# whatever the frame and the T-Mac's own turn. Read so, they differ by 1.1 mrad (Series A) and 0.9 mrad (B) in the median, with
# fixed axes by 5 and 23 mrad, as rotation vectors by 48 and 10 mrad. The source's own reader does the same.
_EULER = "XYZ"
# The controller's angles of a pose that is approached again scatter by less; different poses are 500 times as far apart.
_SAME_POSE_RAD = 1e-4
_TIME_FORMAT = "%Y%m%d%H%M%S"


def read(path: str | Path) -> dict[str, np.ndarray]:
    """Measurements of one series.

    Returns ``joint_angles`` (N, 6) rad, ``position`` (N, 3) m, ``rotation_vector`` (N, 3) rad, ``temperature_c`` (N,) where it
    is there, ``time_s`` (N,) since the first row where the time stamps are whole. Raises `InputError`: no file, a column that
    is missing, something that is no number.
    """
    cells = read_columns(path, ";", (*ANGLES, *POSITION, *ORIENTATION), "a series of ipa-robot-accuracy")
    angles, position, orientation = (table(path, cells, names, ",") for names in (ANGLES, POSITION, ORIENTATION))
    found = {
        "joint_angles": angles,
        "position": 1e-3 * position,
        "rotation_vector": scipy.spatial.transform.Rotation.from_euler(_EULER, orientation, degrees=True).as_rotvec(),
    }
    if TEMPERATURE in cells:
        found["temperature_c"] = numbers(path, TEMPERATURE, cells[TEMPERATURE], ",")
    times = _times(cells[TIME]) if TIME in cells else None
    return found if times is None else found | {"time_s": times}


def write_campaign(path: str | Path, folder: str | Path, name: str, holdout: Mapping[str, Any] | None = None) -> None:
    """Write one series as a campaign's folder.

    `path`: ``measurements_grid.csv`` or ``measurements_joint_configurations.csv``. `holdout`: as in ``campaign.yaml``. Raises
    `InputError`: as in `read`.
    """
    measurements = read(path)
    angles, position, vector = (measurements.pop(part) for part in ("joint_angles", "position", "rotation_vector"))
    table = reflector_table(*pose_and_repeat(angles, _SAME_POSE_RAD), angles, {TARGET: position})
    table |= {f"r{axis}": vector[:, i] for i, axis in enumerate("xyz")} | measurements
    write_folder(folder, unloaded_document(name, ROBOT, "pose", [TARGET], holdout, NOISE), table, angles.shape[1])


def _times(cells: Iterable[str]) -> np.ndarray | None:
    """Seconds since the first row; None where a spreadsheet has cut the stamps down to 2,02011E+13."""
    try:
        stamps = [datetime.strptime(cell, _TIME_FORMAT) for cell in cells]
    except ValueError:
        return None
    return np.array([(stamp - stamps[0]).total_seconds() for stamp in stamps])
