"""Read a robot: from a URDF, Denavit-Hartenberg parameters, a robot file or a chain."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.campaigns import reading
from elastocal.errors import InputError
from elastocal.exchange.dh import format_dh_chain, robot_from_dh
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.io.documents import check_document
from elastocal.mechanics.robot_file import parse_robot

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from elastocal.mechanics.robot import Robot

_URDF = (".urdf", ".xml")
_ALLOWED = (
    "a .urdf with base= and tip=, a .csv of Denavit-Hartenberg parameters, a robot file"
    " .yaml, rows (n, 4) of theta, d, a and alpha, or a chain such as 'Rz(q1) Tx(0.3)"
    " Rz(q2) Tx(0.2) [tool]'"
)


def read_robot(
    source: str | Path | ArrayLike,
    *,
    base: str | None = None,
    tip: str | None = None,
    modified: bool = False,
    name: str = "robot",
) -> Robot:
    """Read the nominal robot.

    Parameters
    ----------
    source : str, path or (n, 4) array
        A URDF; a table of Denavit-Hartenberg parameters (.csv); a robot file (.yaml);
        theta, d, a and alpha of each revolute joint, rad and m; or a chain in the
        notation of robot files, which has a bracket.
    base, tip : str, optional
        Links of a URDF: the frame of `base` is the base frame of the robot, that of
        `tip` its last measuring point.
    modified : bool
        Whether Denavit-Hartenberg parameters are in Craig's modified notation.
    name : str
        Name of a robot that is given as rows or as a chain.

    Returns
    -------
    Robot
        With the springs and masses that the source states.

    Raises
    ------
    InputError
        Names the file and line, or the argument, what was found and what is allowed.

    Examples
    --------
    >>> import elastocal as ec
    >>> robot = ec.read_robot("Rz(q1) Tx(0.3) Rz(q2) Tx(0.2) [tool]")
    >>> robot.joints
    2
    """
    if not isinstance(source, (str, Path)):
        return _build_robot(_format_rows(source, modified=modified), name)
    if isinstance(source, str) and "(" in source:
        return _build_robot(source, name)
    suffix = Path(source).suffix.lower()
    if suffix in _URDF:
        if base is None or tip is None:
            raise InputError("read_robot", "base, tip", "none", "names of two links")
        return robot_from_urdf(source, base, tip).robot
    if suffix == ".csv":
        return robot_from_dh(source, modified=modified).robot
    if suffix in (".yaml", ".yml"):
        return reading.read_robot(source)
    raise InputError("read_robot", "source", repr(str(source)), _ALLOWED)


def _format_rows(source: ArrayLike, *, modified: bool) -> str:
    """Format Denavit-Hartenberg rows as a chain."""
    rows = np.asarray(source, float)
    if rows.ndim != 2 or rows.shape[1] != 4 or not np.isfinite(rows).all():
        finding = f"an array of shape {rows.shape}"
        raise InputError("read_robot", "source", finding, _ALLOWED)
    return format_dh_chain(rows, modified=modified)


def _build_robot(chain: str, name: str) -> Robot:
    """Build a robot of a chain, whose joints may turn once either way."""
    document: dict[str, Any] = {"name": name, "chain": chain}
    check_document(document, "robot", "read_robot")
    return parse_robot(document, "read_robot")
