"""Select the poses of a campaign that are held out for validation, and compare poses in
joint space: blocks, repeats, range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from elastocal.campaigns.campaign import (
    Campaign,
    Measurements,
    average_by_group,
    group_equal_rows,
)
from elastocal.counting import format_count
from elastocal.errors import InputError

# Fewer configurations than these do not suffice for a fit or for its validation.
FEWEST_TRAINING_POSES = 5
FEWEST_HELD_OUT_POSES = 2
# Measurements belong to one pose if their joint angles differ by at most this much,
# which is the size of a controller's servo error. Poses that differ less in every joint
# are one configuration.
SAME_POSE_RAD = 0.02
# Joint angle of a pose whose measurements were lost. No joint gets there, and no other
# pose is close to it.
_LOST_POSE_RAD = 1e9
# Upper bound on the iterations of k-means; a few suffice.
_MOST_ITERATIONS = 100
# Significance level: share of the poses that are called beyond the range although they
# are drawn from the same box as the other poses.
_SIGNIFICANCE_LEVEL = 0.05


def split_poses(campaign: Campaign) -> tuple[Measurements, Measurements]:
    """Split the measurements by whole poses into those to fit and those to validate.

    Returns
    -------
    training, held_out : measurements in the order of the file, on which the choice of
        poses does not depend. If another campaign validates this one, see
        `reading.read_held_out_campaign`, all measurements are for training.
    """
    held_out = select_held_out(
        campaign.holdout,
        campaign.measurements,
        campaign.robot.reported_offset,
        campaign.name,
    )
    training = campaign.measurements.select(~held_out)
    return training, campaign.measurements.select(held_out)


def select_held_out(
    holdout: Mapping[str, Any],
    measurements: Measurements,
    reported_zero: np.ndarray,
    source: str,
) -> np.ndarray:
    """Select the measurements that are held out.

    A draw selects configurations with all poses at their joint angles, because a repeat
    of a fitted pose validates nothing. Lost measurements, which are rows of zeros, do
    not change a draw.

    Parameters
    ----------
    holdout : rule, as in ``campaign.yaml``.
    measurements : N measurements.
    reported_zero : (n,) angles of the model's joints where the controller reports
        zeros, rad.
    source : file or campaign, for messages.

    Returns
    -------
    (N,) bool array.

    Raises
    ------
    InputError
        If configurations are too few, or if a stated pose was not measured.
    """
    labels, pose = list_poses(measurements)
    is_lost = _find_lost_poses(measurements, pose, reported_zero)
    usually_repeated = np.median(np.bincount(pose)) > 1
    if is_lost.any() and usually_repeated and "fraction" in holdout:
        # One of several rows of a pose was lost with the number of its pose. The pose
        # has its other rows, so that the lost row must not count as a pose in the draw.
        is_held_out = np.ones(len(measurements), bool)
        is_known = ~is_lost[pose]
        is_held_out[is_known] = select_held_out(
            holdout, measurements.select(is_known), reported_zero, source
        )
        return is_held_out
    # Each lost pose is a configuration of its own, and none is the one at zero.
    lost_angles = _LOST_POSE_RAD + pose[:, None]
    angles = np.where(is_lost[pose, None], lost_angles, measurements.joint_angles)
    configuration = number_configurations(angles, pose)
    pose_held_out = _match_poses(holdout.get("poses", ()), labels, source)
    if "fraction" in holdout:
        pose_held_out = _draw_configurations(holdout, configuration)
    fewest_held_out = 0 if "campaign" in holdout else FEWEST_HELD_OUT_POSES
    _check_sizes(configuration, pose_held_out, fewest_held_out, source)
    return pose_held_out[pose]


def list_poses(measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    """List the poses that were measured.

    Returns
    -------
    labels : (P, 2) int array, session and pose, sorted.
    pose : (N,) int array, index of each measurement in `labels`.
    """
    pairs = np.column_stack([measurements.session, measurements.pose])
    first, index = group_equal_rows(pairs)
    return pairs[first], index


def _find_lost_poses(
    measurements: Measurements, pose: np.ndarray, reported_zero: np.ndarray
) -> np.ndarray:
    """Find the poses (P,) whose angles and positions are all zeros."""
    has_angles = (measurements.joint_angles != reported_zero).any(axis=1)
    has_content = has_angles | measurements.position.any(axis=1)
    return np.asarray(np.bincount(pose, has_content) == 0)


def _match_poses(entries: Sequence[Any], labels: np.ndarray, source: str) -> np.ndarray:
    """Return which poses (P,) are listed: each entry is a pose, or a session and a
    pose."""
    is_listed = np.zeros(len(labels), bool)
    for entry in entries:
        if isinstance(entry, list | tuple):
            match = (labels == entry).all(axis=1)
        else:
            match = labels[:, 1] == entry
        if not match.any():
            numbers = labels[:, 1]
            allowed = f"poses that were measured, {numbers.min()}..{numbers.max()}"
            raise InputError(source, "holdout.poses", str(entry), allowed)
        is_listed |= match
    return is_listed


def _draw_configurations(
    holdout: Mapping[str, Any], configuration: np.ndarray
) -> np.ndarray:
    """Return which poses (P,) belong to the drawn fraction of the configurations."""
    count = configuration.max() + 1
    draws = np.random.Generator(np.random.PCG64(holdout.get("seed", 1)))
    drawn = draws.permutation(count)[: round(holdout["fraction"] * count)]
    return np.isin(configuration, drawn)


def _check_sizes(
    configuration: np.ndarray, held_out: np.ndarray, fewest_held_out: int, source: str
) -> None:
    """Refuse too few configurations to fit or to hold out, from poses (P,)."""
    training_count = len(np.unique(configuration[~held_out]))
    held_out_count = len(np.unique(configuration[held_out]))
    if training_count >= FEWEST_TRAINING_POSES and held_out_count >= fewest_held_out:
        return
    finding = (
        f"{format_count(training_count, 'configuration')} to fit "
        f"and {held_out_count} held out"
    )
    allowed = f"at least {FEWEST_TRAINING_POSES} to fit"
    if fewest_held_out:
        allowed += f" and {fewest_held_out} held out"
    allowed += "; poses with the same joint angles are one"
    raise InputError(source, "holdout", finding, allowed)


def number_configurations(joint_angles: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Number the configurations of poses.

    In the order of the poses, each pose without a configuration begins one and takes
    the later poses whose joint angles agree with its own up to a controller's servo
    error: the leader algorithm [1]. Poses along a path, each close to the next, are
    therefore several configurations.

    Parameters
    ----------
    joint_angles : (N, n) angles of measurements or states, rad.
    pose : (N,) pose of each, 0 .. P-1.

    Returns
    -------
    (P,) int array.

    References
    ----------
    [1] Hartigan, J. A., Clustering Algorithms, Wiley, 1975.
    """
    return number_close_points(average_by_group(joint_angles, pose), SAME_POSE_RAD)


