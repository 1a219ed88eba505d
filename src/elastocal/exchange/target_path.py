"""A file of wanted poses of the end effector: position and rotation vector in base
axes, and what the robot works under.

Columns ``x, y, z`` (m) and ``rx, ry, rz`` (rotation vector, rad) of the last measuring
point; ``fx .. mz`` (N, N m) where it is loaded, forces alone with moments of zero; ``q1
.. qn`` (rad, as the controller reports them) near which the robot shall stand.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.measurements import LARGEST_ROTATION_RAD
from elastocal.campaigns.reading import find_degrees
from elastocal.campaigns.tables import Dialect, read_text_table
from elastocal.errors import InputError, suggest_names
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.robot import Robot

_POSE = ("x", "y", "z", "rx", "ry", "rz")
# Of a corrected target.
OK = "ok"
# Of a corrected target whose error nothing bounds, before the reason.
NO_BOUND = "no bound: "
# A position farther from the base than any arm reaches is in other units.
_FARTHEST_M = 10.0


@dataclass(frozen=True)
class TargetPath:
    """N wanted poses; None where the file has no such columns.

    `position` (N, 3): m, base axes. `rotation` (N, 3, 3). `start` (N, n): rad. `wrench`
    (N, 6): N, N m. `lines` (N,) of int: line of the file of each pose.
    """

    position: np.ndarray
    rotation: np.ndarray
    start: np.ndarray | None
    wrench: np.ndarray | None
    lines: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.position)


def read_target_path(path: str | Path, joints: int) -> TargetPath:
    """Read a file of wanted poses of a robot with so many joints.

    An InputError refuses a column that is missing, unknown or there in part, what is no
    number, and what no arm reaches.
    """
    angles = tuple(f"q{j}" for j in range(1, joints + 1))
    known = (*_POSE, *WRENCH_NAMES, *angles)
    text = read_text_table(path, lambda _: True, Dialect("comma", "point"))
    cells = text.columns
    header = f"line {text.dialect.header}"
    read = text.cells({name: name for name in cells}, {})
    for name in _POSE:
        if name not in cells:
            allowed = f"{', '.join(_POSE)}: position in m and rotation vector in rad, base axes, separated by commas"
            raise InputError(path, header, f"no column {name!r}", allowed)
    for name in cells:
        if name not in known:
            raise InputError(
                path, header, f"the unknown column {name!r}", suggest_names(name, known)
            )

    def group(names: tuple[str, ...]) -> np.ndarray | None:
        there = [name for name in names if name in cells]
        if not there:
            return None
        if missing := [name for name in names if name not in cells]:
            raise InputError(
                path,
                header,
                f"{', '.join(there)} without {', '.join(missing)}",
                "all of them or none",
            )
        return read.matrix(names)

    pose = read.matrix(_POSE)
    for size, what, largest, allowed in (
        (np.abs(pose[:, :3]).max(axis=1), "position", _FARTHEST_M, "metres"),
        (
            np.linalg.norm(pose[:, 3:], axis=1),
            "turn",
            LARGEST_ROTATION_RAD,
            "a rotation vector in rad, not degrees",
        ),
    ):
        row = int(np.argmax(size))
        if size[row] > largest:
            found = f"a {what} of {size[row]:g}"
            raise InputError(
                path,
                f"line {text.lines[row]}",
                found,
                f"{allowed}, {largest:.3g} at most",
            )
    wrench = group(
        WRENCH_NAMES if set(WRENCH_NAMES[3:]) & set(cells) else WRENCH_NAMES[:3]
    )
    if wrench is not None:
        wrench = np.pad(wrench, ((0, 0), (0, 6 - wrench.shape[1])))
    rotation = Rotation.from_rotvec(pose[:, 3:]).as_matrix()
    return TargetPath(pose[:, :3], rotation, group(angles), wrench, text.lines)


def read_target_path_of(path: str | Path, robot: Robot) -> TargetPath:
    """As `read_target_path`; an InputError refuses joint angles in degrees too."""
    wanted = read_target_path(path, robot.joints)
    if wanted.start is not None and (wrong := find_degrees(wanted.start, robot)).any():
        row, joint = np.argwhere(wrong)[0]
        low, high = robot.joint_limits[joint]
        found = f"q{joint + 1} looks like degrees: {wanted.start[row, joint]:g}"
        allowed = f"rad, of a joint that goes from {low:.2f} to {high:.2f} rad"
        raise InputError(path, f"line {wanted.lines[row]}", found, allowed)
    return wanted
