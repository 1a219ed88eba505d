"""Every way in which a file may have to be read otherwise: senses of joints, axes, units, order of rows, frames and targets.

No NAMES: the hypotheses that `alternatives` scores. Senses, axes and units are facts, not parameters: each is tried, none is
fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import permutations, product
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from elastocal.data_checks.placement import spread, with_measured
from elastocal.data_checks.protocol import Value

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from elastocal.campaigns.campaign import Campaign, Measurements

# Poses enough to compare some two hundred hypotheses.
POSES = 40
IN_SESSION = " in session "
# Metres for each unit that people write for metres.
_LENGTHS = {
    "millimetres": 1e-3,
    "centimetres": 1e-2,
    "decimetres": 0.1,
    "inches": 0.0254,
    "feet": 0.3048,
    "tenths of what they should be": 10.0,
    "hundredths of what they should be": 100.0,
    "thousandths of what they should be": 1e3,
}
# What rotation vectors were multiplied by before they were written.
_TURNS = {
    0.5: "halves of what they should be",
    2.0: "doubles of what they should be",
    180 / np.pi: "degrees",
    np.pi / 180: "radians converted twice",
}
# Angles that people write for a rotation vector, as letters of scipy: capital ones turn about the moved axes.
_EULER = {"XYZ": "Euler angles about the moved x, y, z", "xyz": "angles about the fixed x, y, z (roll, pitch, yaw)"}


@dataclass(frozen=True)
class Change:
    """One way in which the file may have to be read otherwise.

    `name`: of the fault that it would be. `detail`: one sentence in plain words. `correct`: reads a campaign so. `joints`: from
    1. `placement`: what it fits; its sentence and its numbers then come from the fit.
    """

    name: str
    detail: str
    correct: Callable[[Campaign], Campaign] = field(compare=False)
    joints: tuple[int, ...] = ()
    parameters: tuple[Value, ...] = ()
    placement: str = ""


def hypotheses(campaign: Campaign, first: Sequence[Change] = ()) -> tuple[list[Change], list[Change]]:
    """Everything that is tried: what is discrete, and what is fitted, which is preferred only where it is far better."""
    oriented = campaign.measured == "pose"
    single = [*_senses(campaign.robot.joints), *_lengths(campaign)]
    single += [*(_rotations() if oriented else []), *_axes(campaign.frame == "tracker" and not oriented, oriented), *first]
    return single, _placements(campaign)


def _placements(campaign: Campaign) -> list[Change]:
    """Changes that fit where the base or the targets are, as far as the campaign says that it knows them."""
    found = []
    if campaign.frame == "base":
        found.append(Change("wrong_frame", "", lambda c: replace(c, frame="tracker"), placement="frame"))
    unknown: list[dict[str, None]] = []
    if campaign.measured == "pose" and any(target.rotation is not None for target in campaign.targets):
        unknown.append({"rotation": None})
    if any(target.offset_m is not None for target in campaign.targets):
        unknown.append({"offset_m": None, "rotation": None})
    found += [Change("wrong_target", "", partial(with_unknown, parts), placement="targets") for parts in unknown]
    if len(_mounts(campaign.measurements)) > len(np.unique(campaign.measurements.target)):
        found.append(Change("mounted_anew", "", _with_a_mount_each_session, placement="mounts"))
    return found


def _senses(joints: int) -> list[Change]:
    """Joints counted the other way round, then those counted from their neighbours."""
    unit, found = np.eye(joints), []
    for j in range(joints):
        detail = f"joint {j + 1} has the wrong sense: measurements fit with its sign turned"
        found.append(Change("wrong_sign", detail, partial(_with_angles, np.diag(1.0 - 2.0 * unit[j])), (j + 1,)))
    for j, (sign, word) in product(range(joints - 1), ((1.0, "added to"), (-1.0, "taken from"))):
        detail = f"joint {j + 2} is counted from joint {j + 1}: measurements fit with the angle of joint {j + 1} {word} it"
        matrix = unit + sign * np.outer(unit[j + 1], unit[j])
        found.append(Change("wrong_sign", detail, partial(_with_angles, matrix), (j + 1, j + 2)))
    return found


def shifts(measurements: Measurements) -> list[Change]:
    """Measured columns that stand a row further up or down, of all measurements: those left have others beside them."""
    of_target = [measurements.session, measurements.target]
    alike = {
        "row": [measurements.session],
        "row of its target": of_target,
        "pose": [*of_target, measurements.load, measurements.repeat],
    }
    found = []
    for (kind, columns), steps in product(alike.items(), (1, -1)):
        order, source = np.argsort(measurements.row, kind="stable"), np.empty(len(measurements), int)
        source[order] = pd.Series(order).groupby([column[order] for column in columns]).shift(steps, fill_value=-1)
        detail = f"the measured columns fit one {kind} further {'down' if steps > 0 else 'up'}"
        moved = partial(_with_shifted, measurements, source)
        found.append(Change("shuffled_rows", detail, moved, (), (Value("shift", float(steps), "–"),)))
    return found


def _lengths(campaign: Campaign) -> list[Change]:
    """Of positions, then of the offsets of all targets, or of one where there are several."""
    found = []
    for unit, metres in _LENGTHS.items():
        detail = f"the positions look like {unit}: measurements fit {metres:g} times the written positions"
        factor = Value("metres for each unit of position written", metres, "m")
        found.append(Change("wrong_unit", detail, partial(_with_axes, metres * np.eye(3), None), (), (factor,)))
    known = [target.name for target in campaign.targets if target.offset_m is not None and any(target.offset_m)]
    groups = [known, *([name] for name in known if len(known) > 1)] if known else []
    for names, (unit, metres) in product(groups, _LENGTHS.items()):
        which = f"the offset of {names[0]} looks" if len(names) == 1 < len(known) else "the target offsets look"
        which = "the target offset looks" if len(known) == 1 else which
        detail = f"{which} like {unit}: measurements fit {metres:g} times what is written for {', '.join(names)}"
        factor = Value("metres for each unit of target offset written", metres, "m")
        found.append(Change("wrong_unit", detail, partial(_with_offsets, names, metres), (), (factor,)))
    return found


def _rotations() -> list[Change]:
    detail = "the rotation vectors fit turned round, as if they took base axes into the target's"
    found = [Change("wrong_sign", detail, partial(_with_rotations, np.negative))]
    for factor, words in _TURNS.items():
        detail = f"the rotation vectors look like {words}: measurements fit {1 / factor:.4g} times the written rotation vectors"
        value = Value("radians for each unit of rotation vector written", 1 / factor, "rad")
        divided = partial(_with_rotations, partial(np.multiply, 1 / factor))
        found.append(Change("wrong_unit", detail, divided, (), (value,)))
    for letters, words in _EULER.items():
        detail = f"the columns of the rotation vector look like {words}, in rad"
        read = partial(_with_rotations, partial(_from_angles, letters))
        found.append(Change("wrong_unit", detail, read))
    return found


def _from_angles(letters: str, turned: np.ndarray) -> np.ndarray:
    return Rotation.from_euler(letters, turned).as_rotvec()


def _axes(mirrored_only: bool, oriented: bool) -> list[Change]:
    """Axes exchanged or turned round, those of the fewest changes first; rotation vectors as written, or exchanged as well."""
    if mirrored_only:
        detail = "the measurements are mirrored: two axes are exchanged, or one is turned round, or joints have the wrong sense"
        return [Change("swapped_axes", detail, partial(_with_axes, np.diag([1.0, 1.0, -1.0]), None))]
    ways = [
        np.array(signs)[:, None] * np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    ways.sort(key=lambda matrix: np.abs(matrix - np.eye(3)).sum())
    found = []
    for matrix in ways[1:]:
        detail = f"the axes are exchanged: measurements fit with {_axes_in_words(matrix)}"
        found.append(Change("swapped_axes", detail, partial(_with_axes, matrix, None)))
        handed = np.linalg.det(matrix)
        for sign in sorted({1.0, handed}) if oriented else ():
            words = f"{detail}, and their rotation vectors likewise{', turned round' if sign * handed > 0 > handed else ''}"
            found.append(Change("swapped_axes", words, partial(_with_axes, matrix, sign * matrix)))
    return found


def _axes_in_words(matrix: np.ndarray) -> str:
    """Such as ``x = -y, y = x``: what is to be read for the axes that change."""
    written = [f"{'-' if row.min() < 0 else ''}{'xyz'[np.argmax(np.abs(row))]}" for row in matrix]
    return ", ".join(f"{axis} = {read}" for axis, read in zip("xyz", written, strict=True) if axis != read)


# Ways to read a campaign otherwise, by what comes before it.


def _with_angles(matrix: np.ndarray, campaign: Campaign) -> Campaign:
    # The sign of a column of the file, which counts from where the controller counts.
    reported = campaign.robot.reported_angles(campaign.measurements.joint_angles)
    return measured_otherwise(campaign, joint_angles=campaign.robot.model_angles(reported @ matrix.T))


def _with_axes(matrix: np.ndarray, turning: np.ndarray | None, campaign: Campaign) -> Campaign:
    """Positions by a matrix, and rotation vectors, which stay as they are without one of theirs."""
    vectors = campaign.measurements.rotation_vector
    vectors = vectors if turning is None or vectors is None else vectors @ turning.T
    return measured_otherwise(campaign, position=campaign.measurements.position @ matrix.T, rotation_vector=vectors)


def _with_shifted(measurements: Measurements, source: np.ndarray, campaign: Campaign) -> Campaign:
    """Some of all measurements, each with the measured columns of the row at its `source`, left out where that is -1."""
    moved = with_measured(measurements, np.maximum(source, 0)).select(source >= 0)
    return replace(campaign, measurements=spread(moved, POSES))


def _with_rotations(function: Callable[[np.ndarray], np.ndarray], campaign: Campaign) -> Campaign:
    vectors = campaign.measurements.rotation_vector
    return measured_otherwise(campaign, rotation_vector=None if vectors is None else function(vectors))


def measured_otherwise(campaign: Campaign, **columns: Any) -> Campaign:
    return replace(campaign, measurements=replace(campaign.measurements, **columns))


def with_unknown(parts: Mapping[str, Any], campaign: Campaign) -> Campaign:
    seen = set(campaign.measurements.target.tolist())
    targets = [replace(t, **parts) if number in seen else t for number, t in enumerate(campaign.targets)]
    return replace(campaign, targets=tuple(targets))


def _with_offsets(names: Collection[str], factor: float, campaign: Campaign) -> Campaign:
    targets = [
        replace(target, offset_m=tuple(factor * value for value in target.offset_m))
        if target.offset_m is not None and target.name in names
        else target
        for target in campaign.targets
    ]
    return replace(campaign, targets=tuple(targets))


def _with_a_mount_each_session(campaign: Campaign) -> Campaign:
    measurements, mounts = campaign.measurements, _mounts(campaign.measurements)
    named = [(campaign.targets[target], session) for target, session in mounts]
    targets = [replace(t, name=f"{t.name}{IN_SESSION}{session}", offset_m=None, rotation=None) for t, session in named]
    number = {mount: index for index, mount in enumerate(mounts)}
    each = np.array([number[mount] for mount in zip(measurements.target, measurements.session, strict=True)])
    return replace(measured_otherwise(campaign, target=each), targets=tuple(targets))


def _mounts(measurements: Measurements) -> list[tuple[int, int]]:
    """Targets and the sessions in which they are measured."""
    return sorted(set(zip(measurements.target.tolist(), measurements.session.tolist(), strict=True)))