def number_close_points(points: np.ndarray, within: float) -> np.ndarray:
    """Number points so that those close to the first point of a number share it.

    Parameters
    ----------
    points : (N, n) coordinates.
    within : largest difference of a coordinate to the first point of the number.

    Returns
    -------
    (N,) int array, 0 for the first point.
    """
    # Each start of Snakemake imports this module to read campaign.yaml. The import of
    # scipy.spatial would take a tenth of that time.
    from scipy.spatial import cKDTree

    # Build the tree from distinct points: with a hundred thousand equal points it takes
    # minutes.
    first, group = group_equal_rows(points)
    order = np.argsort(first)
    distinct = points[first[order]]
    tree = cKDTree(distinct)
    # Query the neighbours of a point only if it has any, and one point at a time, so
    # that the neighbours of all points are never in memory together.
    nearest_distance, _ = tree.query(
        distinct, k=[2], p=np.inf, distance_upper_bound=np.nextafter(within, 1.0)
    )
    leader = np.arange(len(distinct))
    for index in np.flatnonzero(np.isfinite(nearest_distance)):
        if leader[index] == index:
            neighbours = np.array(
                tree.query_ball_point(distinct[index], within, p=np.inf)
            )
            is_free = (neighbours > index) & (leader[neighbours] == neighbours)
            leader[neighbours[is_free]] = index
    number_of_leader = np.cumsum(leader == np.arange(len(leader))) - 1
    number_of_group = number_of_leader[leader][np.argsort(order)]
    return np.asarray(number_of_group[group])


