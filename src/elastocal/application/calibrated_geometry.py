"""What a robot file can say of a calibrated robot: offsets, ratios, link lengths and angles, compliances and weights.

Offsets and ratios of the joints go into what the controller's angles mean, q = M r + o; errors of a link become six
elementary transforms at its far end, in the order in which the fit moved it there; compliances and masses replace those of the
file. What a robot file cannot say, such as a gear's harmonics, remains as effects.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.conditions import MASS_PARAMETERS
from elastocal.effects.gravity import DECLARED_WEIGHT
from elastocal.mechanics.chain import Chain, MeasuringPoint, Transform

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.mechanics.robot import Robot

_OFFSET, _RATIO, GEOMETRY, SPRINGS = "joint_offset", "transmission_ratio", "link_geometry", "joint_compliance"


@dataclass(frozen=True)
class Folded:
    """A calibrated robot as a robot file has it, and what that leaves out.

    `robot`: its reference: rigid or with its springs, under its weight. `left_out`: places in the model of the effects that it
    does not have.
    """

    robot: Robot
    left_out: tuple[int, ...]


def fold_effects(calibrated: CalibratedRobot) -> Folded:
    """Put into the robot what its file can say.

    Returns poses of its robot are those of the calibrated one without the effects left out, exactly.
    """
    robot, model, estimate = calibrated.robot, calibrated.model, calibrated.estimate
    offset, ratio = np.zeros(robot.joints), np.eye(robot.joints)
    at_ends: dict[int, np.ndarray] = {}
    left_out = []
    for number, (effect, values) in enumerate(zip(model.effects, estimate.coefficients, strict=True)):
        joint = effect.joints[0] - 1 if effect.joints else 0
        if effect.effect == _OFFSET:
            offset[joint] += values[0]
        elif effect.effect == _RATIO:
            for parameter, value in zip(effect.parameters, values, strict=True):
                ratio[joint, int(parameter.name.removeprefix("per_q")) - 1] += value
        elif effect.effect == GEOMETRY:
            at_ends[joint + 1] = at_ends.get(joint + 1, np.zeros(6)) + values
        elif effect.effect == SPRINGS:
            robot = replace(robot, compliance=values.copy(), compliance_known=True)
        elif effect.effect == DECLARED_WEIGHT:
            robot = _reweigh(robot, values)
        else:
            left_out.append(number)
    return Folded(
        replace(
            robot,
            chain=_add_link_errors(robot.chain, at_ends),
            links=(),
            reported_matrix=ratio @ robot.reported_matrix,
            reported_offset=ratio @ robot.reported_offset + offset,
        ),
        tuple(left_out),
    )


def _reweigh(robot: Robot, corrections: np.ndarray) -> Robot:
    """A robot whose masses and first moments are those that were found."""
    masses = []
    for mass, (heavier, *moment) in zip(robot.masses, corrections.reshape(-1, MASS_PARAMETERS), strict=True):
        total = mass.mass_kg + heavier
        centre = np.array(mass.centre_m) + np.array(moment) / total
        masses.append(replace(mass, mass_kg=float(total), centre_m=tuple(centre.tolist())))
    return replace(robot, masses=tuple(masses))


def _add_link_errors(chain: Chain, at_ends: dict[int, np.ndarray]) -> Chain:
    """A chain with small transforms at the far ends of links, 1 for that behind the first joint."""
    transforms: list[Transform] = []
    moved: dict[int, int] = {}
    seen = 0
    for place in range(len(chain.transforms) + 1):
        transform = chain.transforms[place] if place < len(chain.transforms) else None
        ends = transform is None or transform.coordinate is not None
        if ends and seen in at_ends and not (transform is not None and chain.is_passive(place) and _has_ended(chain, place)):
            error = at_ends.pop(seen)
            transforms += [Transform("TR"[axis // 3], axis % 3, float(value)) for axis, value in enumerate(error)]
        moved[place] = len(transforms)
        if transform is not None:
            transforms.append(transform)
            seen += transform.coordinate is not None and not chain.is_passive(place)
    points = tuple(MeasuringPoint(p.name, moved[p.after], p.offset_m) for p in chain.points)
    return Chain(tuple(transforms), points, chain.coordinates)


def _has_ended(chain: Chain, place: int) -> bool:
    """Whether the link before a place has ended before it, at an earlier passive joint."""
    before = [p for p in range(place) if chain.transforms[p].coordinate is not None]
    return bool(before) and chain.is_passive(before[-1])
