"""Ways in which a file may have to be read otherwise: one list of hypotheses, compared
by how well the data then fit.

Senses, axes, units, order of rows, frames and targets. Tried where the measurements as
written are absurdly far from the nominal robot; the simplest that mends them is named.
Senses, axes and units are facts: each is tried, none is fitted. Where the base or the
targets are is fitted, and must fit far better.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations, product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import group_equal_rows
from elastocal.data_checks.placement import (
    FAR_BETTER,
    IMPLAUSIBLE_M,
    IMPLAUSIBLE_RAD,
    place_measurements,
    place_robustly,
    root_mean_square,
    select_spread_poses,
)
from elastocal.data_checks.protocol import Fault, Value

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.data_checks.placement import Placement

_IMPLAUSIBLE = np.array([IMPLAUSIBLE_M, IMPLAUSIBLE_RAD])
# Poses enough to compare some two hundred hypotheses.
_POSES = 40
# What a correction leaves as it is may come out this much larger by chance.
_NO_WORSE = 1.2
# Hypotheses whose misfits differ by less than this share, or by less than a tracker
# could tell, fit alike; so many are said.
_ALIKE = 1.1
_ALIKE_M = 1e-4
_MOST_ALIKE = 5
# A base that stands less far off than this may be the zero of the first joint or the
# height of the column, a target the length of the last link: for physics to tell. Ten
# times what geometric errors of industrial robots reach.
_NEAR_M = 0.05
_NEAR_RAD = 0.05
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
# Angles that people write for a rotation vector, as letters of scipy: capital ones turn
# about the moved axes.
_EULER = {
    "XYZ": "Euler angles about the moved x, y, z",
    "xyz": "angles about the fixed x, y, z (roll, pitch, yaw)",
}


@dataclass(frozen=True)
class Hypothesis:
    """One way in which the file may have to be read otherwise.

    `name`: of the fault that it would be. `detail`: one sentence in plain words.
    `read`: a campaign so. `joints`: from 1. `found`: of what is fitted, the sentence of
    placements as written and so read; None where it is near enough for physics.
    """

    name: str
    detail: str
    read: Callable[[Campaign], Campaign]
    joints: tuple[int, ...] = ()
    found: Callable[[Placement, Placement], str | None] | None = None


def find_better_interpretation(campaign: Campaign) -> list[Fault]:
    """The simplest way to read the file otherwise that lets absurd measurements fit,
    beside those that fit as well; or none."""
    few = select_spread_poses(campaign, _POSES)
    by_rows = list_row_shifts(campaign)
    loaded = campaign.measurements.load > 0
    found = _mended(
        few, [*list_discrete_hypotheses(few), *by_rows], list_fitted_hypotheses(few)
    )
    if found or not loaded.any():
        return found
    # Rows of one pose that stand a row off show it at the last load alone, where the
    # next pose's stand.
    return _mended(
        select_spread_poses(
            replace(campaign, measurements=campaign.measurements.select(loaded)), _POSES
        ),
        by_rows,
    )


def _mended(campaign: Campaign, *tried: Sequence[Hypothesis]) -> list[Fault]:
    """Fault of the hypothesis that mends the measurements: of the first list, unless
    one of the next is far better."""
    written = place_robustly(campaign)
    if (written.misfit <= _IMPLAUSIBLE).all():
        return []
    found = [
        best for some in tried if some and (best := _best(campaign, written, some))
    ]
    if len(found) > 1 and found[1][0] >= found[0][0] / FAR_BETTER:
        found.pop()
    return [fault for _, fault in found[-1:] if fault]


def _best(
    campaign: Campaign, written: Placement, tried: Sequence[Hypothesis]
) -> tuple[float, Fault | None] | None:
    """What the first of those that fit best leaves, m, and its fault, if it is one;
    None where it does not convince."""
    left = np.array(
        [_length(place_measurements(each.read(campaign)).misfit) for each in tried]
    )
    alike = [
        each
        for each, lies in zip(tried, left, strict=True)
        if lies <= max(_ALIKE * left.min(), left.min() + _ALIKE_M)
    ]
    best = alike[0]
    others = tuple(each.detail for each in alike[1 : 1 + _MOST_ALIKE])
    found = place_robustly(best.read(campaign))
    evidence = _evidence(written, found)
    if evidence is None:
        return None
    detail = best.found(written, found) if best.found else best.detail
    poses = Value(
        "poses compared", float(len(np.unique(found.observations.states.pose))), "–"
    )
    fault = (
        Fault(best.name, best.joints, detail, (poses,), evidence, alternatives=others)
        if detail
        else None
    )
    return _length(found.misfit), fault


def _length(misfit: np.ndarray) -> float:
    """What is left of positions and orientations together, m."""
    return float(np.hypot(misfit[0], IMPLAUSIBLE_M / IMPLAUSIBLE_RAD * misfit[1]))


def _evidence(written: Placement, found: Placement) -> tuple[float, float] | None:
    """RMS before and after, of positions or else of orientations; None where a
    correction does not convince."""
    before = written.misfit
    after = found.misfit
    target = found.observations.target
    predicted = [found.predicted[target == number] for number in np.unique(target)]
    extent = max(
        root_mean_square(np.linalg.norm(points - points.mean(axis=0), axis=1))
        for points in predicted
    )
    # Where the robot hardly moves, anything that gathers the measurements in one place
    # would fit.
    limit = np.minimum(
        before / FAR_BETTER, np.minimum(_IMPLAUSIBLE, [extent / FAR_BETTER, np.inf])
    )
    better = (before > _IMPLAUSIBLE) & (after < limit)
    no_worse = after <= np.maximum(_NO_WORSE * before, _IMPLAUSIBLE)
    for one, other in ((0, 1), (1, 0)):
        if better[one] and no_worse[other]:
            return float(before[one]), float(after[one])
    return None


def list_discrete_hypotheses(campaign: Campaign) -> list[Hypothesis]:
    """Everything that is no fit, the simplest first."""
    oriented = campaign.measured == "pose"
    axes = _axes(campaign.frame == "tracker" and not oriented, oriented)
    return [
        *_senses(campaign.robot.joints),
        *_lengths(campaign),
        *(_rotations() if oriented else ()),
        *axes,
    ]


def list_fitted_hypotheses(campaign: Campaign) -> list[Hypothesis]:
    """Base or targets elsewhere, as far as the campaign says that it knows them."""
    found = []
    targets = campaign.targets
    if campaign.frame == "base":
        detail = "the base stands elsewhere"
        read = partial(replace, frame="tracker")
        found.append(Hypothesis("wrong_frame", detail, read, found=_base_elsewhere))
    unknown: dict[str, dict[str, Any]] = {}
    if campaign.measured == "pose" and any(
        target.rotation is not None for target in targets
    ):
        unknown["targets are turned otherwise"] = {"rotation": None}
    if any(target.offset_m is not None for target in targets):
        unknown["targets sit elsewhere"] = {"offset_m": None, "rotation": None}
    for detail, parts in unknown.items():
        found.append(
            Hypothesis(
                "wrong_target",
                detail,
                partial(_with_unknown, parts),
                found=_targets_elsewhere,
            )
        )
    return found


def _base_elsewhere(_: Placement, found: Placement) -> str | None:
    """Sentence of a base that stands elsewhere, of several sessions the farthest."""
    away = float(np.linalg.norm(found.estimate.frame_position, axis=1).max())
    turned = float(
        Rotation.from_matrix(found.estimate.frame_rotation).magnitude().max()
    )
    if away <= _NEAR_M and turned <= _NEAR_RAD:
        return None
    where = f"{away:.3g} m away, turned by {np.degrees(turned):.3g}°"
    return f"measurements do not lie in the base frame: the robot would stand {where}"


def _targets_elsewhere(written: Placement, found: Placement) -> str | None:
    """Sentence of targets that sit elsewhere or are turned, with the remedy."""
    before = written.estimate
    after = found.estimate
    targets = found.model.targets
    turns = Rotation.from_matrix(
        before.target_rotation.transpose(0, 2, 1) @ after.target_rotation
    ).magnitude()
    away = np.linalg.norm(after.target_offset - before.target_offset, axis=1)
    if away.max() <= _NEAR_M and turns.max() <= IMPLAUSIBLE_RAD:
        return None
    wrong = {}
    if away.max() > IMPLAUSIBLE_M:
        wrong["offset_m"] = (
            f"{targets[int(np.argmax(away))].name} would sit {1e3 * away.max():.3g} mm from there"
        )
    if turns.max() > IMPLAUSIBLE_RAD:
        wrong["rotation"] = (
            f"{targets[int(np.argmax(turns))].name} would be turned by {np.degrees(turns.max()):.3g}°"
        )
    remedy = " and ".join(f"{key}: unknown" for key in wrong)
    fits = f"where its mount is not as stated, {remedy} in campaign.yaml fits it, and known values may stand there"
    return f"targets do not sit where the campaign says: {' and '.join(wrong.values())}; {fits}"


def list_row_shifts(campaign: Campaign) -> list[Hypothesis]:
    """Measured columns that stand a row further up or down, of all measurements: those
    left have others beside them."""
    measurements = campaign.measurements
    found = []
    of_target = [measurements.session, measurements.target]
    alike = {
        "row": [measurements.session],
        "row of its target": of_target,
        "pose": [*of_target, measurements.load, measurements.repeat],
    }
    for kind, keys in alike.items():
        group = group_equal_rows(np.column_stack(keys))[1]
        order = np.lexsort((measurements.row, group))
        rows = np.array([order[:-1], order[1:]])[
            :, group[order[1:]] == group[order[:-1]]
        ]
        # No row has another beside it where each load has a number of its own.
        for way, (source, at) in (
            (("down", rows), ("up", rows[::-1])) if rows.size else ()
        ):
            detail = f"the measured columns fit one {kind} further {way}"
            found.append(
                Hypothesis(
                    "shuffled_rows", detail, partial(_moved, measurements, source, at)
                )
            )
    return found


def _senses(joints: int) -> Iterator[Hypothesis]:
    """Joints counted the other way round, then those counted from their neighbours."""
    unit = np.eye(joints)
    for j in range(joints):
        detail = (
            f"joint {j + 1} has the wrong sense: measurements fit with its sign turned"
        )
        yield Hypothesis(
            "wrong_sign",
            detail,
            partial(_with_angles, np.diag(1.0 - 2.0 * unit[j])),
            (j + 1,),
        )
    for j, (sign, word) in product(
        range(joints - 1), ((1.0, "added to"), (-1.0, "taken from"))
    ):
        detail = f"joint {j + 2} is counted from joint {j + 1}: measurements fit with the angle of joint {j + 1} {word} it"
        matrix = unit + sign * np.outer(unit[j + 1], unit[j])
        yield Hypothesis(
            "wrong_sign", detail, partial(_with_angles, matrix), (j + 1, j + 2)
        )


def _lengths(campaign: Campaign) -> Iterator[Hypothesis]:
    """Of positions, then of the offsets of all targets, or of one where there are
    several."""
    for unit, metres in _LENGTHS.items():
        detail = f"the positions look like {unit}: measurements fit {metres:g} times the written positions"
        yield Hypothesis(
            "wrong_unit",
            detail,
            transform_columns(position=partial(np.multiply, metres)),
        )
    known = [
        target.name
        for target in campaign.targets
        if target.offset_m is not None and any(target.offset_m)
    ]
    groups = [known, *([name] for name in known if len(known) > 1)] if known else []
    for names, (unit, metres) in product(groups, _LENGTHS.items()):
        read = f"measurements fit {metres:g} times what is written"
        detail = f"the target offset of {', '.join(names)} looks like {unit}: {read}"
        yield Hypothesis("wrong_unit", detail, partial(_with_offsets, names, metres))


def _rotations() -> Iterator[Hypothesis]:
    detail = "the rotation vectors fit turned round, as if they took base axes into the target's"
    yield Hypothesis(
        "wrong_sign", detail, transform_columns(rotation_vector=np.negative)
    )
    for letters, words in _EULER.items():
        detail = f"the columns of the rotation vector look like {words}, in rad"
        yield Hypothesis(
            "wrong_unit",
            detail,
            transform_columns(rotation_vector=partial(_from_angles, letters)),
        )


def _axes(mirrored_only: bool, oriented: bool) -> Iterator[Hypothesis]:
    """Axes exchanged or turned round, those of the fewest changes first; rotation
    vectors as written, or exchanged as well."""
    if mirrored_only:
        detail = "the measurements are mirrored: two axes are exchanged, or one is turned round, or joints have the wrong sense"
        yield Hypothesis(
            "swapped_axes",
            detail,
            transform_columns(position=_by(np.diag([1.0, 1.0, -1.0]))),
        )
        return
    signed = product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    ways = [
        np.array(signs)[:, None] * np.eye(3)[list(order)] for order, signs in signed
    ]
    ways.sort(key=lambda matrix: np.abs(matrix - np.eye(3)).sum())
    for matrix in ways[1:]:
        # What is to be read for the axes that change, such as x = -y.
        read = [
            f"{'-' if row.min() < 0 else ''}{'xyz'[np.argmax(np.abs(row))]}"
            for row in matrix
        ]
        changed = ", ".join(
            f"{axis} = {other}"
            for axis, other in zip("xyz", read, strict=True)
            if axis != other
        )
        detail = f"the axes are exchanged: measurements fit with {changed}"
        yield Hypothesis(
            "swapped_axes", detail, transform_columns(position=_by(matrix))
        )
        handed = np.linalg.det(matrix)
        for sign in sorted({1.0, handed}) if oriented else ():
            words = f"{detail}, and their rotation vectors likewise{', turned round' if sign * handed > 0 > handed else ''}"
            yield Hypothesis(
                "swapped_axes",
                words,
                transform_columns(
                    position=_by(matrix), rotation_vector=_by(sign * matrix)
                ),
            )


# Ways to read a campaign otherwise.


def _from_angles(letters: str, turned: np.ndarray) -> np.ndarray:
    return Rotation.from_euler(letters, turned).as_rotvec()


def _by(matrix: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda vectors: vectors @ matrix.T


def transform_columns(
    **functions: Callable[[np.ndarray], np.ndarray],
) -> Callable[[Campaign], Campaign]:
    """Interpretation of a campaign with functions of columns of its measurements in
    their places, as far as they are there."""

    def read(campaign: Campaign) -> Campaign:
        there = {name: getattr(campaign.measurements, name) for name in functions}
        changed = {
            name: functions[name](values)
            for name, values in there.items()
            if values is not None
        }
        return replace(campaign, measurements=replace(campaign.measurements, **changed))

    return read


def _moved(
    measurements: Measurements, source: np.ndarray, at: np.ndarray, campaign: Campaign
) -> Campaign:
    read = measurements.select(source)
    moved = replace(
        measurements.select(at),
        position=read.position,
        rotation_vector=read.rotation_vector,
    )
    return select_spread_poses(replace(campaign, measurements=moved), _POSES)


def _with_angles(matrix: np.ndarray, campaign: Campaign) -> Campaign:
    # The sign of a column of the file, which counts from where the controller counts.
    robot = campaign.robot
    return transform_columns(
        joint_angles=lambda q: robot.model_angles(robot.reported_angles(q) @ matrix.T)
    )(campaign)


def _with_unknown(parts: Mapping[str, Any], campaign: Campaign) -> Campaign:
    seen = set(campaign.measurements.target.tolist())
    targets = [
        replace(t, **parts) if number in seen else t
        for number, t in enumerate(campaign.targets)
    ]
    return replace(campaign, targets=tuple(targets))


def _with_offsets(names: Sequence[str], factor: float, campaign: Campaign) -> Campaign:
    scaled = {
        t.name: tuple(factor * value for value in t.offset_m or ())
        for t in campaign.targets
        if t.name in names
    }
    targets = [
        replace(t, offset_m=scaled.get(t.name, t.offset_m)) for t in campaign.targets
    ]
    return replace(campaign, targets=tuple(targets))