def partition_poses(
    joint_angles: np.ndarray, pose: np.ndarray, count: int
) -> np.ndarray:
    """Partition poses into blocks of neighbours whose numbers of configurations differ
    by at most one.

    Bisecting k-means [1] with clusters of given sizes, without a random draw. All
    joints have equal weight: the coordinates are cosine and sine of the angles, divided
    by their spread.

    Parameters
    ----------
    joint_angles, pose : as of `number_configurations`.
    count : number of blocks, at most the number of configurations.

    Returns
    -------
    (P,) int array, 0 .. count-1.

    References
    ----------
    [1] Steinbach, M., Karypis, G. and Kumar, V., A comparison of document clustering
        techniques, KDD Workshop on Text Mining, 2000.
    """
    configuration = number_configurations(joint_angles, pose)
    angles = average_by_group(average_by_group(joint_angles, pose), configuration)
    points = _standardize_angles(angles)
    block = np.zeros(len(points), int)
    # Clusters to bisect: configurations, first block and number of blocks.
    clusters = [(np.arange(len(points)), 0, count)]
    while clusters:
        members, first_block, block_count = clusters.pop()
        block[members] = first_block
        if block_count == 1:
            continue
        lower_count = block_count // 2
        size = round(len(members) * lower_count / block_count)
        lower, upper = _bisect(points[members], size)
        clusters += [
            (members[lower], first_block, lower_count),
            (members[upper], first_block + lower_count, block_count - lower_count),
        ]
    return np.asarray(block[configuration])


def _standardize_angles(angles: np.ndarray) -> np.ndarray:
    """Return coordinates (C, 2n) of configurations (C, n) in which all joints have the
    same spread, unless a joint hardly moves."""
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    circle = circle - circle.mean(axis=0)
    spread = np.sqrt((circle**2).mean(axis=0).sum(axis=-1))
    scaled = circle / np.maximum(spread, SAME_POSE_RAD)[:, None]
    return np.asarray(scaled.reshape(len(angles), -1))


def _bisect(points: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Split points (M, k) into two clusters, the first of a given size.

    The first cut is across the principal direction [1]; each further cut is across the
    line between the means of the two clusters, until these no longer change. Returns
    the indices of both clusters.

    References
    ----------
    [1] Boley, D., Principal direction divisive partitioning, Data Mining and Knowledge
        Discovery 2, 1998.
    """
    centred = points - points.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    # The sign of a singular vector is arbitrary.
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    order = np.argsort(centred @ direction, kind="stable")
    for _ in range(_MOST_ITERATIONS):
        lower_mean = centred[order[:size]].mean(axis=0)
        upper_mean = centred[order[size:]].mean(axis=0)
        previous = set(order[:size])
        order = np.argsort(centred @ (upper_mean - lower_mean), kind="stable")
        if set(order[:size]) == previous:
            break
    return order[:size], order[size:]


def find_poses_beyond_range(
    fitted_angles: np.ndarray, joint_angles: np.ndarray
) -> np.ndarray:
    """Find poses in which a joint is farther beyond its range in other poses than
    chance explains.

    Of P + 1 poses drawn from a box, one lies beyond the range of the others at one of
    its 2 n ends, by more than the share t of that range, with a probability of at most
    2 n (1 + t)^(1-P) / (P + 1), from the spacings of uniform order statistics [1]. The
    margin is the t for which this is 5 %, but at least what measurements of one pose
    may differ. Without a margin, half of the random poses would be called outside the
    range of 20 others.

    Parameters
    ----------
    fitted_angles : (P, n) joint angles of the poses that span the range, rad.
    joint_angles : (S, n) joint angles to compare with it, rad.

    Returns
    -------
    (S,) bool array.

    References
    ----------
    [1] David, H. A. and Nagaraja, H. N., Order Statistics, section 6.4, Wiley, 2003.
    """
    low, high = compute_pose_range(fitted_angles)
    return np.asarray(((joint_angles < low) | (joint_angles > high)).any(axis=1))


def compute_pose_range(fitted_angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the lowest and the highest angle (n,) of each joint that count as within
    the range of poses (P, n), see `find_poses_beyond_range`."""
    poses, joints = fitted_angles.shape
    low = fitted_angles.min(axis=0)
    high = fitted_angles.max(axis=0)
    odds = 2.0 * joints / (_SIGNIFICANCE_LEVEL * (poses + 1))
    share = max(odds ** (1.0 / max(poses - 1, 1)) - 1.0, 0.0)
    margin = np.maximum(share * (high - low), SAME_POSE_RAD)
    return low - margin, high + margin


def find_repeated(fitted_angles: np.ndarray, joint_angles: np.ndarray) -> np.ndarray:
    """Find states whose joint angles all agree with those of one fitted state.

    Parameters
    ----------
    fitted_angles : (P, n) rad.
    joint_angles : (S, n) rad.

    Returns
    -------
    (S,) bool array.
    """
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(fitted_angles).query(
        joint_angles, p=np.inf, distance_upper_bound=SAME_POSE_RAD
    )
    return np.asarray(np.isfinite(distance))
