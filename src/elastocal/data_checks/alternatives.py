"""Other ways to read the file: senses of joints, axes, units, frames and targets, compared by how well the data then fit.

One scan over a short list of hypotheses, nearly all of them discrete. They are only compared where the measurements as written
are absurdly far from the nominal robot, and the simplest that mends them is named: one discrete change first, then a base or
targets that stand elsewhere or were mounted anew, then two changes together. Senses, axes and units are facts, not parameters:
each is tried, none is fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, permutations, product
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from elastocal.data_checks.placement import (
    FAR_BETTER,
    IMPLAUSIBLE_M,
    IMPLAUSIBLE_RAD,
    of_each_target,
    placed,
    rms,
    robustly_placed,
    spread,
    trimmed_rms,
    with_measured,
)
from elastocal.data_checks.protocol import Fault, Value

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from elastocal.campaigns.campaign import Campaign, Measurements, Target
    from elastocal.data_checks.placement import Placement
    from elastocal.fitting.model import Estimate

NAMES, FAMILY, AFTER = (
    ("wrong_sign", "swapped_axes", "wrong_unit", "wrong_frame", "wrong_target", "mounted_anew", "shuffled_rows"),
    "data",
    ("constant_columns",),
)

# Poses enough to compare some two hundred hypotheses.
_POSES = 40
# What a correction leaves as it is may come out this much larger by chance.
_NO_WORSE = 1.2
# Hypotheses whose misfits differ by less than this share, or by less than a tracker could tell, fit alike.
_ALIKE, _ALIKE_M = 1.1, 1e-4
_MOST_ALIKE = 5
# A base that stands less far off than this may be the zero of the first joint or the height of the column: for physics to
# tell, and a warning here. Ten times what geometric errors of industrial robots reach.
_NEAR_M, _NEAR_RAD = 0.05, 0.05
# Faults that are mended one after the other.
_ROUNDS = 3
_IN_SESSION = " in session "
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


@dataclass(frozen=True)
class Misfit:
    """What is left of positions (m) and orientations (rad)."""

    position_m: float
    orientation_rad: float

    @property
    def together(self) -> float:
        """Both as a length, m."""
        return float(np.hypot(self.position_m, IMPLAUSIBLE_M / IMPLAUSIBLE_RAD * self.orientation_rad))

    @property
    def implausible(self) -> bool:
        """Whether no geometric error and no deflection could make it."""
        return self.position_m > IMPLAUSIBLE_M or self.orientation_rad > IMPLAUSIBLE_RAD


@dataclass(frozen=True)
class Reading:
    """A campaign read with some changes, and where it then lies beside the nominal robot."""

    changes: tuple[Change, ...]
    campaign: Campaign
    placement: Placement

    def misfit(self, measure: Callable[[np.ndarray], float]) -> Misfit:
        """Of the target that fits worst: the others say nothing of its mount."""
        measurements, turn = self.campaign.measurements, self.placement.turn
        each = [measurements.target == target for target in np.unique(measurements.target)]
        turned = 0.0 if turn is None else max(measure(turn[mine]) for mine in each)
        return Misfit(max(measure(self.placement.distance[mine]) for mine in each), turned)


def find(campaign: Campaign, measurements: Measurements) -> list[Fault]:
    """The simplest ways to read the file otherwise that let absurd measurements fit.

    Returns each beside the alternatives that fit as well.
    """
    few = replace(campaign, measurements=spread(measurements, _POSES))
    found = _one_after_the_other(few, _shifts(measurements))
    if found or campaign.measured == "position":
        return found
    if slight := _slightly_turned(few):
        return slight
    # Where orientations do not go with positions in any way, positions alone may still tell.
    found = _one_after_the_other(_measured(replace(few, measured="position"), rotation_vector=None), [])
    return [replace(fault, detail=f"{fault.detail} (positions alone: orientations do not go with them)") for fault in found]


def _one_after_the_other(campaign: Campaign, first: Sequence[Change]) -> list[Fault]:
    """Faults that are mended one after the other; `first`: changes that are tried of the file as it stands alone."""
    found: list[Fault] = []
    for number in range(_ROUNDS):
        new, campaign = _mended(campaign, () if number else first)
        known = {(fault.name, fault.detail) for fault in found}
        new = [fault for fault in new if (fault.name, fault.detail) not in known]
        found += new
        if not any(fault.decisive for fault in new):
            break
    return found


def _slightly_turned(campaign: Campaign) -> list[Fault]:
    """A mount turned by as much as the zero of a joint may be off, but seldom is: for physics to tell, and a warning."""
    freed = _with_unknown({"rotation": None}, campaign)
    written, fitted = (robustly_placed(each, campaign.measurements) for each in (campaign, freed))
    detail, parameters, _ = _target_fault(campaign.targets, written.estimate, fitted.estimate, np.inf, _NEAR_RAD)
    if not detail or written.turn is None or fitted.turn is None:
        return []
    return [Fault("wrong_target", (), detail, parameters, (rms(written.turn), rms(fitted.turn)), (), False, ())]


def hypotheses(campaign: Campaign, first: Sequence[Change] = ()) -> Iterator[list[list[tuple[Change, ...]]]]:
    """Everything that is tried, the simplest first, each stage where none before convinces.

    Of a stage what is discrete comes before what is fitted, which is preferred only where it is far better.
    """
    oriented = campaign.measured == "pose"
    single = [*_senses(campaign.robot.joints), *_lengths_of_positions(), *_lengths_of_targets(campaign)]
    single += [*(_rotations() if oriented else []), *_axes(campaign.frame == "tracker" and not oriented, oriented), *first]
    fitted = _placements(campaign)
    yield [[(change,) for change in single], [(change,) for change in fitted]]
    pairs: list[tuple[Change, ...]] = []
    for change in fitted:
        if change.placement == "frame":
            elsewhere = replace(campaign, frame="tracker")
            others = [*fitted, *next(hypotheses(elsewhere))[0], *(_axes(True, False) if oriented else [])]
            alone = [other[0] if isinstance(other, tuple) else other for other in others]
            pairs += [(change, other) for other in alone if other is not change]
    yield [[*pairs, *combinations(_senses(campaign.robot.joints)[: campaign.robot.joints], 2)]]


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
    found += [Change("wrong_target", "", partial(_with_unknown, parts), placement="targets") for parts in unknown]
    if len(_mounts(campaign.measurements)) > len(np.unique(campaign.measurements.target)):
        found.append(Change("mounted_anew", "", _with_a_mount_each_session, placement="mounts"))
    return found


def _mended(campaign: Campaign, first: Sequence[Change]) -> tuple[list[Fault], Campaign]:
    """Faults of the simplest hypothesis that mends the measurements, and the campaign as it is then read."""
    written = Reading((), campaign, robustly_placed(campaign, campaign.measurements))
    # All measurements but a few, or all: a joint may move in a few poses only.
    measures = [measure for measure in (trimmed_rms, rms) if written.misfit(measure).implausible]
    if not measures:
        return [], campaign
    for stage in hypotheses(campaign, first):
        tried = [[_read(campaign, changes) for changes in part] for part in stage]
        for measure in measures:
            before, best = written.misfit(measure), None
            for part in tried:
                winner = _best(part, before, measure) if part else None
                if winner and (best is None or winner[1].together < best[1].together / FAR_BETTER):
                    best = winner
            if best:
                return _faults(written, before, *best), best[0].campaign
    return [], campaign


def _read(campaign: Campaign, changes: tuple[Change, ...]) -> Reading:
    for change in changes:
        campaign = change.correct(campaign)
    return Reading(changes, campaign, placed(campaign, campaign.measurements))


_Winner = tuple[Reading, Misfit, tuple[float, float], tuple[str, ...]]


def _best(tried: Sequence[Reading], before: Misfit, measure: Callable[[np.ndarray], float]) -> _Winner | None:
    """The first of the readings that fit best, if it convinces: what it leaves, the evidence, and what fits alike."""
    misfits = [one.misfit(measure) for one in tried]
    together = np.array([misfit.together for misfit in misfits])
    positions, orientations = np.array([(misfit.position_m, misfit.orientation_rad) for misfit in misfits]).T
    # One of two faults may concern positions alone, or orientations alone.
    for key in (together, positions + 1e-3 * together, orientations + 1e-3 * together):
        alike = np.flatnonzero(key <= max(_ALIKE * key.min(), key.min() + _ALIKE_M))
        best = tried[alike[0]]
        best = replace(best, placement=robustly_placed(best.campaign, best.campaign.measurements))
        after = best.misfit(measure)
        if evidence := _evidence(before, after, best):
            others = [tried[n].changes[0].detail for n in alike[1 : 1 + _MOST_ALIKE] if len(tried[n].changes) == 1]
            return best, after, evidence, tuple(detail for detail in others if detail) * (len(best.changes) == 1)
    return None


def _evidence(written: Misfit, corrected: Misfit, reading: Reading) -> tuple[float, float] | None:
    """RMS before and after, of positions or else of orientations; None where a correction does not convince."""
    predicted = [reading.placement.predicted[members] for members in of_each_target(reading.campaign.measurements)]
    extent = max(rms(np.linalg.norm(points - points.mean(axis=0), axis=1)) for points in predicted)
    positions = written.position_m, corrected.position_m
    orientations = written.orientation_rad, corrected.orientation_rad
    # Where the robot hardly moves, anything that gathers the measurements in one place would fit.
    limit = min(IMPLAUSIBLE_M, extent / FAR_BETTER)
    for (before, after), (other_before, other_after), implausible, needed, plausible in (
        (positions, orientations, IMPLAUSIBLE_M, limit, IMPLAUSIBLE_RAD),
        (orientations, positions, IMPLAUSIBLE_RAD, IMPLAUSIBLE_RAD, IMPLAUSIBLE_M),
    ):
        improved = before > implausible and after < min(before / FAR_BETTER, needed)
        if improved and other_after <= max(_NO_WORSE * other_before, plausible):
            return before, after
    return None


def _faults(
    written: Reading,
    before: Misfit,
    reading: Reading,
    after: Misfit,
    evidence: tuple[float, float],
    alike: tuple[str, ...],
) -> list[Fault]:
    """One fault for each change."""
    found, targets, estimate = [], reading.campaign.targets, reading.placement.estimate
    poses = Value("poses compared", float(len(np.unique(reading.campaign.measurements.pose))), "–")
    for change in reading.changes:
        detail, parameters, decisive = change.detail, change.parameters, True
        if change.placement == "frame":
            detail, parameters, decisive = _frame_fault(estimate, before, after)
        if change.placement == "targets":
            estimates = written.placement.estimate, estimate
            detail, parameters, decisive = _target_fault(targets, *estimates, IMPLAUSIBLE_M, IMPLAUSIBLE_RAD)
        if change.placement == "mounts":
            detail, parameters = _mount_fault(targets, estimate)
        found.append(Fault(change.name, change.joints, detail, (*parameters, poses), evidence, (), decisive, alike))
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


def _shifts(measurements: Measurements) -> list[Change]:
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


def _lengths_of_positions() -> list[Change]:
    found = []
    for unit, metres in _LENGTHS.items():
        detail = f"the positions look like {unit}: measurements fit {metres:g} times the written positions"
        factor = Value("metres for each unit of position written", metres, "m")
        found.append(Change("wrong_unit", detail, partial(_with_axes, metres * np.eye(3), None), (), (factor,)))
    return found


def _lengths_of_targets(campaign: Campaign) -> list[Change]:
    """Of all targets, or of one where there are several."""
    known = [target.name for target in campaign.targets if target.offset_m is not None and any(target.offset_m)]
    groups = [known, *([name] for name in known if len(known) > 1)] if known else []
    found = []
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
        read = partial(_with_rotations, lambda turned, order=letters: Rotation.from_euler(order, turned).as_rotvec())
        found.append(Change("wrong_unit", detail, read))
    return found


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
    return _measured(campaign, joint_angles=campaign.robot.model_angles(reported @ matrix.T))


def _with_axes(matrix: np.ndarray, turning: np.ndarray | None, campaign: Campaign) -> Campaign:
    """Positions by a matrix, and rotation vectors, which stay as they are without one of theirs."""
    vectors = campaign.measurements.rotation_vector
    vectors = vectors if turning is None or vectors is None else vectors @ turning.T
    return _measured(campaign, position=campaign.measurements.position @ matrix.T, rotation_vector=vectors)


def _with_shifted(measurements: Measurements, source: np.ndarray, campaign: Campaign) -> Campaign:
    """Some of all measurements, each with the measured columns of the row at its `source`, left out where that is -1."""
    moved = with_measured(measurements, np.maximum(source, 0)).select(source >= 0)
    return replace(campaign, measurements=spread(moved, _POSES))


def _with_rotations(function: Callable[[np.ndarray], np.ndarray], campaign: Campaign) -> Campaign:
    vectors = campaign.measurements.rotation_vector
    return _measured(campaign, rotation_vector=None if vectors is None else function(vectors))


def _measured(campaign: Campaign, **columns: Any) -> Campaign:
    return replace(campaign, measurements=replace(campaign.measurements, **columns))


def _with_unknown(parts: Mapping[str, Any], campaign: Campaign) -> Campaign:
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
    targets = [replace(t, name=f"{t.name}{_IN_SESSION}{session}", offset_m=None, rotation=None) for t, session in named]
    number = {mount: index for index, mount in enumerate(mounts)}
    each = np.array([number[mount] for mount in zip(measurements.target, measurements.session, strict=True)])
    return replace(_measured(campaign, target=each), targets=tuple(targets))


def _mounts(measurements: Measurements) -> list[tuple[int, int]]:
    """Targets and the sessions in which they are measured."""
    return sorted(set(zip(measurements.target.tolist(), measurements.session.tolist(), strict=True)))


def _frame_fault(estimate: Estimate, before: Misfit, after: Misfit) -> tuple[str, tuple[Value, ...], bool]:
    """Sentence and numbers of a base that stands elsewhere, and whether that is too far for physics."""
    parameters, away, turned = [], 0.0, 0.0
    for session, position, rotation in zip(estimate.sessions, estimate.frame_position, estimate.frame_rotation, strict=True):
        vector = Rotation.from_matrix(rotation).as_rotvec()
        of = f"of the base in the frame of {f'session {session}' if len(estimate.sessions) > 1 else 'the measurements'}"
        parameters += [Value(f"{axis} {of}", float(value), "m") for axis, value in zip("xyz", position, strict=True)]
        parameters += [
            Value(f"rotation vector {axis} {of}", float(value), "rad") for axis, value in zip("xyz", vector, strict=True)
        ]
        away, turned = max(away, float(np.linalg.norm(position))), max(turned, float(np.linalg.norm(vector)))
    distance = f"{away:.3g} m" if away >= 0.1 else f"{1e3 * away:.2g} mm"
    where = f"{distance} away, turned by {np.degrees(turned):.3g}°"
    if away > _NEAR_M or turned > _NEAR_RAD:
        return f"measurements do not lie in the base frame: the robot would stand {where}", tuple(parameters), True
    better = before.together / max(after.together, 1e-12)
    return f"measurements would fit {better:.0f} times better if the base stood {where}", tuple(parameters), False


def _mount_fault(targets: Sequence[Target], estimate: Estimate) -> tuple[str, tuple[Value, ...]]:
    """Sentence and numbers of a target that was mounted anew: the two of its mounts that are farthest apart."""
    rotations = Rotation.from_matrix(estimate.target_rotation)
    parted = [target.name.rpartition(_IN_SESSION) for target in targets]
    pairs = [(a, b) for a, b in combinations(range(len(targets)), 2) if parted[a][0] == parted[b][0]]
    turns = np.array([(rotations[a].inv() * rotations[b]).magnitude() for a, b in pairs])
    shifts = np.array([np.linalg.norm(estimate.target_offset[a] - estimate.target_offset[b]) for a, b in pairs])
    far = int(np.argmax(np.hypot(shifts, IMPLAUSIBLE_M / IMPLAUSIBLE_RAD * turns)))
    (name, _, before), (_, _, after) = (parted[number] for number in pairs[far])
    detail = (
        f"{name} was mounted anew between sessions {before} and {after}, turned by {np.degrees(turns[far]):.3g}° and"
        f" {1e3 * shifts[far]:.3g} mm elsewhere: a target for each of its mounts in campaign.yaml fits"
    )
    return detail, (Value(f"turn of {name}", float(turns[far]), "rad"), Value(f"shift of {name}", float(shifts[far]), "m"))


def _target_fault(
    targets: Sequence[Target], written: Estimate, fitted: Estimate, far_m: float, far_rad: float
) -> tuple[str, tuple[Value, ...], bool]:
    """Sentence and numbers of targets that sit elsewhere or are turned, and whether that is too far for physics.

    `far_m`, `far_rad`: from where on. The sentence says which keys of campaign.yaml are to be unknown; it is empty where no
    target is so far off.
    """
    turns = Rotation.from_matrix(written.target_rotation.transpose(0, 2, 1) @ fitted.target_rotation).magnitude()
    away = np.linalg.norm(fitted.target_offset - written.target_offset, axis=1)
    vectors = Rotation.from_matrix(fitted.target_rotation).as_rotvec()
    parameters = []
    for target, offset, vector in zip(targets, fitted.target_offset, vectors, strict=True):
        for name, unit, part in (("offset", "m", offset), ("rotation vector", "rad", vector)):
            if part is offset or part.any():
                named = zip("xyz", part, strict=True)
                parameters += [Value(f"{target.name} {name} {axis}", float(value), unit) for axis, value in named]
    found = {}
    if away.max() > far_m:
        found["offset_m"] = f"{targets[int(np.argmax(away))].name} would sit {1e3 * away.max():.3g} mm from there"
    if turns.max() > far_rad:
        found["rotation"] = f"{targets[int(np.argmax(turns))].name} would be turned by {np.degrees(turns.max()):.3g}°"
    if not found:
        return "", (), True
    remedy = " and ".join(f"{key}: unknown" for key in found)
    fits = f"where its mount is not as stated, {remedy} in campaign.yaml fits it, and known values may stand there"
    # A target that sits a little off may as well be a last link of another length.
    decisive = "rotation" in found or away.max() > _NEAR_M
    return f"targets do not sit where the campaign says: {' and '.join(found.values())}; {fits}", tuple(parameters), decisive
