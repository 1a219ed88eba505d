"""The calibrated robot as files.

A robot file can say offsets and ratios of the joints, in what the controller's angles
mean, q = M r + o; errors of a link, as six elementary transforms at its far end in the
order in which the fit moved it there; compliances and masses. What it cannot say, such
as a gear's harmonics or a regression on the remainder, stands in none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.calibrated import predict_poses, without
from elastocal.effects.conditions import MASS_PARAMETERS
from elastocal.mechanics.chain import Chain, MeasuringPoint, Transform

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.mechanics.robot import Robot


def find_left_out_m(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """How far the effects that a robot file cannot hold move the end effector, ndarray
    (N,), m; as in `forward`."""
    bare = without(calibrated, set(fold_effects(calibrated).left_out))
    positions = [
        predict_poses(each, reported_angles, wrench)[0] for each in (calibrated, bare)
    ]
    return np.linalg.norm(positions[0] - positions[1], axis=1)


@dataclass(frozen=True)
class Folded:
    """A calibrated robot as a robot file has it, rigid or with its springs, under its
    weight; and what that leaves out.

    `left_out`: places in the model of the effects that it does not have. Without them
    its poses are those of the calibrated robot, exactly.
    """

    robot: Robot
    left_out: tuple[int, ...]


def fold_effects(calibrated: CalibratedRobot) -> Folded:
    """Put into the robot what its file can say."""
    robot = calibrated.robot
    model = calibrated.model
    estimate = calibrated.estimate
    offset = np.zeros(robot.joints)
    ratio = np.eye(robot.joints)
    at_ends: dict[int, np.ndarray] = {}
    left_out = []
    for number, (effect, values) in enumerate(
        zip(model.effects, estimate.coefficients, strict=True)
    ):
        joint = effect.joints[0] - 1 if effect.joints else 0
        match effect.effect:
            case "joint_offset":
                offset[joint] += values[0]
            case "transmission_ratio":
                for parameter, value in zip(effect.parameters, values, strict=True):
                    ratio[joint, int(parameter.name.removeprefix("per_q")) - 1] += value
            case "link_geometry":
                at_ends[joint + 1] = at_ends.get(joint + 1, np.zeros(6)) + values
            case "joint_compliance":
                robot = replace(robot, compliance=values.copy(), compliance_known=True)
            case "declared_weight":
                robot = _reweigh(robot, values)
            case _:
                left_out.append(number)
    matrix = ratio @ robot.reported_matrix
    zeros = ratio @ robot.reported_offset + offset
    chain = _add_link_errors(robot.chain, at_ends)
    return Folded(
        replace(
            robot, chain=chain, links=(), reported_matrix=matrix, reported_offset=zeros
        ),
        tuple(left_out),
    )


def _reweigh(robot: Robot, corrections: np.ndarray) -> Robot:
    """A robot whose masses and first moments are those that were found."""
    masses = []
    for mass, (heavier, *moment) in zip(
        robot.masses, corrections.reshape(-1, MASS_PARAMETERS), strict=True
    ):
        total = mass.mass_kg + heavier
        centre = np.array(mass.centre_m) + np.array(moment) / total
        masses.append(
            replace(mass, mass_kg=float(total), centre_m=tuple(centre.tolist()))
        )
    return replace(robot, masses=tuple(masses))


def _add_link_errors(chain: Chain, at_ends: dict[int, np.ndarray]) -> Chain:
    """A chain with small transforms at the far ends of links, 1 for that behind the
    first joint."""
    transforms: list[Transform] = []
    moved: dict[int, int] = {}
    seen = 0
    for place in range(len(chain.transforms) + 1):
        transform = chain.transforms[place] if place < len(chain.transforms) else None
        ends = transform is None or transform.coordinate is not None
        if ends and seen in at_ends:
            error = at_ends.pop(seen)
            transforms += [
                Transform("TR"[axis // 3], axis % 3, float(value))
                for axis, value in enumerate(error)
            ]
        moved[place] = len(transforms)
        if transform is not None:
            transforms.append(transform)
            seen += transform.coordinate is not None
    points = tuple(
        MeasuringPoint(p.name, moved[p.after], p.offset_m) for p in chain.points
    )
    return Chain(tuple(transforms), points, chain.coordinates)
