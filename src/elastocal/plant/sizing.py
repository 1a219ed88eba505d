"""How large a defect is to the eye of a tracker, and how large it must be to have a given non-centrality.

With d the change that a defect makes in the readings, noise free, of the poses that are not held out, and sigma their standard
deviations, the raw non-centrality is |d / sigma|^2: the signal before anything has absorbed it. What the declared model cannot
absorb by other compliances of its joints is |M d / sigma|^2, M projecting out the plant's own change of the readings per
compliance (and, where the frame is unknown, per motion of the frame). The latter is what a test can find.
"""

from dataclasses import dataclass, replace

import numpy as np

from elastocal.plant.physical_robot import seen_poses
from elastocal.plant.tracker import rotation_vector

_STEP = 0.02
_ROUNDS = 12
# Below this share of the largest a direction is second order and rounding.
_SAME = 0.02


@dataclass(frozen=True)
class Signal:
    """What a defect does to the readings.

    Attributes
    ----------
    raw, retained : float
        Non-centralities before and after absorption.
    rms_m, rms_rad : float
        Root mean square over all readings of the length of the change of position, and of orientation.
    """

    raw: float
    retained: float
    rms_m: float
    rms_rad: float


class Yardstick:
    """The faultless robot at a schedule, to which defective ones are compared.

    Parameters
    ----------
    robot : PhysicalRobot
    schedule : Schedule
    targets : sequence of int, optional
        Which measuring points are read; all by default.
    orientation : bool
        Whether orientations are read too.
    free_frame : bool
        Whether the analysis fits the tracker's frame.
    """

    def __init__(self, robot, schedule, targets=None, orientation=True, free_frame=False):
        self.robot, self.schedule, self.orientation = robot, schedule, orientation
        self.targets = list(range(len(robot.arm.points)) if targets is None else targets)
        self.poses = seen_poses(robot, schedule)
        columns = []
        for joint, compliance in enumerate(robot.compliance):
            stiffer = robot.compliance.copy()
            stiffer[joint] *= 1.0 + _STEP
            columns.append(self.change(replace(robot, compliance=stiffer))[schedule.training].ravel() / (_STEP * compliance))
        if free_frame:
            columns += self._frame_columns()
        columns = np.array(columns).T
        self._absorbed = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]

    def change(self, robot):
        """Change of the readings against the faultless robot in standard deviations, ndarray (S, targets, 3 or 6)."""
        metres, radians = self._change(*seen_poses(robot, self.schedule))
        parts = [metres / self.robot.tracker.sigma_at(self.poses[0])[:, self.targets, None]]
        if self.orientation:
            parts.append(radians / self.robot.tracker.sigma_rad)
        return np.concatenate(parts, axis=-1)

    def signal(self, robot):
        """How a robot differs from the faultless one.

        Parameters
        ----------
        robot : PhysicalRobot

        Returns
        -------
        Signal
        """
        metres, radians = self._change(*seen_poses(robot, self.schedule))
        seen, left = self._seen(robot), self.left(robot)
        rms = [float(np.sqrt((part**2).sum(axis=-1).mean())) for part in (metres, radians)]
        return Signal(float(seen @ seen), float(left @ left), *rms)

    def left(self, robot):
        """What the declared model cannot absorb of a robot's change in the readings that are not held out, ndarray."""
        seen = self._seen(robot)
        return seen - self._absorbed @ (self._absorbed.T @ seen)

    def angle_deg(self, robot, others):
        """Angle between what is left of a robot and all that others make together, in any proportion.

        Parameters
        ----------
        robot : PhysicalRobot
        others : iterable of PhysicalRobot
            Each left with something.

        Returns
        -------
        float
        """
        mine, theirs = self.left(robot), np.array([self.left(other) for other in others])
        _, size, directions = np.linalg.svd(theirs / np.linalg.norm(theirs, axis=1, keepdims=True), full_matrices=False)
        share = np.linalg.norm(directions[size > _SAME * size[0]] @ mine) / np.linalg.norm(mine)
        return float(np.degrees(np.arccos(min(share, 1.0))))

    def _seen(self, robot):
        return self.change(robot)[self.schedule.training].ravel()

    def _change(self, position, rotation):
        position_0, rotation_0 = self.poses
        relative = rotation @ np.swapaxes(rotation_0, -1, -2)
        return (position - position_0)[:, self.targets], rotation_vector(relative)[:, self.targets]

    def _frame_columns(self):
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


def size_for(yardstick, robot_of_size, start, target, quantity="retained", largest=np.inf):
    """Size of a defect at which its non-centrality is as wanted.

    Parameters
    ----------
    yardstick : Yardstick
    robot_of_size : callable
        Robot with the defect of a given size.
    start : float
        A size to begin with.
    target : float
        Non-centrality.
    quantity : {"retained", "raw"}
    largest : float
        No larger size is tried.

    Returns
    -------
    size : float
    signal : Signal
        As it came out.

    Raises
    ------
    ValueError
        No size has it to one per cent: the defect is absorbed whatever its size, saturates, or would be larger than allowed.

    Notes
    -----
    The non-centrality of a linear effect grows with the square of its size; the secant of the logarithms allows for others.
    """
    size, exponent, last = float(start), 2.0, None
    for _ in range(_ROUNDS):
        signal = yardstick.signal(robot_of_size(size))
        value = getattr(signal, quantity)
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
