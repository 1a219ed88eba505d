"""Campaigns simulated with the exact kinematics of an elastic robot, for the tests of
data checks."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation
from synthetic import fill_measurements

from elastocal.campaigns.campaign import Campaign, Target
from elastocal.measuring.channels import parse_measuring
from elastocal.mechanics.elastostatics import compute_generalized_forces
from elastocal.mechanics.kinematics import compute_poses, compute_poses_and_jacobians
from elastocal.mechanics.robot import Robot

POINTS = ("2DoF", "3DoF", "4DoF", "6DoF")


@dataclass(frozen=True)
class Plan:
    """How a campaign is measured.

    Attributes
    ----------
    poses, repeats : int
    loads : int
        Number of loads, without the unloaded one.
    tracker : bool
        Measure in the frame of a tracker that stands anywhere, with targets anywhere on
        their points; otherwise in the base frame, with targets at their points.
    oriented : bool
        Measure orientations, too.
    noise : float
        Standard deviation of the noise, m and rad.
    force : float
        Size of the loads, N.
    """

    poses: int = 30
    loads: int = 3
    repeats: int = 1
    tracker: bool = False
    oriented: bool = True
    noise: float = 6e-5
    force: float = 1000.0


def replace_measured_columns(campaign, **columns):
    """Return a campaign with other columns of its measurements."""
    return replace(campaign, measurements=replace(campaign.measurements, **columns))


@dataclass(frozen=True)
class SimulatedRobot:
    """The real robot of a simulated campaign.

    Attributes
    ----------
    robot : Robot
        Its true kinematics and joint compliances.
    joint_offset : float or ndarray (joints,)
        Added to the joint angles, rad.
    sag : float
        Rotation of joint 2 for each unit of the cosine of its angle, rad.
    """

    robot: Robot
    joint_offset: float | np.ndarray = 0.0
    sag: float = 0.0

    def deflect(self, joint_angles, wrench):
        """Return the true joint coordinates under a load, ndarray (M, joints)."""
        chain = self.robot.chain
        jacobian = compute_poses_and_jacobians(chain, joint_angles, chain.end_effector)[
            2
        ]
        torque = compute_generalized_forces(jacobian, wrench)
        true = joint_angles + self.joint_offset + torque * self.robot.compliance
        true[:, 1] += self.sag * np.cos(joint_angles[:, 1])
        return true


def draw_joint_angles(robot, rng, poses, moving):
    """Draw joint angles within the limits and ±2.5 rad.

    `moving` maps a joint, from 0, to the number of poses in which it moves; it stands
    at zero in the others.
    """
    low = np.maximum(robot.joint_limits[:, 0], -2.5)
    high = np.minimum(robot.joint_limits[:, 1], 2.5)
    joint_angles = rng.uniform(low, high, (poses, robot.joints))
    for joint, moving_poses in moving.items():
        joint_angles[moving_poses:, joint] = 0.0
    return joint_angles


def draw_wrenches(plan, rng):
    """Draw loads of one size in random directions, the first of each pose without a
    load: ndarray (poses, loads + 1, 6)."""
    force = rng.standard_normal((plan.poses, plan.loads + 1, 3))
    force *= plan.force / np.linalg.norm(force, axis=-1, keepdims=True)
    force[:, 0] = 0.0
    return np.concatenate([force, np.cross([0.0, 0.5, 0.0], force)], axis=-1)


def compute_target_poses(chain, coordinates, target, offsets):
    """Compute position and rotation of each measurement in the base frame.

    `coordinates` (M, joints) and `target` (M,) belong to the measurements, `offsets`
    (targets, 3) to the targets at `POINTS`.
    """
    position = np.empty((len(target), 3))
    rotation = np.empty((len(target), 3, 3))
    for index, name in enumerate(POINTS):
        point = replace(chain.point(name), offset_m=tuple(offsets[index]))
        of_target = target == index
        position[of_target], rotation[of_target] = compute_poses(
            chain, coordinates[of_target], point
        )
    return position, rotation


def simulate_measurements(robot, simulated, plan, moving, seed):
    """Simulate the measurements of a plan, with the joint limits of a nominal robot."""
    rng = np.random.default_rng(seed)
    joint_angles = draw_joint_angles(robot, rng, plan.poses, moving)
    shape = plan.poses, plan.loads + 1, plan.repeats, len(POINTS)
    pose, load, repeat, target = (
        index.ravel().astype(np.int32) for index in np.indices(shape)
    )
    wrench = draw_wrenches(plan, rng)[pose, load]
    coordinates = simulated.deflect(joint_angles[pose], wrench)
    offsets = np.zeros((len(POINTS), 3))
    if plan.tracker:
        offsets = rng.uniform(-0.15, 0.15, (len(POINTS), 3))
    chain = simulated.robot.chain
    position, rotation = compute_target_poses(chain, coordinates, target, offsets)
    if plan.tracker:
        frame = Rotation.random(random_state=seed).as_matrix()
        position = position @ frame.T + rng.uniform(-3, 3, 3)
        rotation = frame @ rotation
    position = position + plan.noise * rng.standard_normal(position.shape)
    noise = Rotation.from_rotvec(plan.noise * rng.standard_normal(position.shape))
    rotation = noise * Rotation.from_matrix(rotation)
    return fill_measurements(
        pose=pose,
        load=load,
        repeat=repeat,
        target=target,
        joint_angles=joint_angles[pose],
        wrench=wrench,
        position=position,
        rotation_vector=rotation.as_rotvec() if plan.oriented else None,
    )


def make_campaign(
    robot, seed, plan=Plan(), true_robot=None, true_offset=0.0, sag=0.0, moving=None
):
    """Make a campaign of a robot, measured as planned.

    Parameters
    ----------
    robot : Robot
        Nominal robot of the campaign.
    seed : int
    plan : Plan
    true_robot : Robot, optional
        The real robot; the nominal one by default.
    true_offset, sag
        Joint offset and sag of the real robot; see `SimulatedRobot`.
    moving : dict of int to int, optional
        Joints that move in the first poses only; see `draw_joint_angles`.
    """
    simulated = SimulatedRobot(true_robot or robot, true_offset, sag)
    offset_m = None if plan.tracker else (0.0, 0.0, 0.0)
    return Campaign(
        name="made",
        robot=robot,
        measuring=make_plan("pose" if plan.oriented else "position"),
        frame="tracker" if plan.tracker else "base",
        targets=tuple(Target(f"T{name}", name, offset_m) for name in POINTS),
        compliance="identify",
        declared=(),
        noise=None,
        holdout={"fraction": 0.3, "seed": 1},
        measurements=simulate_measurements(robot, simulated, plan, moving or {}, seed),
    )


def make_plan(measured):
    """Make the measuring plan of a kind without features."""
    return parse_measuring({"measured": measured}, "campaign.yaml")


def add_geometric_errors(robot, seed, size_m):
    """Return the same robot with each length longer or shorter by a size in m."""
    rng = np.random.default_rng(seed)
    transforms = []
    for transform in robot.chain.transforms:
        if transform.kind == "T":
            error = size_m * rng.choice([-1.0, 1.0])
            transform = replace(transform, constant=transform.constant + error)
        transforms.append(transform)
    return replace(robot, chain=replace(robot.chain, transforms=tuple(transforms)))


def change_compliances(robot, seed, share):
    """Return the same robot with each compliance changed by up to a share of it."""
    factors = 1 + np.random.default_rng(seed).uniform(-share, share, robot.joints)
    return replace(robot, compliance=robot.compliance * factors)
