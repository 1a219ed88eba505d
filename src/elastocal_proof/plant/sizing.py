"""How large a defect is to the eye of a tracker, and how large it must be to have a given non-centrality.

With d the change that a defect makes in the measurements, noise free, of the poses that are not held out, in standard
deviations, the raw non-centrality is |d|^2: the signal before anything has absorbed it. What the declared model cannot absorb
by other compliances X of its joints (and, where the frame is unknown, by a motion of the frame) and by other weights V,
declared with a standard deviation each, is

    min over b, w of |d - X b - V w|^2 + |w|^2,

V in its standard deviations: what a test can find where the weights are known so well and no better. The weights come in as
prior information of mixed estimation [1] does.

[1] Theil, H. and Goldberger, A. S., On pure and mixed statistical estimation in economics, International Economic Review 2,
    1961.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule, at_rest, read_poses, seen_at_rest, seen_poses
from elastocal_proof.plant.tracker import rotation_vector
from elastocal_proof.plant.weights import allowed_centre_std_m

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from elastocal_proof.plant.arm import LinkMass
    from elastocal_proof.plant.multibody import Machine
    from elastocal_proof.plant.statics import Equilibrium

_ROUNDS = 12
# Below this share of the largest a direction is second order and rounding.
_SAME = 0.02


@dataclass(frozen=True)
class Signal:
    """What a defect does to the measurements.

    `raw`, `retained`: non-centralities before and after absorption. `rms_m`, `rms_rad`: root mean square over all measurements
    of the length of the change of position, and of orientation.
    """

    raw: float
    retained: float
    rms_m: float
    rms_rad: float


class Yardstick:
    """The faultless robot at a schedule, to which defective ones are compared.

    `targets`: which measuring points are read; all by default. `orientation`: whether orientations are read too. `free_frame`:
    whether the analysis fits the tracker's frame. `declared`: weights as they are declared to the analysis.
    """

    def __init__(
        self,
        robot: PhysicalRobot,
        schedule: Schedule,
        targets: Iterable[int] | None = None,
        orientation: bool = True,
        free_frame: bool = False,
        declared: Iterable[LinkMass] = (),
    ) -> None:
        self.robot, self.schedule, self.orientation = robot, schedule, orientation
        self.targets = list(range(len(robot.arm.points)) if targets is None else targets)
        machine, self._rest = at_rest(robot, schedule)
        self.poses = seen_at_rest(robot, schedule, self._rest)
        self._turns = _per_turn(machine, self._rest)
        columns = [self._turned_by(joint, self._rest.torque[:, machine.gear[joint]]) for joint in range(robot.arm.joints)]
        if free_frame:
            columns += self._frame_columns()
        weights = [self._turned_by(None, turn) for turn in _turns_of_weights(machine, self._rest, robot, declared)]
        height = len(columns[0])
        # A column of nothing, such as the compliance of a joint that no load turns, absorbs nothing.
        columns = [column / np.linalg.norm(column) for column in columns if column.any()]
        weights = [column for column in weights if column.any()]
        stacked = np.zeros((height + len(weights), len(columns) + len(weights)))
        stacked[:height] = np.array([*columns, *weights]).reshape(-1, height).T
        stacked[height:, len(columns) :] = np.eye(len(weights))
        self._absorbed, self._priors = np.linalg.qr(stacked)[0], len(weights)

    def change(self, robot: PhysicalRobot) -> np.ndarray:
        """Change of the measurements against the faultless robot in standard deviations, ndarray (S, targets, 3 or 6)."""
        return self._whitened(*self._change(robot))

    def residual(self, robot: PhysicalRobot) -> np.ndarray:
        """As `left`, of a robot's measurements with the noise that they have in its campaign."""
        position, rotation, _ = read_poses(robot, self.schedule, self._rest)
        return self._with_left(self._whitened(*self._apart(position, rotation)))[1]

    def signal(self, robot: PhysicalRobot) -> Signal:
        """How a robot differs from the faultless one."""
        metres, radians = self._change(robot)
        seen, left = self._with_left(self._whitened(metres, radians))
        rms = [float(np.sqrt((part**2).sum(axis=-1).mean())) for part in (metres, radians)]
        return Signal(float(seen @ seen), float(left @ left), *rms)

    def left(self, robot: PhysicalRobot) -> np.ndarray:
        """What the declared model cannot absorb of a robot's change in the measurements that are not held out, ndarray (M,).

        Its last entries are the weights, in their standard deviations, that absorb the rest.
        """
        return self.seen_and_left(robot)[1]

    def seen_and_left(self, robot: PhysicalRobot) -> tuple[np.ndarray, np.ndarray]:
        """A robot's change in the measurements that are not held out, and what is left of it as in `left`."""
        return self._with_left(self.change(robot))

    def angle_deg(self, robot: PhysicalRobot, others: Iterable[PhysicalRobot]) -> float:
        """Principal angle [1] between what is left of a robot and all that others make together, in any proportion.

        `others`: one that is left with nothing adds no direction: a gear that stiffens at a torque that no load of these
        reaches. Returns 90 where all others are left with nothing.

        [1] Björck, Å. and Golub, G. H., Numerical methods for computing angles between linear subspaces, Mathematics of
            Computation 27, 1973.
        """
        mine, theirs = self.left(robot), np.array([self.left(other) for other in others])
        theirs = theirs[theirs.any(axis=1)]
        if not len(theirs):
            return 90.0
        _, size, directions = np.linalg.svd(theirs / np.linalg.norm(theirs, axis=1, keepdims=True), full_matrices=False)
        share = float(np.linalg.norm(directions[size > _SAME * size[0]] @ mine) / np.linalg.norm(mine))
        return float(np.degrees(np.arccos(min(share, 1.0))))

    def _with_left(self, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        seen = change[self.schedule.training].ravel()
        whole = np.append(seen, np.zeros(self._priors))
        return seen, whole - self._absorbed @ (self._absorbed.T @ whole)

    def _change(self, robot: PhysicalRobot) -> tuple[np.ndarray, np.ndarray]:
        return self._apart(*seen_poses(robot, self.schedule, self._rest))

    def _apart(self, position: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position_0, rotation_0 = self.poses
        relative = rotation @ np.swapaxes(rotation_0, -1, -2)
        return (position - position_0)[:, self.targets], rotation_vector(relative)[:, self.targets]

    def _whitened(self, metres: np.ndarray, radians: np.ndarray) -> np.ndarray:
        parts = [metres / self.robot.tracker.sigma_at(self.poses[0])[:, self.targets, None]]
        if self.orientation:
            parts.append(radians / self.robot.tracker.sigma_rad)
        return np.concatenate(parts, axis=-1)

    def _turned_by(self, joint: int | None, turn: np.ndarray) -> np.ndarray:
        """Change of the measurements, to first order, where one gear, or each of them, turns by so much (S,) or (S, n) more."""
        metres, radians = self._turns
        if joint is None:
            turn = turn[:, None, :, None]
            metres, radians = (metres * turn).sum(axis=2), (radians * turn).sum(axis=2)
        else:
            turn = turn[:, None, None]
            metres, radians = metres[:, :, joint] * turn, radians[:, :, joint] * turn
        return self._whitened(metres[:, self.targets], radians[:, self.targets])[self.schedule.training].ravel()

    def _frame_columns(self) -> list[np.ndarray]:
        position = self.poses[0][self.schedule.training][:, self.targets]
        sigma = self.robot.tracker.sigma_at(position)[..., None]
        columns = []
        for axis in np.eye(3):
            shifted, turned = [np.broadcast_to(axis, position.shape) / sigma], [np.cross(axis, position) / sigma]
            if self.orientation:
                shifted.append(np.zeros_like(position))
                turned.append(np.broadcast_to(axis, position.shape) / self.robot.tracker.sigma_rad)
            columns += [np.concatenate(parts, axis=-1).ravel() for parts in (shifted, turned)]
        return columns


def _per_turn(machine: Machine, rest: Equilibrium) -> tuple[np.ndarray, np.ndarray]:
    """Movement of all targets per turn of each gear, two ndarray (S, targets, n, 3): m/rad, and axes where it turns them."""
    where, gear = rest.where, machine.gear
    axis, arm = where.axis[:, None, gear], where.position[:, :, None] - where.anchor[:, None, gear]
    body = machine.model.site_bodyid[list(machine.sites.values())]
    moves = machine.beyond[gear][:, body].T[None, :, :, None]
    return moves * np.cross(axis, arm), moves * axis


def _turns_of_weights(
    machine: Machine, rest: Equilibrium, robot: PhysicalRobot, declared: Iterable[LinkMass]
) -> list[np.ndarray]:
    """Turns of all gears per standard deviation of each mass and each component of its centre, list of ndarray (S, n)."""
    where, gear, pull = rest.where, machine.gear, np.array(robot.structure.gravity_m_s2)
    reach_m = robot.arm.reach_m
    found = []
    for mass in declared:
        link = machine.links[mass.link]
        turn, moves = where.body_rotation[:, link], machine.beyond[gear, link]
        place = where.body[:, link] + turn @ np.array(mass.centre_m)
        levers = [(place[:, None] - where.anchor[:, gear]) * mass.relative_std * mass.mass_kg]
        levers += [turn[:, None, :, axis] * mass.mass_kg * allowed_centre_std_m(mass, reach_m) for axis in range(3)]
        for lever in levers:
            torque = (where.axis[:, gear] * np.cross(lever, pull)).sum(axis=2) * moves
            found.append(robot.compliance * torque)
    return found


def size_for(
    yardstick: Yardstick,
    robot_of_size: Callable[[float], PhysicalRobot],
    start: float,
    target: float,
    quantity: str = "retained",
    largest: float = np.inf,
) -> tuple[float, Signal]:
    """Size of a defect at which its non-centrality is as wanted.

    `robot_of_size`: robot with the defect of a given size. `start`: a size to begin with. `target`: non-centrality. `quantity`:
    one of "retained", "raw". `largest`: no larger size is tried. Returns `signal`: as it came out. Raises `ValueError`: no size
    has it to one per cent: the defect is absorbed whatever its size, saturates, or would be larger than allowed.

    The non-centrality of a linear effect grows with the square of its size; the secant of the logarithms allows for others.
    """
    size, exponent = float(start), 2.0
    last: tuple[float, float] | None = None
    for _ in range(_ROUNDS):
        signal = yardstick.signal(robot_of_size(size))
        value: float = getattr(signal, quantity)
        # What is absorbed leaves rounding and second order, a millionth of the raw signal.
        if value <= 1e-6 * signal.raw or not np.isfinite(value):
            break
        if abs(value / target - 1.0) < 0.01:
            return size, signal
        if last is not None and last[0] != size:
            slope = np.log(value / last[1]) / np.log(size / last[0])
            exponent = slope if 0.3 < slope < 8.0 else 2.0
        last = (size, value)
        size = min(largest, size * float(np.clip((target / value) ** (1.0 / exponent), 0.02, 50.0)))
        if size == last[0]:
            break
    found = f"{value:.3g} of {signal.raw:.3g} raw at {size:.3g}"
    raise ValueError(f"no size found for a {quantity} non-centrality of {target:g}: {found}")
