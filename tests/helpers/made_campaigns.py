"""Campaigns made in memory by the exact kinematics of a robot with springs, for the
tests of faults."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation
from synthetic import fill_measurements

from elastocal.campaigns.campaign import Campaign, Target
from elastocal.mechanics.elastostatics import compute_generalized_forces
from elastocal.mechanics.kinematics import compute_poses, compute_poses_and_jacobians

POINTS = ("2DoF", "3DoF", "4DoF", "6DoF")


@dataclass(frozen=True)
class Plan:
    """How a campaign is measured.

    `poses`, `loads`, `repeats`: `loads` without the unloaded one. `tracker`: whether
    the base stands somewhere in the tracker's frame and the targets anywhere on their
    points. `oriented`: whether orientations are measured. `noise`: standard deviation,
    m and rad. `force`: N.
    """

    poses: int = 30
    loads: int = 3
    repeats: int = 1
    tracker: bool = False
    oriented: bool = True
    noise: float = 6e-5
    force: float = 1000.0


def replace_measured_columns(campaign, **columns):
    """A campaign with other columns of its measurements."""
    return replace(campaign, measurements=replace(campaign.measurements, **columns))


def make_campaign(
    robot, seed, plan=Plan(), true_robot=None, true_offset=0.0, sag=0.0, moving=None
):
    """A campaign of a robot, measured as planned.

    `robot`: what the campaign takes it for. `true_robot`: what it is; `robot` without.
    `true_offset`: added to the joint angles, rad. `sag`: turn of joint 2 for each unit
    of the cosine of its angle, rad. `moving`: joints, from 0, that stand at zero in all
    but so many poses.
    """
    rng = np.random.default_rng(seed)
    true_robot = true_robot or robot
    low = np.maximum(robot.joint_limits[:, 0], -2.5)
    high = np.minimum(robot.joint_limits[:, 1], 2.5)
    angles = rng.uniform(low, high, (plan.poses, robot.joints))
    for joint, few in (moving or {}).items():
        angles[few:, joint] = 0.0
    shape = plan.poses, plan.loads + 1, plan.repeats, len(POINTS)
    pose, load, repeat, target = (index.ravel() for index in np.indices(shape))
    force = rng.standard_normal((plan.poses, plan.loads + 1, 3))
    force *= plan.force / np.linalg.norm(force, axis=-1, keepdims=True)
    force[:, 0] = 0.0
    wrenches = np.concatenate([force, np.cross([0.0, 0.5, 0.0], force)], axis=-1)
    q = angles[pose]
    wrench = wrenches[pose, load]
    end = compute_poses_and_jacobians(
        true_robot.chain, q, true_robot.chain.end_effector
    )[2]
    moved = (
        q
        + true_offset
        + compute_generalized_forces(end, wrench) * true_robot.compliance
    )
    moved[:, 1] += sag * np.cos(q[:, 1])
    offsets = (
        rng.uniform(-0.15, 0.15, (len(POINTS), 3))
        if plan.tracker
        else np.zeros((len(POINTS), 3))
    )
    position = np.empty((len(pose), 3))
    rotation = np.empty((len(pose), 3, 3))
    for index, name in enumerate(POINTS):
        point = replace(true_robot.chain.point(name), offset_m=tuple(offsets[index]))
        mask = target == index
        position[mask], rotation[mask] = compute_poses(
            true_robot.chain, moved[mask], point
        )
    if plan.tracker:
        frame = Rotation.random(random_state=seed).as_matrix()
        position = position @ frame.T + rng.uniform(-3, 3, 3)
        rotation = frame @ rotation
    position = position + plan.noise * rng.standard_normal(position.shape)
    turned = Rotation.from_rotvec(
        plan.noise * rng.standard_normal(position.shape)
    ) * Rotation.from_matrix(rotation)
    places = {"pose": pose, "load": load, "repeat": repeat, "target": target}
    measurements = fill_measurements(
        **{name: index.astype(np.int32) for name, index in places.items()},
        joint_angles=q,
        wrench=wrench,
        position=position,
        rotation_vector=turned.as_rotvec() if plan.oriented else None,
    )
    return Campaign(
        name="made",
        robot=robot,
        measured="pose" if plan.oriented else "position",
        frame="tracker" if plan.tracker else "base",
        targets=tuple(
            Target(f"T{name}", name, None if plan.tracker else (0.0, 0.0, 0.0))
            for name in POINTS
        ),
        compliance="identify",
        declared=(),
        noise=None,
        holdout={"fraction": 0.3, "seed": 1},
        measurements=measurements,
    )


def add_geometric_errors(robot, seed, size_m):
    """The same robot with other lengths, m."""
    rng = np.random.default_rng(seed)
    transforms = tuple(
        replace(
            transform, constant=transform.constant + size_m * rng.choice([-1.0, 1.0])
        )
        if transform.kind == "T"
        else transform
        for transform in robot.chain.transforms
    )
    return replace(robot, chain=replace(robot.chain, transforms=transforms))


def change_compliances(robot, seed, share):
    """The same robot with compliances off by up to a share."""
    factors = 1 + np.random.default_rng(seed).uniform(-share, share, robot.joints)
    return replace(robot, compliance=robot.compliance * factors)
