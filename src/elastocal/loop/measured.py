"""How far a corrected robot missed: it was commanded to the targets that `correct` wrote, and measured there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.application.accuracy import CONFIDENCE, MEASURED, Accuracy
from elastocal.application.frames import BASE, ROBOT, find_absorbed, placement, scope_about
from elastocal.campaigns.campaign import DOCUMENT
from elastocal.campaigns.groups import groups_of
from elastocal.campaigns.measurements import CSV
from elastocal.campaigns.reading import campaign_files, read_campaign
from elastocal.counting import counted
from elastocal.effects.catalogue import effects
from elastocal.errors import InputError
from elastocal.exchange.target_path import OK, read_corrected_targets
from elastocal.validation.bootstrap_t import drawn_poses, log_ratio_interval
from elastocal.validation.held_out import Errors
from elastocal.validation.span import count_configurations

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements, Target
    from elastocal.exchange.target_path import CorrectedTargets
    from elastocal.loop.calibrated_files import Diagnosed

TARGETS = "targets.csv"
REGION = "the corrected targets that were measured"
# Of a base and an offset that are fitted to these poses: three times as many numbers are left over.
FEWEST_POSES = 12
# By how much a commanded angle may differ from its target, rad or m: what a controller's display rounds off.
_SAME_ANGLE = 1e-4
_REPLICATES, _SEED = 2000, 1
# Gauss-Newton of the placement: from the best one without an offset each squares what is left.
_STEPS = 8


@dataclass(frozen=True)
class MeasuredErrors:
    """Of a corrected robot.

    `errors`: distances between wanted and measured positions, repeats averaged, noise in them; by pose. `noise_m`: root mean
    square length of the tracker's noise in them. `files`: of the campaign, by their names as a certificate lists them.
    """

    errors: Errors
    noise_m: float
    accuracy: Accuracy
    configurations: int
    files: dict[str, str]

    def document(self) -> dict[str, Any]:
        """As JSON."""
        distance = self.errors.distance
        return {
            "noise_m": self.noise_m,
            "mean_m": float(distance.mean()),
            "largest_m": float(distance.max()),
            "poses": self.errors.poses,
        }


def measured_errors(folder: str | Path, robots_folder: str | Path, found: Diagnosed) -> MeasuredErrors:
    """Errors of a robot that was commanded to the corrected targets of a diagnosed campaign.

    `folder` is a campaign whose pose k was commanded as row k of its targets.csv, as `correct` wrote it. In the frame `base`
    positions are compared as they are; in the frame `tracker` after the best rigid placement of the base; with a target whose
    offset is unknown, after the best constant offset. The noise is that of the diagnosed campaign.

    Raises `InputError`: as `read_campaign`; another robot, no or several targets on the end effector, a pose that targets.csv
    does not have, joint angles that are not those of the target, too few poses.
    """
    folder = Path(folder)
    robot = found.calibrated.robot
    wanted = read_corrected_targets(folder / TARGETS, robot.joints)
    campaign = read_campaign(folder, robots_folder, effects())
    source, end = folder / DOCUMENT, robot.chain.end_effector.name
    if campaign.robot.chain != robot.chain:
        raise InputError(source, "robot", f"another robot, {campaign.robot.name}", f"that of {found.name}, {robot.name}")
    mine = [number for number, target in enumerate(campaign.targets) if target.point == end]
    if len(mine) != 1:
        raise InputError(source, "targets", f"{counted(len(mine), 'target')} on {end}", "one")
    seen = campaign.measurements.select(campaign.measurements.target == mine[0])
    _require_commanded(folder / CSV, seen, campaign, wanted)
    row = seen.pose - 1
    key = np.column_stack([seen.session, seen.pose, seen.load])
    group = groups_of(key)[1]
    count = np.bincount(group)
    first = np.unique(group, return_index=True)[1]
    position = np.stack([np.bincount(group, axis) / count for axis in seen.position.T], axis=1)
    poses = len(np.unique(row))
    if poses < FEWEST_POSES:
        raise InputError(folder / CSV, "pose", counted(poses, "corrected pose"), f"{FEWEST_POSES} or more")
    off, freedoms = np.empty((len(first), 3)), 0
    for session in np.unique(seen.session[first]):
        some = seen.session[first] == session
        at = row[first][some]
        off[some], fitted = _errors(position[some], wanted.position[at], wanted.rotation[at], campaign, mine[0])
        freedoms += fitted
    sensor = 3.0 * found.calibrated.noise.position_m**2 / count
    noise = float(sensor.mean()) * (1.0 - freedoms / off.size)
    errors = Errors(np.linalg.norm(off, axis=1), np.unique(row[first], return_inverse=True)[1])
    accuracy = _accuracy(errors, noise, sensor, campaign, campaign.targets[mine[0]])
    read = [*campaign_files(folder, robots_folder), (folder / TARGETS).as_posix()]
    files = {f"{campaign.name}: {Path(file).name}": file for file in read}
    return MeasuredErrors(errors, float(np.sqrt(noise)), accuracy, count_configurations(seen), files)


def _require_commanded(source: Path, seen: Measurements, campaign: Campaign, wanted: CorrectedTargets) -> None:
    """Refuse measurements that were not taken at the targets."""
    last = len(wanted.position)
    outside = np.flatnonzero((seen.pose < 1) | (seen.pose > last))
    if len(outside):
        row = outside[0]
        raise InputError(source, f"row {seen.row[row]}, pose", str(seen.pose[row]), f"1..{last}, the rows of {TARGETS}")
    apart = np.abs(campaign.robot.reported_angles(seen.joint_angles) - wanted.joint_angles[seen.pose - 1])
    for bad, what, allowed in (
        (wanted.status[seen.pose - 1] != OK, "a target that was not corrected", f"poses whose status is {OK}"),
        (apart.max(axis=1) > _SAME_ANGLE, "other joint angles", f"q1.. of row {{pose}} of {TARGETS}, to {_SAME_ANGLE:g} rad"),
    ):
        if bad.any():
            row = int(np.argmax(bad))
            raise InputError(source, f"row {seen.row[row]}", what, allowed.format(pose=seen.pose[row]))


def _errors(
    measured: np.ndarray, position: np.ndarray, rotation: np.ndarray, campaign: Campaign, target: int
) -> tuple[np.ndarray, int]:
    """Wanted less measured positions (N, 3) after what the campaign leaves open was placed, and how many numbers that took."""
    stated = campaign.targets[target].offset_m
    free = np.repeat([campaign.frame != "base", campaign.frame != "base", stated is None, False], 3)
    offset, turn, shift = np.array(stated or (0.0, 0.0, 0.0)), np.eye(3), np.zeros(3)
    if free[0]:
        # Kabsch: of the tracker's axes in the base's.
        about = measured.mean(axis=0), (position + rotation @ offset).mean(axis=0)
        found, _ = Rotation.align_vectors(position + rotation @ offset - about[1], measured - about[0])
        turn, shift = found.as_matrix(), about[1] - found.as_matrix() @ about[0]
    scope = scope_about(position)
    columns = placement(scope, position, rotation)
    for _ in range(_STEPS if free.any() else 0):
        off = position + rotation @ offset - (measured @ turn.T + shift)
        step = find_absorbed(columns, np.concatenate([off, np.zeros_like(off)], axis=1)[..., None], free)[:, 0]
        small = Rotation.from_rotvec(step[3:6]).as_matrix()
        turn, shift = small @ turn, small @ (shift - scope.origin) + scope.origin + step[:3]
        offset = offset - step[6:9]
    return position + rotation @ offset - (measured @ turn.T + shift), int(free.sum())


def _accuracy(errors: Errors, noise: float, sensor: np.ndarray, campaign: Campaign, target: Target) -> Accuracy:
    squares, counts = np.bincount(errors.cluster, errors.distance**2), np.bincount(errors.cluster).astype(float)
    weights = drawn_poses(errors.poses, _REPLICATES, np.random.default_rng(_SEED))
    interval, _ = log_ratio_interval(squares, counts, weights, np.array([1.0 - CONFIDENCE, CONFIDENCE]))

    def without(square: float, of_noise: float) -> float:
        return float(np.sqrt(max(square - of_noise, 0.0)))

    worst = int(np.argmax(errors.distance))
    return Accuracy(
        BASE if campaign.frame == "base" else ROBOT,
        MEASURED,
        without(squares.sum() / counts.sum(), noise),
        without(errors.distance[worst] ** 2, sensor[worst]),
        without(np.exp(interval[1]), noise),
        None,
        f"the tracker's noise, {1e3 * np.sqrt(noise):.3f} mm, is taken off as squares",
        errors.poses,
        REGION,
        target.offset_m is None,
    )
