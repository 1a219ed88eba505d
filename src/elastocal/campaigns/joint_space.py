"""Where poses lie in joint space: blocks of neighbours, and what lies beyond the range of others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.groups import groups_of

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Measurements of one pose share their joint angles up to what a controller's servo error can differ: a joint that moves less
# does not distinguish poses.
SAME_POSE_RAD = 0.02
_ROUNDS = 100
# How often a pose drawn like the others, from a box, is called beyond their range.
_LEVEL = 0.05


def blocks(joint_angles: np.ndarray, count: int) -> np.ndarray:
    """Poses parted into blocks of neighbours whose sizes differ by one at most.

    Bisecting k-means [1] with parts of given size: a block is cut across its principal direction [2], then across the line
    between the means of its parts until these stay. No draw decides, and no block is too small to be held out. Joints count
    alike, by the cosine and sine of their angles over their spread.

    `joint_angles` (P, n): rad. `count`: of blocks, at most P. Returns (P,) of int: 0 .. count-1.

    [1] Steinbach, M., Karypis, G. and Kumar, V., A comparison of document clustering techniques, KDD Workshop on Text Mining,
        2000.
    [2] Boley, D., Principal direction divisive partitioning, Data Mining and Knowledge Discovery 2, 1998.
    """
    circle = np.stack([np.cos(joint_angles), np.sin(joint_angles)], axis=-1)
    circle = circle - circle.mean(axis=0)
    spread = np.sqrt((circle**2).mean(axis=0).sum(axis=-1))
    points = (circle / np.maximum(spread, SAME_POSE_RAD)[:, None]).reshape(len(joint_angles), -1)
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
            before, direction = set(order[:cut]), about[order[cut:]].mean(axis=0) - about[order[:cut]].mean(axis=0)
            order = np.argsort(about @ direction, kind="stable")
            if set(order[:cut]) == before:
                break
        waiting += [(members[order[:cut]], first, lower), (members[order[cut:]], first + lower, parts - lower)]
    return found


def configurations(joint_angles: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """The configuration of each pose, ndarray of int (P,), from angles (N, n) and pose, 0 .. P-1, of measurements or states.

    In the order of the poses each that has none yet begins one and takes those with its joint angles, up to what a
    controller's servo error can differ: the leader algorithm (Hartigan, Clustering Algorithms, 1975). Poses along a path, each
    near the next, are several configurations.
    """
    # Poses with the very same angles lead or follow together: a tree of a hundred thousand equal points takes minutes.
    first, same = groups_of(means := _means(joint_angles, pose))
    order = np.argsort(first)
    mean = means[first[order]]
    tree = _tree(mean)
    # What is farther from all others is not asked for its neighbours, and the neighbours of all are never held at once.
    beyond = np.nextafter(SAME_POSE_RAD, 1.0)
    nearest, _ = tree.query(mean, k=[2], p=np.inf, distance_upper_bound=beyond)
    alone = np.isinf(np.ravel(nearest))
    found, count = np.full(len(mean), -1), 0
    for leader in range(len(mean)):
        if found[leader] < 0:
            found[leader] = count
            if not alone[leader]:
                near = np.array(tree.query_ball_point(mean[leader], SAME_POSE_RAD, p=np.inf))
                found[near[found[near] < 0]] = count
            count += 1
    return found[np.argsort(order)][same]


def blocks_of_poses(joint_angles: np.ndarray, pose: np.ndarray, count: int) -> np.ndarray:
    """`blocks` of poses, ndarray of int (P,), by the means of their configurations; other arguments as of `configurations`."""
    configuration = configurations(joint_angles, pose)
    return blocks(_means(_means(joint_angles, pose), configuration), count)[configuration]


def _means(joint_angles: np.ndarray, group: np.ndarray) -> np.ndarray:
    mean = np.zeros((group.max() + 1, joint_angles.shape[1]))
    np.add.at(mean, group, joint_angles)
    return mean / np.bincount(group)[:, None]


def beyond_range(fitted_angles: np.ndarray, joint_angles: np.ndarray) -> np.ndarray:
    """Poses at which a joint stands farther beyond those of other poses than chance explains.

    Of P + 1 poses drawn from a box, one stands beyond the others' range at one of the 2 n ends by more than a share t of that
    range with probability 2 n (1 + t)^(1-P) / (P + 1) at most, from the spacings of uniform order statistics [1]. The margin
    is the t that makes this 5 %, or what measurements of one pose may differ: without one, half of the random poses beside 20
    others would be called outside.

    `fitted_angles` (P, n): rad. `joint_angles` (S, n): rad. Returns (S,) of bool.

    [1] David, H. A. and Nagaraja, H. N., Order Statistics, section 6.4, Wiley, 2003.
    """
    poses, joints = fitted_angles.shape
    low, high = fitted_angles.min(axis=0), fitted_angles.max(axis=0)
    share = max((2.0 * joints / (_LEVEL * (poses + 1))) ** (1.0 / max(poses - 1, 1)) - 1.0, 0.0)
    margin = np.maximum(share * (high - low), SAME_POSE_RAD)
    return ((joint_angles < low - margin) | (joint_angles > high + margin)).any(axis=1)


def find_repeated(fitted_angles: np.ndarray, joint_angles: np.ndarray) -> np.ndarray:
    """Whether states (S, n) have in every joint the angle of a same one of those fitted (P, n), rad: ndarray of bool (S,)."""
    return np.isfinite(_tree(fitted_angles).query(joint_angles, p=np.inf, distance_upper_bound=SAME_POSE_RAD)[0])


def _tree(points: np.ndarray) -> cKDTree:
    # Its import takes a tenth of each start of Snakemake, whose rules read campaign.yaml and need no tree.
    from scipy.spatial import cKDTree

    return cKDTree(points)
