"""FANUC R-2000iC/165F, one joint moved at a time (RABKKK/LaserTrackerPoseData4KinIdent): a text file as a campaign."""

from pathlib import Path

import numpy as np

from elastocal.campaigns.importers.reflectors import campaign_writer
from elastocal.campaigns.public_data import LARGEST_BYTES, PublicFile
from elastocal.counting import counted
from elastocal.errors import InputError
from elastocal.io.texts import read_text

FILES = {
    "fanuc_cpa": PublicFile(
        "RABKKK/LaserTrackerPoseData4KinIdent",
        "e143dda2bf5280359912ed7618f2b63d7e262b58",
        "N1N2N3Jval.csv",
        "7d3d2a860cc79ce31162e2756618f32182aad418ebd26d822c1cfac0bb36385e",
        "fanuc_cpa/N1N2N3Jval.csv",
        "none stated: for the user's own use, not to be passed on",
    ),
}
ROBOT, TARGETS = "fanuc_cpa", ("D", "E", "F")
ROBOTS = (ROBOT,)
# Three reflectors in mm, six zeros, six angles of the controller in degrees.
_COLUMNS, _ANGLES = 21, slice(15, 21)
# This source has no repeats; those of fanuc_static scatter so, pooled over its poses, reflectors and coordinates.
NOISE = {"position_m": 5.2e-5}


def read(path: str | Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Measurements of the text file.

    Returns `joint_angles` (N, 6): as the controller reports them, in rad; `positions` (N, 3): m, tracker frame. Raises
    `InputError`: no file, a row of another length, something that is no number.
    """
    rows = []
    for number, line in enumerate(read_text(path, LARGEST_BYTES).split("\n"), 1):
        if not (cells := line.split()):
            continue
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError:
            raise InputError(path, f"line {number}", "a cell that is no number", "numbers separated by blanks") from None
        if len(cells) != _COLUMNS or not np.isfinite(rows[-1]).all():
            raise InputError(path, f"line {number}", counted(len(cells), "number"), f"{_COLUMNS} finite numbers")
    if not rows:
        raise InputError(path, "", "no row of data", f"rows of {_COLUMNS} numbers")
    values = np.array(rows)
    return np.radians(values[:, _ANGLES]), {name: 1e-3 * values[:, 3 * i : 3 * i + 3] for i, name in enumerate(TARGETS)}


write_campaign = campaign_writer(read, ROBOTS, NOISE)
