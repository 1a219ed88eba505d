"""Which poses of a campaign are held out to test the fit, and where poses lie in joint
space: blocks, repeats, range."""

from __future__ import annotations

from collections.abc import Mapping
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

# Below these a fit or a test says nothing.
FEWEST_TRAINING_POSES = 5
FEWEST_HELD_OUT_POSES = 2
_NOWHERE_RAD = 1e9


def split_poses(campaign: Campaign) -> tuple[Measurements, Measurements]:
    """Measurements to fit and measurements to test, parted by whole poses.

    Returns `training`, `held_out`: in the order of the file, on which the choice of
    poses does not depend. Where another campaign is the test, see
    `reading.read_held_out_campaign`, all measurements are training.
    """
    held_out = select_held_out(
        campaign.holdout,
        campaign.measurements,
        campaign.robot.reported_offset,
        campaign.name,
    )
    return campaign.measurements.select(~held_out), campaign.measurements.select(
        held_out
    )


def select_held_out(
    holdout: Mapping[str, Any],
    measurements: Measurements,
    reported_zero: np.ndarray,
    source: str,
) -> np.ndarray:
    """Which measurements are held out, ndarray of bool (N,).

    Where poses are drawn it is by configuration, with all poses that share its joint
    angles: a repeat of what was fitted tests nothing. Rows of zeros, which were lost,
    change no draw; ``reported_zero`` (n,) is where the model's joints then stand, rad.
    `InputError`, which names ``source``: too few configurations, or poses that are not
    there.
    """
    pairs, index = list_poses(measurements)
    measured = (measurements.joint_angles != reported_zero).any(
        axis=1
    ) | measurements.position.any(axis=1)
    nothing = np.bincount(index, measured) == 0
    if nothing.any() and np.median(np.bincount(index)) > 1 and "fraction" in holdout:
        # Of several rows a pose one was lost: others tell of its pose, and a draw that
        # counted it would part all poses anew.
        mask = np.ones(len(measurements), bool)
        known = ~nothing[index]
        mask[known] = select_held_out(
            holdout, measurements.select(known), reported_zero, source
        )
        return mask
    # A pose that was lost is a configuration of its own, and none that stands at zero.
    angles = np.where(
        nothing[index, None], _NOWHERE_RAD + index[:, None], measurements.joint_angles
    )
    configuration = number_configurations(angles, index)
    chosen = np.zeros(len(pairs), bool)
    count = configuration.max() + 1
    for entry in holdout.get("poses", ()):
        match = (
            (pairs == entry).all(axis=1)
            if isinstance(entry, list | tuple)
            else pairs[:, 1] == entry
        )
        if not match.any():
            allowed = (
                f"poses that were measured, {pairs[:, 1].min()}..{pairs[:, 1].max()}"
            )
            raise InputError(source, "holdout.poses", str(entry), allowed)
        chosen |= match
    if "fraction" in holdout:
        draws = np.random.Generator(np.random.PCG64(holdout.get("seed", 1)))
        chosen = np.isin(
            configuration,
            draws.permutation(count)[: round(holdout["fraction"] * count)],
        )
    fitted, tested = (
        int(np.count_nonzero(np.bincount(configuration[part])))
        for part in (~chosen, chosen)
    )
    fewest = 0 if "campaign" in holdout else FEWEST_HELD_OUT_POSES
    if fitted < FEWEST_TRAINING_POSES or tested < fewest:
        found = f"{format_count(fitted, 'configuration')} to fit and {tested} held out"
        least = f"at least {FEWEST_TRAINING_POSES} to fit" + (
            f" and {fewest} held out" if fewest else ""
        )
        raise InputError(
            source,
            "holdout",
            found,
            f"{least}; poses with the same joint angles are one",
        )
    return chosen[index]


