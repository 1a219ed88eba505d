"""Universal Robots UR5 and Barrett WAM with one reflector (pauljac7700/serial_robots_datasets): tables as campaigns.

Measured with a GTS3800 laser tracker for P. Jacobi's master's thesis (Tsinghua University 2025). A file holds the commanded
position of the reflector, which the nominal chain and a tool along its last axis reproduce to 12 um, and a difference from it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from elastocal.campaigns.importers.csv_columns import read_columns, table
from elastocal.campaigns.importers.reflectors import campaign_writer
from elastocal.campaigns.public_data import PublicFile
from elastocal.errors import InputError

_SOURCE = "pauljac7700/serial_robots_datasets", "759068d85a8b95183cd71ff96d9dfc5173bc57fc"
_SHA256 = {
    "ur5_grid": "3de63c38b4338a1fb23437a9c6ecb7e0441a9e132fc055544619b8c580f767c0",
    "ur5_random": "3cd7a4aae072f9757ce9bd156e7470cc8caa89d8af9164c07390953ae808095a",
    "wam_grid": "f013c0ce152cffb5f529e747681457d359a9869c46fdbb4f4e1eefb8234835ad",
    "wam_random": "b9b6f5ee9f4e9fce0ed8a70d458b08b6af7f473afe98bb92ac2ff379d398e5e2",
}


def _file(robot: str, poses: str) -> PublicFile:
    name = f"3D_{robot.upper()}_uncalibrated_{poses}_cleaned.csv"
    return PublicFile(*_SOURCE, f"{robot.upper()}/{name}", _SHA256[f"{robot}_{poses}"], f"jacobi_{robot}/{name}", "MIT")


FILES = {f"jacobi_{name}": _file(*name.split("_")) for name in _SHA256}
# The header and every seventh row of the grid: ten poses make a line of it, so these are spread over all of it.
FILES["jacobi_ur5_every_seventh"] = replace(
    FILES["jacobi_ur5_grid"],
    sha256="86a7cea6d5678239b26e27d3e7cf549a9439b69274381c6e081e27f30ce4f740",
    local="jacobi_ur5/3D_UR5_uncalibrated_grid_every_seventh.csv",
    excerpt=True,
)
TARGET = "SMR"
# Of six and of seven joints.
ROBOTS, _JOINTS = ("ur5", "wam"), (6, 7)
# The tracker's maker: 15 um + 6 um/m; its distance is not stated. The least that a measurement scatters: what the joints add
# is the error common to a pose, which is estimated.
NOISE = {"position_m": 1.5e-5}
_COMMANDED, _DIFFERENCE = ("x_t", "y_t", "z_t"), ("x_dif", "y_dif", "z_dif")


def read(path: str | Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Measurements of one file.

    Returns `joint_angles` (N, n): as commanded, rad; `positions` (N, 3): m, in the frame in which the tracker was set to the
    robot's base. The source does not state the sign of the difference; with this one the sums have six decimals of a
    millimetre, as the tracker gives them, with the other one fifteen. Raises `InputError`: no file, a column that is missing,
    something that is no number, another number of joints.
    """
    kind = "a file of serial_robots_datasets"
    cells = read_columns(path, ",", (*_COMMANDED, *_DIFFERENCE), kind)
    joints = sum(name.startswith("joint_") for name in cells)
    names = [f"joint_{number + 1}" for number in range(joints)]
    if joints not in _JOINTS or not set(names) <= set(cells):
        found = ", ".join(name for name in cells if name.startswith("joint_")) or "no column joint_1"
        raise InputError(path, "header", found, f"joint_1 to joint_{' or joint_'.join(map(str, _JOINTS))}")
    angles, commanded, difference = (table(path, cells, columns) for columns in (names, _COMMANDED, _DIFFERENCE))
    return np.radians(angles), {TARGET: 1e-3 * (commanded + difference)}


write_campaign = campaign_writer(read, ROBOTS, NOISE)
