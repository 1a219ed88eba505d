"""Defects: all that can be wrong with a physical robot, named as in the catalogue, or ``outside:...`` where it is not there.

A defect has one size, which scales it, and a seed, from which its other details (directions, phases, thresholds) are drawn;
they do not change with the size.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from elastocal.errors import InputError
from elastocal_proof.plant import catalogued, outside  # noqa: F401 - they enter themselves into the table of kinds
from elastocal_proof.plant.kinds import KINDS, Kind
from elastocal_proof.plant.random_numbers import stream

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal_proof.plant.arm import Arm
    from elastocal_proof.plant.kinds import Applied, Location
    from elastocal_proof.plant.physical_robot import PhysicalRobot


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


def with_defects(robot: PhysicalRobot, defects: Iterable[Defect]) -> PhysicalRobot:
    """A robot with defects, one after another."""
    for defect in defects:
        robot = _applied(robot, defect)[0]
    return robot


def truth_of(robot: PhysicalRobot, defect: Defect) -> dict[str, Any]:
    """The ground truth of a defect: effect, joints, size, unit, the parameters that are comparable, seed."""
    parameters = {name: float(value) for name, value in _applied(robot, defect)[1].items()}
    document = {"effect": defect.effect, "joints": list(defect.joints), "size": float(defect.size)}
    return document | {"unit": KINDS[defect.effect].unit, "parameters": parameters, "seed": int(defect.seed)}


def drawn_defect(effect: str, arm: Arm, seed: int) -> Defect:
    """A defect of plausible size at a location that is drawn."""
    locations = _kind(effect).locations(arm)
    drawn = stream(seed, f"place of {effect}").integers(len(locations))
    return Defect(effect, locations[drawn], KINDS[effect].plausible_on(arm), seed)


def _kind(effect: str) -> Kind:
    if effect not in KINDS:
        raise InputError("defect", "effect", repr(effect), ", ".join(KINDS))
    return KINDS[effect]


def _applied(robot: PhysicalRobot, defect: Defect) -> Applied:
    kind = _kind(defect.effect)
    if defect.joints not in kind.locations(robot.arm):
        allowed = ", ".join(map(str, kind.locations(robot.arm)))
        raise InputError("defect", f"joints of {defect.effect}", str(defect.joints), allowed)
    if not 0.0 <= defect.size <= kind.largest:
        raise InputError("defect", f"size of {defect.effect}", f"{defect.size:g}", f"0 to {kind.largest:g} {kind.unit}")
    draws = stream(defect.seed, f"details of {defect.effect}")
    return kind.apply(robot, defect.size, draws, *(joint - 1 for joint in defect.joints))
