"""Defects: all that can be wrong with a physical robot, named as in the catalogue, or ``outside:...`` where it is not there.

The table of their kinds, which `laws` fills, and the joints at which they can be. A defect has one size, which scales it, and a
seed, from which its other details (directions, phases, thresholds) are drawn; they do not change with the size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.constants import g as standard_gravity

from elastocal.errors import InputError
from elastocal_proof.plant.arm import Arm
from elastocal_proof.plant.machine import Mass, on_stretches, usual_gravity_torque
from elastocal_proof.plant.physical_robot import PhysicalRobot, stream

OUTSIDE = "outside:"
Draws = np.random.Generator
Location = tuple[int, ...]
# The defective robot, and those parameters that the catalogue's law of this effect has in common with what was done, by the
# catalogue's names; exactly or to first order in the size.
Applied = tuple[PhysicalRobot, dict[str, float]]
_SHORTEST_LINK_M = 0.1
# Share of the largest torque below which a weight does not turn a joint.
_NO_TORQUE = 0.003


@dataclass(frozen=True)
class Kind:
    """What all defects of one name have in common.

    `unit`: of the size. `plausible`: a size such as real robots have. `locations`: joints at which it can be on an arm, from 1.
    `apply`: of robot, size, draws of the details, and joints from 0. `needs`: covariates without which the catalogue cannot see
    it. `largest`: size beyond which the law means nothing. `scale`: powers of how soft an arm is and of how large its loads
    are, with which the plausible size goes.
    """

    unit: str
    plausible: float
    locations: Callable[[Arm], list[Location]]
    apply: Callable[..., Applied]
    needs: tuple[str, ...] = ()
    largest: float = np.inf
    scale: tuple[float, float] = (0.0, 0.0)

    def plausible_on(self, arm: Arm) -> float:
        """A size such as this arm may have; `plausible` is a heavy one's."""
        return self.plausible * arm.softness ** self.scale[0] * arm.load_share ** self.scale[1]


KINDS: dict[str, Kind] = {}


def kind(
    effect: str, unit: str, plausible: float, locations: Callable[[Arm], list[Location]], **more: Any
) -> Callable[[Callable[..., Applied]], Callable[..., Applied]]:
    def keep(apply: Callable[..., Applied]) -> Callable[..., Applied]:
        KINDS[effect] = Kind(unit, plausible, locations, apply, **more)
        return apply

    return keep


def nowhere(arm: Arm) -> list[Location]:
    return [()]


def each_joint(arm: Arm) -> list[Location]:
    return [(joint,) for joint in range(1, arm.joints + 1)]


def joints_from(first: int) -> Callable[[Arm], list[Location]]:
    """But for the last."""
    return lambda arm: [(joint,) for joint in range(first, arm.joints)]


def each_pair(arm: Arm) -> list[Location]:
    return list(combinations(range(1, arm.joints + 1), 2))


def each_link(arm: Arm) -> list[Location]:
    return [(link,) for link in range(1, arm.joints + 1) if arm.lengths_m[link] > _SHORTEST_LINK_M]


def shoulder(arm: Arm) -> list[Location]:
    """Where a gravity compensator can be, on arms that have one."""
    return [(2,)] if arm.compensated else []


def turned_by(arm: Arm, masses: Iterable[Mass]) -> Location:
    """Joints, from 1, that weights turn where the arm stands upright."""
    torque = usual_gravity_torque(arm, masses, (0.0, 0.0, -standard_gravity))
    return tuple(int(joint) + 1 for joint in np.flatnonzero(torque > _NO_TORQUE * torque.max()))


def weighing_links(arm: Arm) -> dict[Location, int]:
    """The upper arm and the forearm by the joints that their weight turns."""
    found: dict[Location, int] = {}
    for (link,) in each_link(arm):
        turned = turned_by(arm, [Mass(link, 1.0)])
        # Of links that turn the same joints the first counts, and of all links two: the hand's weight is like a tool's.
        if turned and turned[-1] == link and len(found) < 2:
            found[turned] = link
    return found


def weighed(arm: Arm) -> list[Location]:
    everything = turned_by(arm, on_stretches(arm.masses, arm))
    return list(dict.fromkeys([*weighing_links(arm), everything]))


@dataclass(frozen=True)
class Defect:
    """One thing that is wrong with a robot.

    `effect`: a key of `KINDS`. `joints`: from 1; empty where it belongs to none. `size`: in the unit of its kind. `seed`: of
    its details.
    """

    effect: str
    joints: Location
    size: float
    seed: int = 0


def with_defects(robot: PhysicalRobot, defects: Iterable[Defect], times: float = 1.0) -> PhysicalRobot:
    """A robot with defects, one after another, each so many times as large."""
    for defect in defects:
        robot = _applied(robot, replace(defect, size=times * defect.size))[0]
    return robot


def truth_of(robot: PhysicalRobot, defect: Defect) -> dict[str, Any]:
    """The ground truth of a defect: effect, joints, size, unit, the parameters that are comparable, seed."""
    parameters = {name: float(value) for name, value in _applied(robot, defect)[1].items()}
    document = {"effect": defect.effect, "joints": list(defect.joints), "size": float(defect.size)}
    return document | {"unit": KINDS[defect.effect].unit, "parameters": parameters, "seed": int(defect.seed)}


def drawn_defect(effect: str, arm: Arm, seed: int) -> Defect:
    """A defect of plausible size at a location that is drawn."""
    locations = KINDS[effect].locations(arm)
    drawn = stream(seed, f"place of {effect}").integers(len(locations))
    return Defect(effect, locations[drawn], KINDS[effect].plausible_on(arm), seed)


def _applied(robot: PhysicalRobot, defect: Defect) -> Applied:
    if defect.effect not in KINDS:
        raise InputError("defect", "effect", repr(defect.effect), ", ".join(KINDS))
    kind = KINDS[defect.effect]
    if defect.joints not in kind.locations(robot.arm):
        allowed = ", ".join(map(str, kind.locations(robot.arm)))
        raise InputError("defect", f"joints of {defect.effect}", str(defect.joints), allowed)
    if not 0.0 <= defect.size <= kind.largest:
        raise InputError("defect", f"size of {defect.effect}", f"{defect.size:g}", f"0 to {kind.largest:g} {kind.unit}")
    draws = stream(defect.seed, f"details of {defect.effect}")
    return kind.apply(robot, defect.size, draws, *(joint - 1 for joint in defect.joints))
