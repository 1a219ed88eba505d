"""A campaign in memory: made from arrays, from a table, or read from a folder."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from elastocal.campaigns import reading
from elastocal.campaigns.campaign import DEFAULT_HOLDOUT, GEOMETRY, UNKNOWN
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.holdout import split_poses
from elastocal.campaigns.measurements import ROTATION, describe_columns
from elastocal.campaigns.tables import Cells
from elastocal.effects.catalogue import list_effects
from elastocal.errors import InputError, suggest_names
from elastocal.exchange.numbering import number_loads_and_repeats, number_poses
from elastocal.fitting.cases import prepare_case
from elastocal.fitting.model import Case
from elastocal.interface.arguments import check_array, check_instance
from elastocal.io.documents import check_document
from elastocal.loop.loading import (
    check_regression,
    describe_campaign,
    read_described_campaign,
)
from elastocal.mechanics.components import WRENCH_NAMES, list_joint_columns
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import describe_robot

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pandas as pd
    from numpy.typing import ArrayLike

    from elastocal.campaigns import campaign as campaigns

_SOURCE = "Campaign"
# The target of a campaign that names none.
_TARGET = "target"
ROBOT_ALLOWED = "a Robot, which ec.read_robot returns"
CAMPAIGN_ALLOWED = "a Campaign, such as ec.read_campaign returns"


@dataclass(frozen=True, init=False, eq=False)
class Campaign:
    """Measurements of a robot, checked as a whole.

    Attributes
    ----------
    robot : Robot
        The nominal robot.
    checked : campaigns.campaign.Campaign
        Targets, settings and measurements.
    descriptions : dict
        ``campaign``, ``robot`` and ``source``, as step 1 of the workflow describes a
        campaign.
    validation : Campaign or None
        The campaign that validates this one; None if this one holds out poses.
    """

    robot: Robot
    checked: campaigns.Campaign
    descriptions: dict[str, Any] = field(repr=False)
    validation: Campaign | None = None

    def __init__(
        self,
        robot: Robot,
        *,
        joint_angles: ArrayLike,
        positions: ArrayLike,
        wrenches: ArrayLike | None = None,
        rotation_vectors: ArrayLike | None = None,
        columns: Mapping[str, ArrayLike] | None = None,
        **settings: Any,
    ) -> None:
        """Check measurements that are given as arrays.

        Parameters
        ----------
        robot : Robot
            The nominal robot, see `read_robot`.
        joint_angles : (N, n) array
            Rad, as the controller reports them; of prismatic joints m.
        positions : (N, 3) or (N, T, 3) array
            Of one target or of T targets, m; NaN where a target was not measured.
        wrenches : (N, 6) or (N, 3) array, optional
            Load at the last measuring point, base axes, N and N m.
        rotation_vectors : array of the shape of `positions`, optional
            Orientations, rad; with them whole poses are fitted.
        columns : mapping, optional
            Further columns (N,) with the names of measurements.csv: ``session``,
            ``pose``, ``load``, ``repeat``, ``target``, ``time_s``, ``temperature_c``,
            ``u95_m``, ``approach1`` and so on. Without them, rows of equal joint angles
            are one pose, and equal loads of a pose its repeats. Poses are numbered by
            their joint angles, so that the same poses are held out in any order of the
            rows. Rows are taken to be in the order in which they were measured, because
            the set-up may have moved between two of them.
        **settings
            Keys of campaign.yaml, such as ``targets``, ``frame`` ("tracker" by
            default), ``declared``, ``noise``, ``holdout``, ``remainder`` and
            ``campaign``, the name. By default the geometry is declared, so that it is
            fitted before anything is looked for; one target is fitted on the last
            measuring point; and compliances are identified if there are loads on a
            robot that states none.

        Raises
        ------
        InputError
            Names the argument and the row, what was found and what is allowed.

        Examples
        --------
        >>> import numpy as np
        >>> import elastocal as ec
        >>> robot = ec.read_robot("Rz(q1) Tx(0.3) Rz(q2) Tx(0.2) [tool]")
        >>> q = np.random.default_rng(1).uniform(-1.0, 1.0, (20, 2))
        >>> x = 0.3 * np.column_stack([np.cos(q[:, 0]), np.sin(q[:, 0]), 0 * q[:, 0]])
        >>> ec.Campaign(robot, joint_angles=q, positions=x, frame="base")
        <Campaign campaign of robot: 20 measurements of 1 target(s) at 20 poses>
        """
        check_instance(_SOURCE, "robot", robot, Robot, ROBOT_ALLOWED)
        is_pose = rotation_vectors is not None
        has_loads = wrenches is not None and bool(np.any(wrenches))
        document = _complete_settings(
            settings, robot, has_loads=has_loads, is_pose=is_pose
        )
        arguments = {
            "joint_angles": joint_angles,
            "positions": positions,
            "wrenches": wrenches,
            "rotation_vectors": rotation_vectors,
        }
        rows = _arrange(robot, arguments, columns or {}, [*document["targets"]])
        table = _make_table(rows, robot)
        checked = reading.build_campaign(document, robot, table, _SOURCE)
        _set_fields(self, robot, checked, _describe(document, robot), None)

    @classmethod
    def from_table(cls, robot: Robot, table: pd.DataFrame, **settings: Any) -> Campaign:
        """Check measurements in a table with the columns of measurements.csv.

        Parameters
        ----------
        robot : Robot
            The nominal robot.
        table : DataFrame
            Columns ``q1..qn`` and ``x, y, z``; optionally ``rx, ry, rz``, ``fx..mz``,
            of which missing ones are zero, and the others of measurements.csv.
        **settings
            As of `Campaign`.
        """
        import pandas as pd

        check_instance(_SOURCE, "robot", robot, Robot, ROBOT_ALLOWED)
        check_instance(_SOURCE, "table", table, pd.DataFrame, "a DataFrame of pandas")
        angles = list_joint_columns(robot.commands)
        _refuse_missing_columns(table, angles)
        if any(name in table for name in WRENCH_NAMES):
            absent = [name for name in WRENCH_NAMES if name not in table]
            table = table.assign(**dict.fromkeys(absent, 0.0))
        groups = {
            "joint_angles": angles,
            "positions": [*"xyz"],
            "wrenches": [*WRENCH_NAMES],
            "rotation_vectors": [*ROTATION],
        }
        arrays = {
            argument: table[names].to_numpy()
            for argument, names in groups.items()
            if names[0] in table
        }
        grouped = {name for names in groups.values() for name in names}
        columns = {
            str(name): table[name].to_numpy() for name in table if name not in grouped
        }
        return cls(robot, **arrays, columns=columns, **settings)

    def split(self) -> tuple[Case, Case]:
        """Split the measurements by whole poses into a case to fit and one to validate."""
        source = self.descriptions["source"]
        training, held_out = split_poses(self.checked)
        fitted = prepare_case(replace(self.checked, measurements=training), source)
        if self.validation is not None:
            validating = self.validation
            return fitted, prepare_case(
                validating.checked, validating.descriptions["source"]
            )
        return fitted, prepare_case(
            replace(self.checked, measurements=held_out), source
        )

    def __len__(self) -> int:
        return len(self.checked.measurements)

    def __repr__(self) -> str:
        measurements = self.checked.measurements
        poses = len(np.unique(measurements.pose))
        return (
            f"<Campaign {self.checked.name} of {self.robot.name}: {len(self)}"
            f" measurements of {len(self.checked.targets)} target(s) at {poses} poses>"
        )


def _refuse_missing_columns(table: pd.DataFrame, angles: list[str]) -> None:
    """Refuse a table without the columns of joint angles and positions, or with a part
    of the rotation."""
    needed = [*angles, *"xyz"]
    if any(name in table for name in ROTATION):
        needed += ROTATION
    missing = [name for name in needed if name not in table]
    if missing:
        allowed = f"a table with {', '.join(needed)}"
        raise InputError(_SOURCE, "table", f"no column {missing[0]!r}", allowed)


def read_campaign(
    folder: str | Path, robots_folder: str | Path | None = None
) -> Campaign:
    """Read a campaign's folder.

    Parameters
    ----------
    folder : str or path
        Folder with ``campaign.yaml`` and its measurements.
    robots_folder : str or path, optional
        Folder with robot files that the campaign may name; by default its own folder.

    Raises
    ------
    InputError
        Names the file and row or key, what was found and what is allowed.
    """
    on_disk = read_campaign_folder(folder, robots_folder or folder)
    descriptions, checked = read_described_campaign(on_disk)
    validation = None
    held_out = reading.read_held_out_campaign(on_disk, list_effects())
    if on_disk.held_out_folder is not None and held_out is not None:
        described = describe_campaign(on_disk.held_out_folder, held_out)
        validation = _wrap(on_disk.held_out_folder.robot, held_out, described, None)
    descriptions |= {
        "held_out": validation.descriptions if validation else None,
        "files": on_disk.digests,
    }
    return _wrap(on_disk.robot, checked, descriptions, validation)


def _wrap(
    robot: Robot,
    checked: campaigns.Campaign,
    descriptions: dict[str, Any],
    validation: Campaign | None,
) -> Campaign:
    """Make a campaign of parts that were checked before, see `Campaign`."""
    campaign = Campaign.__new__(Campaign)
    _set_fields(campaign, robot, checked, descriptions, validation)
    return campaign


def _set_fields(campaign: Campaign, *values: Any) -> None:
    """Set the fields of a new campaign, in their order."""
    for name, value in zip(Campaign.__dataclass_fields__, values, strict=True):
        object.__setattr__(campaign, name, value)


def _describe(document: Mapping[str, Any], robot: Robot) -> dict[str, Any]:
    """Describe a campaign that was given as arrays."""
    return {
        "source": _SOURCE,
        "campaign": dict(document),
        "robot": describe_robot(robot),
        "held_out": None,
        "files": {},
    }


@dataclass(frozen=True, eq=False)
class _Rows:
    """Measurements with a row for each measured target.

    Attributes
    ----------
    columns : columns (M,) by their names in measurements.csv.
    numbers : (M,) row of the caller's arrays, from 1.
    """

    columns: dict[str, np.ndarray]
    numbers: np.ndarray


def _arrange(
    robot: Robot,
    arrays: Mapping[str, ArrayLike | None],
    columns: Mapping[str, ArrayLike],
    targets: Sequence[str],
) -> _Rows:
    """Arrange the arguments of `Campaign` as columns of measurements.csv.

    Parameters
    ----------
    robot : the robot.
    arrays : joint angles, positions, wrenches and rotation vectors, by argument.
    columns : further columns.
    targets : names of the targets, in the order of positions (N, T, 3).
    """
    angles = check_array(
        _SOURCE, "joint_angles", arrays["joint_angles"], (None, robot.commands)
    )
    count = len(angles)
    positions = _check_targets("positions", arrays["positions"], count, targets)
    row, target = np.nonzero(~np.isnan(positions).all(axis=2))
    if not len(row):
        raise InputError(_SOURCE, "positions", "no measured position", "one or more")
    values = _name_columns(list_joint_columns(robot.commands), angles[row])
    values |= _name_columns("xyz", positions[row, target])
    if arrays["rotation_vectors"] is not None:
        turns = _check_targets(
            "rotation_vectors", arrays["rotation_vectors"], count, targets
        )
        values |= _name_columns(ROTATION, turns[row, target])
    if arrays["wrenches"] is not None:
        wrenches = _check_wrenches(arrays["wrenches"], count)
        values |= _name_columns(WRENCH_NAMES, wrenches[row])
    for name, column in columns.items():
        values[name] = check_array(
            _SOURCE, f"columns[{name!r}]", column, (count,), None
        )[row]
    if "target" not in values:
        if positions.shape[1] != len(targets):
            allowed = f"columns={{'target': ...}}, or positions (N, {len(targets)}, 3)"
            raise InputError(_SOURCE, "positions", "no target of a row", allowed)
        values["target"] = np.array(targets)[target]
    return _Rows(values, row + 1)


def _check_targets(
    argument: str, values: ArrayLike | None, count: int, targets: Sequence[str]
) -> np.ndarray:
    """Check values of targets, (N, 3) or (N, T, 3), and return them as (N, T, 3)."""
    array = np.asarray(values)
    if array.ndim == 2:
        return check_array(_SOURCE, argument, array, (count, 3))[:, None]
    return check_array(_SOURCE, argument, array, (count, len(targets), 3))


def _check_wrenches(values: ArrayLike | None, count: int) -> np.ndarray:
    """Check wrenches (N, 6), or forces (N, 3) whose moments are zero."""
    array = np.asarray(values)
    if array.ndim == 2 and array.shape[1] == 3:
        array = np.pad(array, ((0, 0), (0, 3)))
    return check_array(_SOURCE, "wrenches", array, (count, 6))


def _name_columns(names: Iterable[str], values: np.ndarray) -> dict[str, np.ndarray]:
    """Name the columns of an array (M, k)."""
    return dict(zip(names, values.T, strict=True))


def _make_table(rows: _Rows, robot: Robot) -> Cells:
    """Make the table of measurements, whose messages name arguments and their rows."""
    described = describe_columns(robot.commands)
    for name in rows.columns:
        if name not in described:
            allowed = suggest_names(name, sorted(described))
            raise InputError(_SOURCE, "columns", repr(name), allowed)
    headers = {name: f"columns[{name!r}]" for name in rows.columns}
    angles = list_joint_columns(robot.commands)
    for argument, names in (
        ("joint_angles", angles),
        ("positions", "xyz"),
        ("rotation_vectors", ROTATION),
        ("wrenches", WRENCH_NAMES),
    ):
        headers |= {name: f"{argument}[{index}]" for index, name in enumerate(names)}
    cells = Cells(_SOURCE, _encode(rows.columns), rows.numbers, headers=headers)
    numbers = _number_rows(cells, rows, cells.matrix(angles))
    return replace(cells, columns=_encode({**rows.columns, **numbers}))


def _number_rows(
    cells: Cells, rows: _Rows, joint_angles: np.ndarray
) -> dict[str, np.ndarray]:
    """Number poses, loads and repeats that no column states.

    Draws of held-out poses and folds refer to these numbers. Poses and loads are
    therefore numbered in the order of their joint angles and wrenches, which a
    permutation of the rows does not change.

    Parameters
    ----------
    cells, rows : the M measurements.
    joint_angles : (M, n) array, rad.
    """
    wrenches = [rows.columns[name] for name in WRENCH_NAMES if name in rows.columns]
    # numpy sorts by the last key first. Rows with equal keys are repeats.
    order = np.lexsort([*reversed(wrenches), *reversed(joint_angles.T)])
    columns = {name: column[order] for name, column in rows.columns.items()}
    ordered = cells.select(order)
    numbers = number_poses(ordered, joint_angles[order])
    numbers["target"] = np.array(ordered.texts("target"))
    numbers |= number_loads_and_repeats(ordered, columns | numbers)
    place = np.argsort(order)
    return {name: column[place] for name, column in numbers.items()}


def _encode(columns: Mapping[str, np.ndarray]) -> dict[str, pa.ChunkedArray]:
    """Encode columns as those of a table that was read."""
    return {name: pa.chunked_array([column]) for name, column in columns.items()}


def _complete_settings(
    settings: Mapping[str, Any], robot: Robot, *, has_loads: bool, is_pose: bool
) -> dict[str, Any]:
    """Complete the keys of campaign.yaml, and check them against its schema."""
    identifies = has_loads and not robot.compliance_known
    end = robot.chain.end_effector.name
    document = {
        "campaign": "campaign",
        "robot": robot.name,
        "measured": "pose" if is_pose else "position",
        "frame": "tracker",
        "targets": {_TARGET: {"point": end, "offset_m": UNKNOWN}},
        "compliance": "identify" if identifies else "nominal",
        "declared": list(GEOMETRY),
        "holdout": DEFAULT_HOLDOUT,
        **settings,
    }
    check_document(document, "campaign", _SOURCE)
    reading.check_declared(document, list_effects(), _SOURCE)
    check_regression(document, _SOURCE)
    return document
