"""Compute how visible a defect is to a tracker: its non-centrality.

Let d be the noise-free change that a defect causes in the training measurements, in
standard deviations. The raw non-centrality is |d|^2. The retained one is the part that
the declared model cannot absorb by other joint compliances b (and, if the frame is
unknown, by a motion of the frame) and by other weights w, in standard deviations of
their declarations: min over b, w of |d - X b - V w|^2 + |w|^2. The weights enter as
prior information, as in mixed estimation [1]_.

References
----------
.. [1] Theil, H. and Goldberger, A. S., On pure and mixed statistical estimation in
   economics, International Economic Review 2, 1961.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from elastocal_proof.plant.arm import LinkMass, to_rotation_vector
from elastocal_proof.plant.multibody import MultibodyModel
from elastocal_proof.plant.simulated_robot import (
    Schedule,
    SimulatedRobot,
    simulate_equilibrium,
    simulate_poses,
)

# Ratio of the width of a link to the reach of the arm. To the analyst's knowledge, a
# centre of mass may lie anywhere within this width.
_WIDTH_OF_REACH = 0.1


class NoncentralityModel:
    """The faultless robot at a schedule, to which defective robots are compared.

    Parameters
    ----------
    robot, schedule
        The faultless robot and its campaign.
    free_frame
        Whether the analysis fits the tracker's frame.
    declared
        Masses as they are declared to the analysis.
    """

    def __init__(
        self,
        robot: SimulatedRobot,
        schedule: Schedule,
        *,
        free_frame: bool = False,
        declared: Sequence[LinkMass] = (),
    ) -> None:
        self.robot = robot
        self.schedule = schedule
        model, equilibrium = simulate_equilibrium(robot, schedule)
        self._start = equilibrium.coordinates[:, model.gear]
        self.poses = robot.tracker.observe(
            equilibrium.position,
            equilibrium.rotation,
            schedule.time_s,
            schedule.angle[:, -1],
        )
        jacobian, torques = _linearize(model, equilibrium.coordinates, robot, declared)
        # Each compliance turns its own gear in proportion to the torque on it; each
        # standard deviation of a weight turns all gears.
        torque = equilibrium.force[:, model.gear]
        turns = [torque * unit for unit in np.eye(robot.arm.joints)]
        turns += [robot.compliance * torque for torque in torques]
        columns = [
            self._whiten(np.einsum("stij,sj->sti", jacobian, turn)) for turn in turns
        ]
        measurements = len(columns[0])
        weights = columns[robot.arm.joints :]
        columns = columns[: robot.arm.joints]
        if free_frame:
            columns += self._list_frame_motions()
        # A column of zeros, such as the compliance of a joint without torque, absorbs
        # nothing.
        columns = [
            column / np.linalg.norm(column) for column in columns if column.any()
        ]
        weights = [column for column in weights if column.any()]
        # The lower rows state that each weight equals its declaration within one
        # standard deviation.
        priors = np.eye(len(weights), len(columns) + len(weights), len(columns))
        design = np.array([*columns, *weights]).reshape(-1, measurements).T
        self._absorbed = np.linalg.qr(np.vstack([design, priors]))[0]
        self._priors = len(weights)

    def compute_change(self, robot: SimulatedRobot) -> np.ndarray:
        """Compute a robot's change of the training measurements, in standard deviations,
        (M,)."""
        poses = simulate_poses(robot, self.schedule, self._start)
        return self._compare_poses(*poses)

    def compute_noncentralities(self, robot: SimulatedRobot) -> dict[str, float]:
        """Compute the non-centralities of a robot's change before and after absorption,
        ``raw`` and ``retained``."""
        change = self.compute_change(robot)
        residual = self._compute_residual(change)
        return {"raw": float(change @ change), "retained": float(residual @ residual)}

    def _list_frame_motions(self) -> list[np.ndarray]:
        """Changes of the measurements by a shift along and a turn about each axis."""
        position = self.poses[0]
        motions = []
        for unit in np.eye(3):
            axis = np.broadcast_to(unit, position.shape)
            shift = np.concatenate([axis, np.zeros_like(position)], axis=-1)
            turn = np.concatenate([np.cross(unit, position), axis], axis=-1)
            motions += [self._whiten(shift), self._whiten(turn)]
        return motions

    def _compare_poses(self, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Compare poses with those of the robot without a defect, in standard
        deviations, (M,)."""
        turns = to_rotation_vector(rotation @ np.swapaxes(self.poses[1], -1, -2))
        return self._whiten(np.concatenate([position - self.poses[0], turns], axis=-1))

    def _whiten(self, change: np.ndarray) -> np.ndarray:
        """Changes (S, targets, 6) of the training poses in standard deviations, (M,)."""
        tracker = self.robot.tracker
        shift = change[..., :3] / tracker.sigma_at(self.poses[0])[..., None]
        whitened = np.concatenate([shift, change[..., 3:] / tracker.sigma_rad], axis=-1)
        return whitened[self.schedule.training].ravel()

    def _compute_residual(self, change: np.ndarray) -> np.ndarray:
        """Part of a change that the declared model cannot absorb, (M + weights,). The
        last entries are the weights that absorb the other part, in their standard
        deviations."""
        padded = np.append(change, np.zeros(self._priors))
        return padded - self._absorbed @ (self._absorbed.T @ padded)


def _linearize(
    model: MultibodyModel,
    coordinates: np.ndarray,
    robot: SimulatedRobot,
    declared: Sequence[LinkMass],
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Linearize the poses and the gravity torques of an arm at equilibrium.

    Returns
    -------
    jacobian : (S, points, 6, n) array
        Of all measuring points with respect to the gears.
    torques : list of (S, n) arrays
        On the gears, per standard deviation of each mass and of each component of its
        centre.
    """
    mujoco_model = model.model
    data = mujoco.MjData(mujoco_model)
    translation = np.empty((3, mujoco_model.nv))
    rotation = np.empty((3, mujoco_model.nv))
    jacobian = np.empty((len(coordinates), len(model.sites), 6, len(model.gear)))
    torques = np.empty((len(declared), 4, len(coordinates), len(model.gear)))
    for state in range(len(coordinates)):
        data.qpos[:] = coordinates[state]
        mujoco.mj_kinematics(mujoco_model, data)
        mujoco.mj_comPos(mujoco_model, data)
        for point, site in enumerate(model.sites):
            mujoco.mj_jacSite(mujoco_model, data, translation, rotation, site)
            jacobian[state, point] = np.vstack([translation, rotation])[:, model.gear]
        for torque, mass in zip(torques[:, :, state], declared, strict=True):
            body = mujoco_model.body(f"arm{mass.link}" if mass.link else "foot").id
            axes = data.xmat[body].reshape(3, 3)
            mujoco.mj_jac(
                mujoco_model,
                data,
                translation,
                rotation,
                data.xpos[body] + axes @ mass.centre_m,
                body,
            )
            weight = mass.mass_kg * np.array(mujoco_model.opt.gravity)
            torque[0] = mass.relative_std * (weight @ translation[:, model.gear])
            std_m = mass.centre_std_m(_WIDTH_OF_REACH * robot.arm.reach_m)
            torque[1:] = np.cross(axes.T, weight) * std_m @ rotation[:, model.gear]
    return jacobian, [*torques.reshape(-1, len(coordinates), len(model.gear))]
