"""The calibrated robot as files.

A robot file can hold offsets and ratios of the joints, as the meaning q = M r + o of the
controller's angles r; errors of a link, as six elementary transforms at its far end in
the order in which the fit moved it there; compliances and masses. It cannot hold the
harmonics of a gear or a regression on the residuals, for example; these are in no file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import yaml

from elastocal.application.calibrated import predict_poses, remove_effects
from elastocal.application.frames import root_mean_square, subtract_placement
from elastocal.effects.conditions import MASS_PARAMETERS
from elastocal.exchange.urdf import read_urdf
from elastocal.exchange.urdf_writing import find_nominal_chain
from elastocal.io.atomic_writes import write_text
from elastocal.mechanics.chain import Chain, MeasuringPoint, Transform
from elastocal.mechanics.kinematics import compute_pose_differences, compute_poses
from elastocal.mechanics.robot_file import describe_robot

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.exchange.urdf_writing import CorrectedUrdf
    from elastocal.mechanics.robot import Robot


# Compliance of a rigid joint in a robot file, rad/(N m): its schema refuses zero, at
# which a fit keeps a joint that the loads hardly show.
_LEAST_COMPLIANCE = 1e-12


@dataclass(frozen=True)
class FoldedRobot:
    """A calibrated robot as a robot file describes it: geometry, springs and weights.

    Attributes
    ----------
    robot : contents of the file.
    left_out : numbers, in the calibrated model, of the effects that the file cannot
        hold. Without them the poses of the calibrated robot are exactly those of
        `robot`.
    """

    robot: Robot
    left_out: tuple[int, ...]


def fold_effects(calibrated: CalibratedRobot) -> FoldedRobot:
    """Fold the effects that a robot file can hold into the robot."""
    robot = calibrated.robot
    model = calibrated.model
    offset = np.zeros(robot.joints)
    ratio = np.eye(robot.joints)
    link_errors: dict[int, np.ndarray] = {}
    left_out = []
    for number, effect in enumerate(model.effects):
        values = calibrated.estimate.coefficients[number]
        joint = effect.joints[0] - 1 if effect.joints else 0
        match effect.effect:
            case "joint_offset":
                offset[joint] += values[0]
            case "transmission_ratio":
                for parameter, value in zip(effect.parameters, values, strict=True):
                    ratio[joint, int(parameter.name.removeprefix("per_q")) - 1] += value
            case "link_geometry":
                previous = link_errors.get(joint + 1, np.zeros(6))
                link_errors[joint + 1] = previous + values
            case "joint_compliance":
                compliance = np.maximum(values, _LEAST_COMPLIANCE)
                robot = replace(robot, compliance=compliance, compliance_known=True)
            case "declared_weight":
                robot = _correct_masses(robot, values)
            case _:
                left_out.append(number)
    folded = replace(
        robot,
        chain=_add_link_errors(robot.chain, link_errors),
        links=(),
        reported_matrix=ratio @ robot.reported_matrix,
        reported_offset=ratio @ robot.reported_offset + offset,
    )
    return FoldedRobot(folded, tuple(left_out))


def write_robot_file(path: str | Path, folded: FoldedRobot, campaign: str) -> None:
    """Write a calibrated robot as a robot file, which names its campaign."""
    text = yaml.safe_dump(
        describe_robot(folded.robot),
        sort_keys=False,
        default_flow_style=None,
        width=128,
    )
    write_text(path, f"# Calibrated by elastocal from the campaign {campaign}.\n{text}")


def _correct_masses(robot: Robot, corrections: np.ndarray) -> Robot:
    """Apply identified corrections, mass and first moment of each weight in turn."""
    masses = []
    per_mass = corrections.reshape(-1, MASS_PARAMETERS)
    for mass, (additional_kg, *moment) in zip(robot.masses, per_mass, strict=True):
        total_kg = mass.mass_kg + additional_kg
        centre = np.array(mass.centre_m) + np.array(moment) / total_kg
        masses.append(
            replace(mass, mass_kg=float(total_kg), centre_m=tuple(centre.tolist()))
        )
    return replace(robot, masses=tuple(masses))


def _add_link_errors(chain: Chain, link_errors: dict[int, np.ndarray]) -> Chain:
    """Insert small transforms at the far ends of links.

    Parameters
    ----------
    chain : the nominal chain.
    link_errors : by link (1 is behind the first joint) three shifts, m, and three
        rotations, rad.
    """
    transforms: list[Transform] = []
    # New index of each index in the nominal chain.
    moved: list[int] = []
    link = 0
    for transform in (*chain.transforms, None):
        ends_link = transform is None or transform.coordinate is not None
        if ends_link and link in link_errors:
            transforms += [
                Transform("TR"[axis // 3], axis % 3, float(value))
                for axis, value in enumerate(link_errors[link])
            ]
        moved.append(len(transforms))
        if transform is not None:
            transforms.append(transform)
            link += transform.coordinate is not None
    points = tuple(
        MeasuringPoint(point.name, moved[point.after], point.offset_m)
        for point in chain.points
    )
    return Chain(tuple(transforms), points, chain.coordinates)


def compute_left_out_displacements_m(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """Compute how far the effects that a robot file cannot hold move the end effector,
    (N,), m. Arguments as in `predict_poses`."""
    folded = remove_effects(calibrated, set(fold_effects(calibrated).left_out))
    position, _ = predict_poses(calibrated, reported_angles, wrench)
    folded_position, _ = predict_poses(folded, reported_angles, wrench)
    return np.linalg.norm(position - folded_position, axis=1)


def compute_urdf_poses(
    urdf: CorrectedUrdf, path: Path, nominal: Robot, reported_angles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the poses of the end effector by a corrected URDF.

    Parameters
    ----------
    urdf, path : the corrected URDF and the file to which it was written.
    nominal : robot before the calibration, whose joint angles the URDF keeps.
    reported_angles : (N, n) commands, rad.

    Returns
    -------
    Position (N, 3), m, and rotation (N, 3, 3), base axes.
    """
    chain = find_nominal_chain(read_urdf(path), urdf.base, urdf.tip, path.as_posix())
    return compute_poses(
        chain, nominal.model_angles(reported_angles), chain.end_effector
    )


def compute_urdf_deviation_m(
    urdf_position: np.ndarray, folded: Robot, reported_angles: np.ndarray
) -> float:
    """Compute the largest distance, m, between the end effectors of a corrected URDF,
    (N, 3), and of the rigid robot of the robot file at commands (N, n), rad."""
    position, _ = compute_poses(
        folded.chain, folded.model_angles(reported_angles), folded.chain.end_effector
    )
    return float(np.linalg.norm(urdf_position - position, axis=1).max())


def compute_file_error_m(
    calibrated: CalibratedRobot,
    position: np.ndarray,
    rotation: np.ndarray,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
) -> float:
    """Compute the RMS position error of a robot that is commanded by a file, m.

    Parameters
    ----------
    calibrated : the robot. Its scope says in which frame the error is stated.
    position, rotation : (N, 3), m, and (N, 3, 3) poses by the file, base axes.
    reported_angles, wrench : (N, n) commands, rad, and (N, 6) loads, N and N m, at which
        the robot comes to rest elsewhere.
    """
    reached = predict_poses(calibrated, reported_angles, wrench)
    differences = compute_pose_differences(position, rotation, *reached)[..., None]
    residual = subtract_placement(calibrated.scope, *reached, differences)
    return root_mean_square(residual[:, :3, 0])
