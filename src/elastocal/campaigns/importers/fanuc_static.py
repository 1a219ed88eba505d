"""FANUC R-2000iC/165F, 24 configurations with 10 repeats (Sarrasor/RoboticManipulators): a MAT file as a campaign."""

from pathlib import Path

import numpy as np

from elastocal.campaigns.importers.mat_files import read_mat
from elastocal.campaigns.importers.reflectors import campaign_writer
from elastocal.campaigns.public_data import PublicFile
from elastocal.errors import InputError

FILES = {
    "fanuc_static": PublicFile(
        "Sarrasor/RoboticManipulators",
        "4e05acfe0052b90da43e3074bbecb4bb89104301",
        "data/calibration_dataset.mat",
        "19face499435c165be81c02de841e0d8e0106686daaf63550d0bf02bbea8c8eb",
        "fanuc_static/calibration_dataset.mat",
        "MIT",
    ),
}
ROBOT, TARGETS = "fanuc_static", ("A", "B", "C")
ROBOTS = (ROBOT,)


def read(path: str | Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Measurements of the MAT file.

    Returns `joint_angles` (N, 6): as in the file, rad; `positions` (N, 3): m, tracker frame. Raises `InputError`: no MAT file,
    a variable that is missing or has another shape.
    """
    names = ("q", *(f"m{target}" for target in TARGETS))
    found = read_mat(path, names)
    for name in names:
        shape, width = np.shape(found.get(name, ())), 6 if name == "q" else 3
        if len(shape) != 2 or shape != (len(found["q"]), width) or found[name].dtype.kind != "f" or not len(found["q"]):
            raise InputError(path, name, f"shape {shape}" if name in found else "nothing", f"(measurements, {width}) numbers")
    return found["q"], {target: found[f"m{target}"] for target in TARGETS}


write_campaign = campaign_writer(read, ROBOTS)
