"""A robot of a campaign by pinocchio: its measurements with repeats averaged, and what springs and bending links make of them.

Loads are those at the pose to which the robot has yielded. A link is a cantilever whose diameter falls linearly along it; its
compliance is the integral of force and moment along it (Castigliano's theorem).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pinocchio as pin

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.audited import WRENCH

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal_proof.audit.audited import Audited

STATE = ("session", "pose", "load")
# Each pass leaves some 1/500 of the pass before of the load's change by the deflection: metres by deflections of 4 mm.
_PASSES = 6
# Measurements so many times as far from the median of their repeats as repeats usually are were not fitted.
_FAR = 12.0
# Links shorter than this (m) do not bend.
_SHORTEST_M = 0.05
# Joint angles of poses of one configuration, rad, as docs/campaign.md states it.
_SAME_RAD = 0.02
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


@dataclass(frozen=True)
class Averages:
    """Measurements with the repeats of a state averaged.

    `states`: one row for each state: session, pose, load, joint angles, wrench, and repeats, how many were averaged. `state`,
    `target` (M,) of int: of each averaged measurement: row of `states`, number of the target. `position` (M, 3): m. `rotation`
    (3, 3): M of them, none where positions alone are measured.
    """

    states: pd.DataFrame
    state: np.ndarray
    target: np.ndarray
    position: np.ndarray
    rotation: tuple[np.ndarray, ...]

    @property
    def repeats(self) -> np.ndarray:
        """How many measurements are averaged in each, (M,)."""
        return self.states["repeats"].to_numpy()[self.state]

    @property
    def pose(self) -> np.ndarray:
        """Number of the pose of each, (M,), from 0."""
        return self.states.groupby(["session", "pose"]).ngroup().to_numpy()[self.state]


def averages(frame: pd.DataFrame, poses: bool) -> Averages:
    """Average the repeats of a table of measurements of one approach to each state; `poses`: whether orientations count."""
    kept = frame[~far_off(frame)]
    angles = [name for name in map(str, kept) if name[0] == "q" and name[1:].isdigit()]
    grouped = kept.groupby([*STATE, "target"])
    means = grouped[list("xyz")].mean()
    each = means.index.to_frame(index=False).assign(count=grouped.size().to_numpy())
    of_states = each.groupby(list(STATE))
    states = kept.groupby(list(STATE))[[*angles, *WRENCH]].mean().reset_index()
    states["repeats"] = of_states["count"].min().to_numpy()
    rotation: tuple[np.ndarray, ...] = ()
    if poses:
        vectors = kept[["rx", "ry", "rz"]].to_numpy()
        rotation = tuple(_mean_rotation(vectors[places]) for places in grouped.indices.values())
    return Averages(states, of_states.ngroup().to_numpy(), each["target"].to_numpy(), means.to_numpy(), rotation)


def good_rows(run: Audited, campaign: str, part: str) -> pd.DataFrame:
    """Measurements of a campaign, ``training`` or ``held_out``, without those that were left out as gross errors."""
    frame = run.table(f"results/loop/{campaign}/{part}.parquet")
    stated = run.document(f"results/loop/{campaign}/diagnosis.json")["document"]
    if part == "held_out":
        stated = run.document(f"reports/loop/{campaign}/verdict.json")
    out = [row for entry in stated["gross_errors"] if entry["held_out"] == (part == "held_out") for row in entry["rows"]]
    return frame[~frame["row"].isin(out)].reset_index(drop=True)


def far_off(frame: pd.DataFrame) -> np.ndarray:
    """Which measurements (N,) are far from the median of at least three repeats, by the median distance of all (Hampel)."""
    approach = [name for name in map(str, frame) if name.startswith("approach")]
    group = frame.groupby([*STATE, "target", *approach], dropna=False)[list("xyz")]
    off = (frame[list("xyz")] - group.transform("median")).abs().to_numpy()
    repeated = group.transform("size").to_numpy() > 2 if len(frame) else np.zeros(0, bool)
    apart = off[repeated]
    usual = np.median(apart[apart > 0]) if apart.any() else np.inf
    return repeated & (off > _FAR * usual).any(axis=1)


def find_configurations(joint_angles: np.ndarray) -> np.ndarray:
    """The configuration of each pose (P, n), rad: the first without one takes all that are near it; ndarray of int (P,)."""
    found = np.full(len(joint_angles), -1)
    while (found < 0).any():
        first = joint_angles[np.argmax(found < 0)]
        found[(found < 0) & (np.abs(joint_angles - first).max(axis=1) <= _SAME_RAD)] = found.max() + 1
    return found


def _mean_rotation(vectors: np.ndarray) -> np.ndarray:
    """Mean of rotations that lie close together: the first, turned by the mean of the turns from it."""
    first, *_ = turned = [pin.exp3(vector) for vector in vectors]
    return np.asarray(pin.exp3(np.mean([pin.log3(one @ first.T) for one in turned], axis=0)) @ first)


@dataclass(frozen=True)
class Springs:
    """What yields in a robot.

    `joints` (n,): rad/(N m). `bending`, `torsion`: 1/EI and 1/GJ, 1/(N m^2), of the uniform link that a force shifts
    and a moment along twists as far as every link. `taper`: share by
    which the diameter falls along a link.
    """

    joints: np.ndarray
    bending: float = 0.0
    torsion: float = 0.0
    taper: float = 0.0


class Robot:
    """The robot that a campaign declares, its links able to bend.

    `targets`: with ``point``, ``offset_m`` and, where it is mounted turned, ``rotation``.
    """

    def __init__(self, document: Mapping[str, Any], targets: Sequence[Mapping[str, Any]]) -> None:
        bare = {**document, "links": {}}
        self.arms = [Arm(bare, target["offset_m"]) for target in targets]
        self.points = [str(target["point"]) for target in targets]
        self.mounts = [pin.exp3(np.array(target.get("rotation", (0.0, 0.0, 0.0)), float)) for target in targets]
        self.joints = self.arms[0].joints

    def compliance(self, springs: Springs) -> np.ndarray:
        """Compliance (C, C) of all coordinates: the joints, then six for each link."""
        arm = self.arms[0]
        found = np.zeros((arm.coordinates, arm.coordinates))
        found[: self.joints, : self.joints] = np.diag(springs.joints)
        for number, vector in enumerate(arm.links):
            if np.linalg.norm(vector) > _SHORTEST_M:
                found[arm.link_block(number), arm.link_block(number)] = _cantilever(vector, springs)
        return found

    def loaded(self, compliance: np.ndarray, angles: np.ndarray, wrench: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates to which the robot yields and the generalized forces there, by iteration."""
        arm = self.arms[0]
        commanded = arm.extend(angles)
        coordinates = commanded
        for _ in range(_PASSES):
            forces = arm.jacobian(coordinates, arm.end_effector).T @ wrench
            coordinates = commanded + compliance @ forces
        return coordinates, forces

    def all_loaded(self, springs: Springs, seen: Averages) -> list[tuple[np.ndarray, np.ndarray]]:
        """`loaded` of every state."""
        angles = seen.states[[f"q{j}" for j in range(1, self.joints + 1)]].to_numpy()
        wrenches, compliance = seen.states[list(WRENCH)].to_numpy(), self.compliance(springs)
        return [self.loaded(compliance, *one) for one in zip(angles, wrenches, strict=True)]

    def residuals(self, loaded: Sequence[tuple[np.ndarray, np.ndarray]], seen: Averages) -> np.ndarray:
        """Measured less predicted, (M, 3 or 6), m and rad, base axes."""
        found = []
        for number, (state, target) in enumerate(zip(seen.state, seen.target, strict=True)):
            position, rotation = self.arms[target].pose(loaded[state][0], self.points[target])
            off = [seen.position[number] - position]
            if seen.rotation:
                off.append(pin.log3(seen.rotation[number] @ (rotation @ self.mounts[target]).T))
            found.append(np.concatenate(off))
        return np.array(found)

    def jacobians(self, loaded: Sequence[tuple[np.ndarray, np.ndarray]], seen: Averages) -> np.ndarray:
        """Of each target where the robot has yielded to, with respect to all coordinates, (M, 3 or 6, C)."""
        rows = 6 if seen.rotation else 3
        pairs = zip(seen.state, seen.target, strict=True)
        return np.array(
            [self.arms[target].jacobian(loaded[state][0], f"{self.points[target]} target")[:rows] for state, target in pairs]
        )


def _cantilever(vector: np.ndarray, springs: Springs) -> np.ndarray:
    """Compliance (6, 6) of a link at its far end, force over moment, axes of the frame there."""
    length = float(np.linalg.norm(vector))
    axial = np.outer(vector, vector) / length**2
    places = 0.5 * (1 + _NODES)
    each = 0.5 * length * _WEIGHTS / (1 - springs.taper * places) ** 3
    bending = springs.bending * length / 3 / (each @ (1 - places) ** 2)
    torsion = springs.torsion * length / each.sum()
    total = np.zeros((6, 6))
    for place, softer in zip(places, each, strict=True):
        lever = np.concatenate([pin.skew((1 - place) * vector), np.eye(3)], axis=1)
        total += lever.T @ (softer * (bending * (np.eye(3) - axial) + torsion * axial)) @ lever
    return total
