"""Right arm of a Motoman with one reflector (ctu-vras/multirobot-calibration): MAT files as campaigns.

A file holds a row for each camera image that was taken of a pose; rows of one pose repeat its joint angles and its reflector.
"""

from pathlib import Path

import numpy as np

from elastocal.campaigns.importers.mat_files import read_mat
from elastocal.campaigns.importers.reflectors import campaign_writer
from elastocal.campaigns.public_data import PublicFile
from elastocal.errors import InputError

_SOURCE = "ctu-vras/multirobot-calibration", "a20f0454732bc36f1d980ff08c3d30536b8b1b19"
# The toolbox that holds these files says so in its sources; it has no licence file.
_FOLDER, _LICENCE = "UserData/Robots/Motoman/Dataset/leica_dataset", "LGPL-3.0-or-later"


def _file(name: str, sha256: str) -> PublicFile:
    return PublicFile(*_SOURCE, f"{_FOLDER}/{name}", sha256, f"motoman_leica/{name}", _LICENCE)


FILES = {
    "motoman_workspace": _file("updated_leica_dataset.mat", "a4e62319d0d9ba35590032648ccd260ee7c8261b0d73eea97995da7f3e68f3ca"),
    "motoman_grid": _file(
        "leica_right_hand_6x6x6_dataset.mat", "170ef4301d0ca949e5e1bc39d6a6c8d0f722f47c0afaf5215e4b6b36637bee4f"
    ),
}
ROBOT, TARGET = "motoman_right_arm", "reflector"
ROBOTS = (ROBOT,)
# One coordinate, pooled over the four series of 18 to 20 repeats at one posture each without contact (leica_rep_table1, table2,
# wall1, wall2 of the source): robot and tracker together.
NOISE = {"position_m": 1.2e-5}
_NAME, _COLUMNS = "dataset", 26
_POSE, _TURNTABLE, _ANGLES, _POSITION = 0, 6, slice(7, 13), slice(19, 22)
# The source's own reader (loadNewLeicaDataset.m) leaves out the 13th of the 587 poses of its larger file.
_WITH_A_WRONG_POSE, _WRONG_POSE = 587, 12
# The turntable stands still; its encoder's last digits move.
_STILL_RAD = 1e-3


def read(path: str | Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Measurements of one file.

    Returns `joint_angles` (P, 6): of the right arm, rad; `positions` (P, 3): m, tracker frame. Poses whose reflector the
    tracker did not see are left out, and so is the one that the source's own reader leaves out. Raises `InputError`: no MAT
    file, another shape, or a turntable that turns.
    """
    found = read_mat(path, [_NAME])
    rows = np.asarray(found.get(_NAME, np.zeros(0)))
    if rows.ndim != 2 or rows.shape[1] != _COLUMNS or rows.dtype.kind != "f":
        raise InputError(path, _NAME, f"shape {rows.shape}", f"(rows, {_COLUMNS}) numbers")
    rows = rows[np.unique(rows[:, _POSE], return_index=True)[1]]
    rows = rows[np.isfinite(rows[:, _POSITION]).all(axis=1)]
    if len(rows) == _WITH_A_WRONG_POSE:
        rows = np.delete(rows, _WRONG_POSE, axis=0)
    if not len(rows) or not np.isfinite(rows[:, _ANGLES]).all():
        raise InputError(path, _NAME, "no pose with angles and a position", "poses of the right arm with a reflector")
    turned = np.abs(rows[:, _TURNTABLE]).max()
    if turned > _STILL_RAD:
        raise InputError(path, f"{_NAME} column {_TURNTABLE + 1}", f"a turntable at {turned:g} rad", "one that stands at 0")
    return rows[:, _ANGLES], {TARGET: rows[:, _POSITION]}


write_campaign = campaign_writer(read, ROBOTS, NOISE)
