"""The list of ways in which a file may have to be read otherwise: senses, axes, units, order of rows, frames and targets.

Senses, axes and units are facts, not parameters: each is tried, none is fitted. Where the base or the targets are is fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations, product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import groups_of
from elastocal.data_checks.placement import spread

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from elastocal.campaigns.campaign import Campaign, Measurements

# Poses enough to compare some two hundred hypotheses.
POSES = 40
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
class Hypothesis:
    """One way in which the file may have to be read otherwise.

    `name`: of the fault that it would be. `detail`: one sentence in plain words; of what is fitted, "frame" or "targets" alone,
    for the sentence comes from the fit. `read`: a campaign so. `joints`: from 1.
    """

    name: str
    detail: str
    read: Callable[[Campaign], Campaign]
    joints: tuple[int, ...] = ()


def discrete(campaign: Campaign) -> list[Hypothesis]:
    """Everything that is no fit, the simplest first."""
    oriented = campaign.measured == "pose"
    lists = [_senses(campaign.robot.joints), _lengths(campaign), _rotations() if oriented else ()]
    return [each for some in (*lists, _axes(campaign.frame == "tracker" and not oriented, oriented)) for each in some]


def fitted(campaign: Campaign) -> list[Hypothesis]:
    """Base or targets elsewhere, as far as the campaign says that it knows them."""
    found, offsets = [], any(target.offset_m is not None for target in campaign.targets)
    if campaign.frame == "base":
        found.append(Hypothesis("wrong_frame", "frame", lambda c: replace(c, frame="tracker")))
    if campaign.measured == "pose" and any(target.rotation is not None for target in campaign.targets):
        found.append(Hypothesis("wrong_target", "targets", partial(_with_unknown, {"rotation": None})))
    if offsets:
        found.append(Hypothesis("wrong_target", "targets", partial(_with_unknown, {"offset_m": None, "rotation": None})))
    return found


def shifts(campaign: Campaign) -> list[Hypothesis]:
    """Measured columns that stand a row further up or down, of all measurements: those left have others beside them."""
    measurements = campaign.measurements
    of_target = [measurements.session, measurements.target]
    alike = {
        "row": [measurements.session],
        "row of its target": of_target,
        "pose": [*of_target, measurements.load, measurements.repeat],
    }
    found = []
    for (kind, keys), steps in product(alike.items(), (1, -1)):
        order, source = np.argsort(measurements.row, kind="stable"), np.full(len(measurements), -1)
        number = groups_of(np.column_stack(keys))[1][order]
        for members in (order[number == group] for group in range(number.max() + 1)):
            first, second = members[:-1], members[1:]
            source[second if steps > 0 else first] = first if steps > 0 else second
        # Rows whose columns would come from before the first or from behind the last are left out.
        there = partial(np.take, indices=np.maximum(source, 0), axis=0)
        moved = columns(position=there, rotation_vector=there)(campaign).measurements.select(source >= 0)
        detail = f"the measured columns fit one {kind} further {'down' if steps > 0 else 'up'}"
        found.append(Hypothesis("shuffled_rows", detail, partial(_with_spread, moved)))
    return found


def _senses(joints: int) -> Iterator[Hypothesis]:
    """Joints counted the other way round, then those counted from their neighbours."""
    unit = np.eye(joints)
    for j in range(joints):
        detail = f"joint {j + 1} has the wrong sense: measurements fit with its sign turned"
        yield Hypothesis("wrong_sign", detail, partial(_with_angles, np.diag(1.0 - 2.0 * unit[j])), (j + 1,))
    for j, (sign, word) in product(range(joints - 1), ((1.0, "added to"), (-1.0, "taken from"))):
        detail = f"joint {j + 2} is counted from joint {j + 1}: measurements fit with the angle of joint {j + 1} {word} it"
        matrix = unit + sign * np.outer(unit[j + 1], unit[j])
        yield Hypothesis("wrong_sign", detail, partial(_with_angles, matrix), (j + 1, j + 2))


def _lengths(campaign: Campaign) -> Iterator[Hypothesis]:
    """Of positions, then of the offsets of all targets, or of one where there are several."""
    for unit, metres in _LENGTHS.items():
        detail = f"the positions look like {unit}: measurements fit {metres:g} times the written positions"
        yield Hypothesis("wrong_unit", detail, columns(position=partial(np.multiply, metres)))
    known = [target.name for target in campaign.targets if target.offset_m is not None and any(target.offset_m)]
    groups = [known, *([name] for name in known if len(known) > 1)] if known else []
    for names, (unit, metres) in product(groups, _LENGTHS.items()):
        read = f"measurements fit {metres:g} times what is written"
        detail = f"the target offset of {', '.join(names)} looks like {unit}: {read}"
        yield Hypothesis("wrong_unit", detail, partial(_with_offsets, names, metres))


def _rotations() -> Iterator[Hypothesis]:
    detail = "the rotation vectors fit turned round, as if they took base axes into the target's"
    yield Hypothesis("wrong_sign", detail, columns(rotation_vector=np.negative))
    for factor, words in _TURNS.items():
        detail = f"the rotation vectors look like {words}: measurements fit {1 / factor:.4g} times the written rotation vectors"
        yield Hypothesis("wrong_unit", detail, columns(rotation_vector=partial(np.multiply, 1 / factor)))
    for letters, words in _EULER.items():
        detail = f"the columns of the rotation vector look like {words}, in rad"
        yield Hypothesis("wrong_unit", detail, columns(rotation_vector=partial(_from_angles, letters)))


def _axes(mirrored_only: bool, oriented: bool) -> Iterator[Hypothesis]:
    """Axes exchanged or turned round, those of the fewest changes first; rotation vectors as written, or exchanged as well."""
    if mirrored_only:
        detail = "the measurements are mirrored: two axes are exchanged, or one is turned round, or joints have the wrong sense"
        yield Hypothesis("swapped_axes", detail, columns(position=_by(np.diag([1.0, 1.0, -1.0]))))
        return
    signed = product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    ways = [np.array(signs)[:, None] * np.eye(3)[list(order)] for order, signs in signed]
    ways.sort(key=lambda matrix: np.abs(matrix - np.eye(3)).sum())
    for matrix in ways[1:]:
        # What is to be read for the axes that change, such as x = -y.
        read = [f"{'-' if row.min() < 0 else ''}{'xyz'[np.argmax(np.abs(row))]}" for row in matrix]
        changed = ", ".join(f"{axis} = {other}" for axis, other in zip("xyz", read, strict=True) if axis != other)
        detail = f"the axes are exchanged: measurements fit with {changed}"
        yield Hypothesis("swapped_axes", detail, columns(position=_by(matrix)))
        handed = np.linalg.det(matrix)
        for sign in sorted({1.0, handed}) if oriented else ():
            words = f"{detail}, and their rotation vectors likewise{', turned round' if sign * handed > 0 > handed else ''}"
            yield Hypothesis("swapped_axes", words, columns(position=_by(matrix), rotation_vector=_by(sign * matrix)))


# Ways to read a campaign otherwise.


def _from_angles(letters: str, turned: np.ndarray) -> np.ndarray:
    return Rotation.from_euler(letters, turned).as_rotvec()


def _by(matrix: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda vectors: vectors @ matrix.T


def columns(**functions: Callable[[np.ndarray], np.ndarray]) -> Callable[[Campaign], Campaign]:
    """Interpretation of a campaign with functions of columns of its measurements in their places, as far as they are there."""

    def read(campaign: Campaign) -> Campaign:
        there = {name: getattr(campaign.measurements, name) for name in functions}
        changed = {name: functions[name](values) for name, values in there.items() if values is not None}
        return replace(campaign, measurements=replace(campaign.measurements, **changed))

    return read


def _with_spread(measurements: Measurements, campaign: Campaign) -> Campaign:
    return spread(replace(campaign, measurements=measurements), POSES)


def _with_angles(matrix: np.ndarray, campaign: Campaign) -> Campaign:
    # The sign of a column of the file, which counts from where the controller counts.
    robot = campaign.robot
    return columns(joint_angles=lambda q: robot.model_angles(robot.reported_angles(q) @ matrix.T))(campaign)


def _with_unknown(parts: Mapping[str, Any], campaign: Campaign) -> Campaign:
    seen = set(campaign.measurements.target.tolist())
    targets = [replace(t, **parts) if number in seen else t for number, t in enumerate(campaign.targets)]
    return replace(campaign, targets=tuple(targets))


def _with_offsets(names: Sequence[str], factor: float, campaign: Campaign) -> Campaign:
    scaled = {t.name: tuple(factor * value for value in t.offset_m or ()) for t in campaign.targets if t.name in names}
    targets = [replace(t, offset_m=scaled.get(t.name, t.offset_m)) for t in campaign.targets]
    return replace(campaign, targets=tuple(targets))