def list_poses(measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    """Session and pose of those that were measured, each once and sorted (P, 2); of
    each measurement its index there (N,)."""
    pairs = np.column_stack([measurements.session, measurements.pose])
    first, index = group_equal_rows(pairs)
    return pairs[first], index


# Measurements of one pose share their joint angles up to what a controller's servo
# error can differ: a joint that moves less does not distinguish poses.
SAME_POSE_RAD = 0.02
_ROUNDS = 100
# How often a pose drawn like the others, from a box, is called beyond their range.
_LEVEL = 0.05


def number_configurations(joint_angles: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """The configuration of each pose, ndarray of int (P,), from angles (N, n) and pose,
    0 .. P-1, of measurements or states.

    In the order of the poses each that has none yet begins one and takes those with its
    joint angles, up to what a controller's servo error can differ: the leader algorithm
    (Hartigan, Clustering Algorithms, 1975). Poses along a path, each near the next, are
    several configurations.
    """
    return number_close_points(average_by_group(joint_angles, pose), SAME_POSE_RAD)


def number_close_points(points: np.ndarray, within: float) -> np.ndarray:
    """Number of each row (N, n), 0 for the first: one for rows that agree to `within`
    with the row that began it."""
    # Its import takes a tenth of each start of Snakemake, whose rules read
    # campaign.yaml and need no tree.
    from scipy.spatial import cKDTree

    # Equal rows lead or follow together: a tree of a hundred thousand equal points
    # takes minutes.
    first, same = group_equal_rows(points)
    order = np.argsort(first)
    different = points[first[order]]
    tree = cKDTree(different)
    # What is farther from all others is not asked for its neighbours, and the
    # neighbours of all are never held at once.
    nearest, _ = tree.query(
        different, k=[2], p=np.inf, distance_upper_bound=np.nextafter(within, 1.0)
    )
    leader = np.arange(len(different))
    for place in np.flatnonzero(np.isfinite(nearest)):
        if leader[place] == place:
            near = np.array(tree.query_ball_point(different[place], within, p=np.inf))
            leader[near[(near > place) & (leader[near] == near)]] = place
    return (np.cumsum(leader == np.arange(len(leader))) - 1)[leader][np.argsort(order)][
        same
    ]


def partition_poses(
    joint_angles: np.ndarray, pose: np.ndarray, count: int
) -> np.ndarray:
    """Poses parted into blocks of neighbours, which have numbers of configurations that
    differ by one at most.

    Bisecting k-means [1] with parts of given size: a block is cut across its principal
    direction [2], then across the line between the means of its parts until these stay.
    No draw decides, and no block is too small to be held out. Joints count alike, by
    the cosine and sine of their angles over their spread.

    `joint_angles`, `pose`: as of `number_configurations`. `count`: of blocks, at most one for
    each configuration. Returns (P,) of int: 0 .. count-1.

    [1] Steinbach, M., Karypis, G. and Kumar, V., A comparison of document clustering techniques, KDD Workshop on Text Mining,
        2000.
    [2] Boley, D., Principal direction divisive partitioning, Data Mining and Knowledge Discovery 2, 1998.
    """
    configuration = number_configurations(joint_angles, pose)
    angles = average_by_group(average_by_group(joint_angles, pose), configuration)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    circle = circle - circle.mean(axis=0)
    spread = np.sqrt((circle**2).mean(axis=0).sum(axis=-1))
    points = (circle / np.maximum(spread, SAME_POSE_RAD)[:, None]).reshape(
        len(angles), -1
    )
    found = np.zeros(len(points), int)
    waiting = [(np.arange(len(points)), 0, count)]
    while waiting:
        members, first, parts = waiting.pop()
        found[members] = first
        if parts == 1:
            continue
        about = points[members] - points[members].mean(axis=0)
        direction = np.linalg.svd(about, full_matrices=False)[2][0]
        # The sign of a singular vector is arbitrary.
        direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
        lower = parts // 2
        cut = round(len(members) * lower / parts)
        order = np.argsort(about @ direction, kind="stable")
        for _ in range(_ROUNDS):
            before = set(order[:cut])
            direction = about[order[cut:]].mean(axis=0) - about[order[:cut]].mean(
                axis=0
            )
            order = np.argsort(about @ direction, kind="stable")
            if set(order[:cut]) == before:
                break
        waiting += [
            (members[order[:cut]], first, lower),
            (members[order[cut:]], first + lower, parts - lower),
        ]
    return found[configuration]


def find_poses_beyond_range(
    fitted_angles: np.ndarray, joint_angles: np.ndarray
) -> np.ndarray:
    """Poses at which a joint stands farther beyond those of other poses than chance
    explains.

    Of P + 1 poses drawn from a box, one stands beyond the others' range at one of the 2
    n ends by more than a share t of that range with probability 2 n (1 + t)^(1-P) / (P
    + 1) at most, from the spacings of uniform order statistics [1]. The margin is the t
    that makes this 5 %, or what measurements of one pose may differ: without one, half
    of the random poses beside 20 others would be called outside.

    `fitted_angles` (P, n): rad. `joint_angles` (S, n): rad. Returns (S,) of bool.

    [1] David, H. A. and Nagaraja, H. N., Order Statistics, section 6.4, Wiley, 2003.
    """
    poses, joints = fitted_angles.shape
    low = fitted_angles.min(axis=0)
    high = fitted_angles.max(axis=0)
    share = max(
        (2.0 * joints / (_LEVEL * (poses + 1))) ** (1.0 / max(poses - 1, 1)) - 1.0, 0.0
    )
    margin = np.maximum(share * (high - low), SAME_POSE_RAD)
    return ((joint_angles < low - margin) | (joint_angles > high + margin)).any(axis=1)


def find_repeated(fitted_angles: np.ndarray, joint_angles: np.ndarray) -> np.ndarray:
    """Whether states (S, n) have in every joint the angle of a same one of those fitted
    (P, n), rad: ndarray of bool (S,)."""
    from scipy.spatial import cKDTree

    return np.isfinite(
        cKDTree(fitted_angles).query(
            joint_angles, p=np.inf, distance_upper_bound=SAME_POSE_RAD
        )[0]
    )
