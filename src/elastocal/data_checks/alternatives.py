"""Other ways to read the file: senses of joints, axes, units, frames and targets, compared by how well the data then fit.

One scan over a short list of hypotheses, nearly all of them discrete. They are only compared where the measurements as written
are absurdly far from the nominal robot, and the simplest that mends them is named: one discrete change, or else a base or
targets that stand elsewhere or were mounted anew. Senses, axes and units are facts, not parameters: each is tried, none is
fitted. What one change mends in part is looked at again for another.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.data_checks.hypotheses import IN_SESSION, POSES, Change, hypotheses, measured_otherwise, shifts, with_unknown
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
)
from elastocal.data_checks.protocol import Fault, Value

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from elastocal.campaigns.campaign import Campaign, Measurements, Target
    from elastocal.data_checks.placement import Placement
    from elastocal.fitting.model import Estimate

NAMES, FAMILY, AFTER = (
    ("wrong_sign", "swapped_axes", "wrong_unit", "wrong_frame", "wrong_target", "mounted_anew", "shuffled_rows"),
    "data",
    ("constant_columns",),
)

# What a correction leaves as it is may come out this much larger by chance.
_NO_WORSE = 1.2
# Hypotheses whose misfits differ by less than this share, or by less than a tracker could tell, fit alike.
_ALIKE, _ALIKE_M = 1.1, 1e-4
_MOST_ALIKE = 5
# A base that stands less far off than this may be the zero of the first joint or the height of the column: for physics to
# tell, and a warning here. Ten times what geometric errors of industrial robots reach.
_NEAR_M, _NEAR_RAD = 0.05, 0.05
# The file as it stands.
_NONE = Change("", "", lambda campaign: campaign)
# Faults that are mended one after the other.
_ROUNDS = 3


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
    """A campaign read with a change, and where it then lies beside the nominal robot."""

    change: Change
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
    few = replace(campaign, measurements=spread(measurements, POSES))
    found = _one_after_the_other(few, shifted := shifts(measurements))
    loaded = measurements.select(measurements.load > 0)
    if not found and len(loaded):
        # Rows of one pose that stand a row off show it at the last load alone, where the next pose's stand.
        found, _ = _mended(replace(campaign, measurements=spread(loaded, POSES)), (shifted, []))
    if found or campaign.measured == "position":
        return found
    if slight := _slightly_turned(few):
        return slight
    # Where orientations do not go with positions in any way, positions alone may still tell.
    found = _one_after_the_other(measured_otherwise(replace(few, measured="position"), rotation_vector=None), [])
    return [replace(fault, detail=f"{fault.detail} (positions alone: orientations do not go with them)") for fault in found]


def _one_after_the_other(campaign: Campaign, first: Sequence[Change]) -> list[Fault]:
    """Faults that are mended one after the other; `first`: changes that are tried of the file as it stands alone."""
    found: list[Fault] = []
    for number in range(_ROUNDS):
        new, campaign = _mended(campaign, hypotheses(campaign, () if number else first))
        known = {(fault.name, fault.detail) for fault in found}
        new = [fault for fault in new if (fault.name, fault.detail) not in known]
        found += new
        if not any(fault.decisive for fault in new):
            break
    return found


def _slightly_turned(campaign: Campaign) -> list[Fault]:
    """A mount turned by as much as the zero of a joint may be off, but seldom is: for physics to tell, and a warning."""
    freed = with_unknown({"rotation": None}, campaign)
    written, fitted = (robustly_placed(each, campaign.measurements) for each in (campaign, freed))
    detail, parameters, _ = _target_fault(campaign.targets, written.estimate, fitted.estimate, np.inf, _NEAR_RAD)
    if not detail or written.turn is None or fitted.turn is None:
        return []
    return [Fault("wrong_target", (), detail, parameters, (rms(written.turn), rms(fitted.turn)), (), False, ())]


def _mended(campaign: Campaign, tried: tuple[Sequence[Change], Sequence[Change]]) -> tuple[list[Fault], Campaign]:
    """Fault of the hypothesis that mends the measurements, and the campaign as it is then read; `tried`: as `hypotheses`."""
    written = Reading(_NONE, campaign, robustly_placed(campaign, campaign.measurements))
    # All measurements but a few, or all: a joint may move in a few poses only.
    measures = [measure for measure in (trimmed_rms, rms) if written.misfit(measure).implausible]
    each_part = [[_read(campaign, change) for change in part] for part in tried] if measures else []
    for measure in measures:
        before, best = written.misfit(measure), None
        for part in each_part:
            winner = _best(part, before, measure) if part else None
            if winner and (best is None or winner[1].together < best[1].together / FAR_BETTER):
                best = winner
        if best:
            return [_fault(written, before, best)], best[0].campaign
    return [], campaign


def _read(campaign: Campaign, change: Change) -> Reading:
    read = change.correct(campaign)
    return Reading(change, read, placed(read, read.measurements))


_Winner = tuple[Reading, Misfit, tuple[float, float], tuple[str, ...]]


def _best(tried: Sequence[Reading], before: Misfit, measure: Callable[[np.ndarray], float]) -> _Winner | None:
    """The first of the hypotheses that fit best, if it convinces: what it leaves, the evidence, and what fits alike."""
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
            others = [tried[n].change for n in alike[1 : 1 + _MOST_ALIKE]]
            return best, after, evidence, tuple(change.detail for change in others if change.detail)
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


def _fault(written: Reading, before: Misfit, best: _Winner) -> Fault:
    """What the winning change says of the data, in its own words or in those of what it fits."""
    reading, after, evidence, alike = best
    change, targets, estimate = reading.change, reading.campaign.targets, reading.placement.estimate
    poses = Value("poses compared", float(len(np.unique(reading.campaign.measurements.pose))), "–")
    detail, parameters, decisive = change.detail, change.parameters, True
    if change.placement == "frame":
        detail, parameters, decisive = _frame_fault(estimate, before, after)
    if change.placement == "targets":
        estimates = written.placement.estimate, estimate
        detail, parameters, decisive = _target_fault(targets, *estimates, IMPLAUSIBLE_M, IMPLAUSIBLE_RAD)
    if change.placement == "mounts":
        detail, parameters = _mount_fault(targets, estimate)
    return Fault(change.name, change.joints, detail, (*parameters, poses), evidence, (), decisive, alike)


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
    parted = [target.name.rpartition(IN_SESSION) for target in targets]
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
