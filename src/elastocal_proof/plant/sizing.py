"""How large a defect is to the eye of a tracker: its non-centrality.

With d the change that a defect makes in the measurements, noise free, of the poses that
are not held out, in standard deviations, the raw non-centrality is |d|^2. What the
declared model cannot absorb by other compliances X of its joints (and, where the frame
is unknown, by a motion of the frame) and by other weights V, in standard deviations of
their declarations, is min over b, w of |d - X b - V w|^2 + |w|^2: the weights come in
as prior information of mixed estimation [1] does.

[1] Theil, H. and Goldberger, A. S., On pure and mixed statistical estimation in economics, International Economic Review 2,
    1961.
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
    open_simulation_stream,
    simulate_equilibrium,
    simulate_poses,
)

# Width of a link over the reach of the arm: within it centres of mass lie anywhere, as
# far as an analyst knows.
_WIDTH_OF_REACH = 0.1


class NoncentralityModel:
    """The faultless robot at a schedule, to which defective ones are compared.

    `free_frame`: whether the analysis fits the tracker's frame. `declared`: weights as
    they are declared to the analysis.
    """

    def __init__(
        self,
        robot: SimulatedRobot,
        schedule: Schedule,
        free_frame: bool = False,
        declared: Sequence[LinkMass] = (),
    ) -> None:
        self.robot = robot
        self.schedule = schedule
        machine, (coordinates, force, position, rotation) = simulate_equilibrium(
            robot, schedule
        )
        self._start = coordinates[:, machine.gear]
        self.poses = robot.tracker.seen(
            position, rotation, schedule.time_s, schedule.angle[:, -1]
        )
        jacobian, torques = _responses(machine, coordinates, robot, declared)
        springs = [
            np.eye(robot.arm.joints)[joint] * force[:, machine.gear]
            for joint in range(robot.arm.joints)
        ]
        columns, weights = (
            [self._flat(np.einsum("stij,sj->sti", jacobian, turn)) for turn in turns]
            for turns in (springs, [robot.compliance * torque for torque in torques])
        )
        for axis in np.eye(3) if free_frame else ():
            along = np.broadcast_to(axis, self.poses[0].shape)
            nothing = np.zeros_like(self.poses[0])
            columns.append(self._flat(np.concatenate([along, nothing], axis=-1)))
            columns.append(
                self._flat(
                    np.concatenate([np.cross(axis, self.poses[0]), along], axis=-1)
                )
            )
        height = len(columns[0])
        # A column of nothing, such as the compliance of a joint that no load turns,
        # absorbs nothing.
        columns = [
            column / np.linalg.norm(column) for column in columns if column.any()
        ]
        weights = [column for column in weights if column.any()]
        stacked = np.zeros((height + len(weights), len(columns) + len(weights)))
        stacked[:height] = np.array([*columns, *weights]).reshape(-1, height).T
        stacked[height:, len(columns) :] = np.eye(len(weights))
        self._absorbed = np.linalg.qr(stacked)[0]
        self._priors = len(weights)

    def project_change(self, robot: SimulatedRobot) -> tuple[np.ndarray, np.ndarray]:
        """A robot's change in the measurements that are not held out, and what the
        declared model cannot absorb of it, (M,).

        Both in standard deviations; the last entries of the second are the weights, in
        theirs, that absorb the rest.
        """
        seen = self._change(*simulate_poses(robot, self.schedule, self._start))
        return seen, self._left(seen)

    def compute_measured_residual(self, robot: SimulatedRobot) -> np.ndarray:
        """What cannot be absorbed of a robot's measurements with the noise that they
        have in its campaign."""
        seen = simulate_poses(robot, self.schedule, self._start)
        draws = open_simulation_stream(self.schedule.seed, "readings")
        return self._left(self._change(*robot.tracker.read(*seen, draws)))

    def compute_noncentralities(self, robot: SimulatedRobot) -> dict[str, float]:
        """Non-centralities of a robot's change before and after absorption, ``raw`` and
        ``retained``."""
        seen, left = self.project_change(robot)
        return {"raw": float(seen @ seen), "retained": float(left @ left)}

    def _change(self, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        turns = to_rotation_vector(rotation @ np.swapaxes(self.poses[1], -1, -2))
        return self._flat(np.concatenate([position - self.poses[0], turns], axis=-1))

    def _flat(self, apart: np.ndarray) -> np.ndarray:
        """Changes (S, targets, 6) as the analysis counts them: in standard deviations,
        of the poses that are not held out."""
        tracker = self.robot.tracker
        metres = apart[..., :3] / tracker.sigma_at(self.poses[0])[..., None]
        counted = np.concatenate([metres, apart[..., 3:] / tracker.sigma_rad], axis=-1)
        return counted[self.schedule.training].ravel()

    def _left(self, seen: np.ndarray) -> np.ndarray:
        whole = np.append(seen, np.zeros(self._priors))
        return whole - self._absorbed @ (self._absorbed.T @ whole)


def _responses(
    machine: MultibodyModel,
    coordinates: np.ndarray,
    robot: SimulatedRobot,
    declared: Sequence[LinkMass],
) -> tuple[np.ndarray, list[np.ndarray]]:
    """To first order, at rest: Jacobians of all measuring points for turns of the
    gears, (S, points, 6, n); and torques on the gears per standard deviation of each
    mass and of each component of its centre, (S, n) each."""
    model, data, gear = machine.model, mujoco.MjData(machine.model), machine.gear
    shift = np.empty((3, model.nv))
    turn = np.empty((3, model.nv))
    count = len(coordinates)
    jacobian = np.empty((count, len(machine.sites), 6, len(gear)))
    torques = np.empty((len(declared), 4, count, len(gear)))
    for state, row in enumerate(coordinates):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for point, site in enumerate(machine.sites):
            mujoco.mj_jacSite(model, data, shift, turn, site)
            jacobian[state, point, :3] = shift[:, gear]
            jacobian[state, point, 3:] = turn[:, gear]
        for number, mass in enumerate(declared):
            link = model.body(f"arm{mass.link}" if mass.link else "foot").id
            weight = mass.mass_kg * np.array(model.opt.gravity)
            axes = data.xmat[link].reshape(3, 3)
            mujoco.mj_jac(
                model, data, shift, turn, data.xpos[link] + axes @ mass.centre_m, link
            )
            torques[number, 0, state] = mass.relative_std * (weight @ shift[:, gear])
            moments = np.cross(axes.T, weight) * mass.centre_std_m(
                _WIDTH_OF_REACH * robot.arm.reach_m
            )
            torques[number, 1:, state] = moments @ turn[:, gear]
    return jacobian, [*torques.reshape(-1, count, len(gear))]
