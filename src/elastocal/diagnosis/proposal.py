"""A proposal for the next experiment, as whoever drives the robot and whoever reads the report want it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.constants import g as standard_gravity

from elastocal.counting import counted
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    import pandas as pd

    from elastocal.mechanics.robot import Robot

# Said where nothing within reach helps.
NOT_DISTINGUISHABLE = "not distinguishable with this robot and tracker"
NOTHING_MISSING, NOTHING_AMBIGUOUS = "nothing is missing", "nothing is ambiguous"
DATA_AT_FAULT, NOTHING_TESTABLE = "the data are at fault", "the measurements can test no mechanism"
# Poses after which nobody goes on: some two days with a tracker. Fewer are stated to be needed, or none.
MOST_POSES = 100
WANTED_PROBABILITY = 0.9


@dataclass(frozen=True)
class Proposal:
    """Poses to measure next, in the order of their worth, and what they promise; arrays of E, empty where nothing helps.

    `joint_angles` (E, n): rad. `wrench` (E, 6): N, N m, at the last measuring point, base axes, at the share 1 of `shares`.
    `approach` (E, n): sense in which to approach each joint; None where the campaign does not note it, or where a ladder is
    given: then any. `reference_weight` (E,) of bool: whether the load is a weight hung at the last measuring point, known by
    weighing and not by the load cell. `shares`: shares of its load at which each pose is read; a weight hangs at their absolute
    values. `points`: measuring points at which targets are read in every pose. `separation` (E,): from the nearest alternative,
    by measurements of this pose and all before it: at most twice the log Bayes factor that they bring for the true hypothesis
    on average; 16 gives it odds of 19:1 from even ones with 90 %. `resolved` (E,): probability that after this pose the right
    hypothesis has 95 %, those in `indistinguishable` aside. `present`: separation from the nearest alternative that the present
    measurements give to an effect as large as the one found. `poses_needed`: for `resolved` of 90 %, if further poses tell as
    much as these; None where a hundred are not enough. `best`: mechanisms of the best hypothesis. `nearest`: of the alternative
    with the smallest separation. `indistinguishable`: alternatives that no experiment within reach distinguishes from the best;
    they do not count in the promise. `reason`: why there is nothing to measure; empty where there is.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray
    approach: np.ndarray | None
    reference_weight: np.ndarray
    shares: tuple[float, ...]
    points: tuple[str, ...]
    separation: np.ndarray
    resolved: np.ndarray
    present: float
    poses_needed: int | None
    best: tuple[str, ...]
    nearest: tuple[str, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    reason: str

    def __len__(self) -> int:
        return len(self.separation)


def without_poses(joints: int, best: tuple[str, ...], indistinguishable: tuple[tuple[str, ...], ...], reason: str) -> Proposal:
    """A proposal without poses."""
    none = np.zeros(0)
    return Proposal(
        np.zeros((0, joints)),
        np.zeros((0, 6)),
        None,
        np.zeros(0, bool),
        (),
        (),
        none,
        none,
        0.0,
        None,
        best,
        (),
        indistinguishable,
        reason,
    )


def table_of(proposal: Proposal, robot: Robot) -> pd.DataFrame:
    """The proposal as whoever drives the robot wants it.

    Returns one row for each pose; joint angles as the controller reports them (rad), ``load`` 1 where it is loaded,
    ``separation`` and ``resolved`` after it and all before, ``separation_without`` from the present measurements, and what the
    promise leaves aside as ``indistinguishable``; ``approach1..n`` where the campaign has them and ``reference_weight_kg``
    where a weight is asked for.
    """
    import pandas as pd

    joints, count = robot.joints, len(proposal)
    columns: dict[str, Any] = {
        "effect": [f"{words(proposal.best)} or {words(proposal.nearest)}"] * count,
        "pose": np.arange(count),
        "load": proposal.wrench.any(axis=1).astype(int),
        "point": [" ".join(proposal.points)] * count,
    }
    reported = robot.reported_angles(proposal.joint_angles) if count else np.zeros((0, joints))
    columns |= {f"q{joint + 1}": reported[:, joint] for joint in range(joints)}
    columns |= dict(zip(WRENCH_NAMES, proposal.wrench.T, strict=True))
    columns |= {"separation": proposal.separation, "separation_without": np.full(count, proposal.present)}
    columns |= {
        "resolved": proposal.resolved,
        "indistinguishable": ["; ".join(words(name) for name in proposal.indistinguishable)] * count,
    }
    if proposal.approach is not None:
        columns |= {f"approach{joint + 1}": proposal.approach[:, joint] for joint in range(joints)}
    if proposal.reference_weight.any():
        mass = np.linalg.norm(proposal.wrench[:, :3], axis=1) / standard_gravity
        columns["reference_weight_kg"] = np.where(proposal.reference_weight, mass, 0.0)
    return pd.DataFrame(columns)


def facts_of(proposal: Proposal) -> dict[str, Any]:
    """What verdict.json says of the next experiment."""
    return {
        "poses": len(proposal),
        "reason": proposal.reason,
        "best": list(proposal.best),
        "nearest": list(proposal.nearest),
        "separation": float(proposal.separation[-1]) if len(proposal) else None,
        "resolved": float(proposal.resolved[-1]) if len(proposal) else None,
        "poses_needed": proposal.poses_needed,
        "indistinguishable": [list(name) for name in proposal.indistinguishable],
        "sentence": sentence_of(proposal),
    }


def sentence_of(proposal: Proposal) -> str:
    """What the report says of the next experiment."""
    aside = "".join(f" {sentence}" for sentence in _left_aside(proposal))
    if proposal.reason == NOT_DISTINGUISHABLE:
        return f"No further measurement is proposed.{aside}"
    if proposal.reason:
        return f"No further measurement is proposed: {proposal.reason}."
    needed = counted(proposal.poses_needed, "pose") if proposal.poses_needed else f"more than {MOST_POSES} poses"
    shares = ", ".join(f"{share:g}" for share in proposal.shares)
    return (
        f"{counted(len(proposal), 'further pose')}, each measured at {shares} times its load, separate "
        f"{words(proposal.best)} from {words(proposal.nearest)} by "
        f"{proposal.separation[-1]:.1f} and resolve the verdict at 19:1 with a probability of {proposal.resolved[-1]:.0%}; "
        f"{WANTED_PROBABILITY:.0%} needs {needed}.{aside}"
    )


def words(mechanisms: Collection[str]) -> str:
    """A hypothesis in words: joint_tilt, payload and link_weight, joint_tilt or a related mechanism."""
    named = [name for name in mechanisms if name != OTHER]
    if not named:
        return "a mechanism that the catalogue lacks"
    return " and ".join(named) + (" with a related mechanism" if OTHER in mechanisms else "")


def _left_aside(proposal: Proposal) -> Iterator[str]:
    """Sentences on the alternatives that nothing within reach distinguishes from the best: instead of it, or beside it."""
    best = set(proposal.best)
    instead = [words(name) for name in proposal.indistinguishable if not set(name) > best or OTHER in set(name) - best]
    beside = dict.fromkeys(
        mechanism
        for name in proposal.indistinguishable
        if set(name) > best
        for mechanism in name
        if mechanism not in best and mechanism != OTHER
    )
    if instead:
        yield f"{words(proposal.best)} and {', '.join(instead)} are {NOT_DISTINGUISHABLE}."
    if beside:
        yield f"Whether {' or '.join(beside)} acts beside {words(proposal.best)} is {NOT_DISTINGUISHABLE}."
