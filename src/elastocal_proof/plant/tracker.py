"""What a laser tracker reads of the targets, with all that it does wrong."""

from dataclasses import dataclass

import numpy as np

from elastocal_proof.plant.arm import turned

_HOUR_S = 3600.0
# Of one axis, so that the whole is 0.3 mrad and 0.2 mm in the mean square.
_TILT_RAD, _SHIFT_M = 3e-4 / np.sqrt(3.0), 2e-4 / np.sqrt(3.0)


@dataclass(frozen=True)
class Drift:
    """A stand that creeps: motion (d, r) after t hours is rate * u, u = T (1 - exp(-t / T)), so that it slows down.

    `rate_m_per_h`, `rate_rad_per_h`: at the start; along and about the base axes, seen as a motion of the measurements.
    `settling_h`: T; inf for a steady drift.
    """

    rate_m_per_h: tuple[float, ...]
    rate_rad_per_h: tuple[float, ...]
    settling_h: float = np.inf

    def moved(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shift (S, 3) in m and rotation (S, 3, 3) of the measurements at times (S,)."""
        hours = np.asarray(time_s) / _HOUR_S
        if np.isfinite(self.settling_h):
            hours = -self.settling_h * np.expm1(-hours / self.settling_h)
        return hours[:, None] * np.array(self.rate_m_per_h), turned(hours[:, None] * np.array(self.rate_rad_per_h))


@dataclass(frozen=True)
class Move:
    """A stand that was knocked, or put elsewhere and tied to the old frame badly: from one row on all measurements are moved.

    `after_s`: measurements later than this are moved. `shift_m`, `turn_rad`: along and about the base axes through where the
    tracker stands.
    """

    after_s: float
    shift_m: tuple[float, ...]
    turn_rad: tuple[float, ...]

    def moved(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shift (S, 3) in m and rotation (S, 3, 3) of the measurements at times (S,)."""
        later = (np.asarray(time_s) > self.after_s)[:, None]
        return later * np.array(self.shift_m), turned(later * np.array(self.turn_rad))


def misplaced_base(draws: np.random.Generator) -> Move:
    """A base frame that was found badly: tilted by about 0.3 mrad and shifted by about 0.2 mm, all measurements alike."""
    return Move(-np.inf, tuple(_SHIFT_M * draws.standard_normal(3)), tuple(_TILT_RAD * draws.standard_normal(3)))


@dataclass(frozen=True)
class Tracker:
    """A laser tracker; the default only has noise.

    `sigma_m`, `sigma_m_per_m`: standard deviation of a coordinate is sigma_m + sigma_m_per_m * range. `stand_m`: where it
    stands, base frame. `frame_turn`: rotation vector of its own axes in the base's; measurements are in the base frame unless
    the design says otherwise. `misplaced`: of the base frame as the tracker has it against the robot's own, about its origin;
    see `misplaced_base`. `refraction_per_m`: bent light: a target at range r is read at r + k r^2. `scale`: a wrong wavelength.
    The frame of the base was measured with it too, so that a target at x is read at (1 + s) x. `outliers`: share of the
    measurements that are off by far. `outlier_sigmas`: of how many standard deviations these are.
    """

    sigma_m: float = 60e-6
    sigma_m_per_m: float = 0.0
    sigma_rad: float = 60e-6
    stand_m: tuple[float, ...] = (6.0, -2.0, 1.5)
    frame_turn: tuple[float, ...] = (0.0, 0.0, 0.0)
    drift: Drift | None = None
    move: Move | None = None
    misplaced: Move | None = None
    refraction_per_m: float = 0.0
    scale: float = 0.0
    outliers: float = 0.0
    outlier_sigmas: float = 8.0

    def seen(self, position: np.ndarray, rotation: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses as read without noise, base frame.

        `position` (S, targets, 3): m, base frame. `rotation` (S, targets, 3, 3), `time_s` (S,). Returns `position`, `rotation`
        (S, targets, 3), (S, targets, 3, 3).
        """
        sight = position - np.array(self.stand_m)
        far = np.linalg.norm(sight, axis=-1, keepdims=True)
        position = (1.0 + self.scale) * position + self.refraction_per_m * far * sight
        stand, base = np.array(self.stand_m), np.zeros(3)
        for motion, about in ((self.drift, base), (self.move, stand), (self.misplaced, base)):
            if motion is not None:
                shift, turn = motion.moved(time_s)
                position = np.einsum("sij,stj->sti", turn, position - about) + about + shift[:, None]
                rotation = turn[:, None] @ rotation
        return position, rotation

    def read(
        self, position: np.ndarray, rotation: np.ndarray, draws: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Add noise, and outliers, to poses as seen.

        `position`, `rotation` (S, targets, 3), (S, targets, 3, 3). Returns `position`, `rotation`, `outlier` (S, targets, 3),
        (S, targets, 3, 3), (S, targets): the last one bool.
        """
        # A generator each, so that measurements that come later change none that are there.
        chance, metres, radians = draws.spawn(3)
        sigma = self.sigma_at(position)[..., None]
        outlier = chance.random(position.shape[:2]) < self.outliers
        large = np.where(outlier, self.outlier_sigmas, 1.0)[..., None]
        position = position + large * sigma * metres.standard_normal(position.shape)
        turn = turned(large * self.sigma_rad * radians.standard_normal(position.shape))
        return position, turn @ rotation, outlier

    def sigma_at(self, position: np.ndarray) -> np.ndarray:
        """Standard deviation (...) of a coordinate at positions (..., 3), m."""
        return self.sigma_m + self.sigma_m_per_m * np.linalg.norm(position - np.array(self.stand_m), axis=-1)

    def in_own_frame(self, position: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses of the base frame, positions (..., 3) in m and rotations (..., 3, 3), in the tracker's."""
        own = turned(np.array(self.frame_turn))
        return (position - np.array(self.stand_m)) @ own, own.T @ rotation


@dataclass(frozen=True)
class EccentricNest:
    """A nest of the flange's target whose centre circles twice a turn of the tool, e (cos 2 q_n, sin 2 q_n) across its axis.

    `radius_m`: e. `axis`: of the target's frame, about which the tool turns; the circle goes from the next one to the one after
    that.
    """

    radius_m: float
    axis: int = 0

    def moved(self, position: np.ndarray, rotation: np.ndarray, tool_angle: np.ndarray) -> np.ndarray:
        """Positions (S, 3) of the target with rotations (S, 3, 3) at tool angles (S,)."""
        circle = [np.zeros_like(tool_angle), np.cos(2 * tool_angle), np.sin(2 * tool_angle)]
        wobble = np.roll(np.stack(circle, axis=-1), self.axis, axis=-1)
        return position + self.radius_m * np.einsum("sij,sj->si", rotation, wobble)


def rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Rotation vectors of rotation matrices by way of quaternions, rad; angles up to and at a half turn.

    Quaternions by Shepperd's method [1].

    `rotation` (..., 3, 3). Returns (..., 3).

    [1] Shepperd, S. W., Quaternion from rotation matrix, Journal of Guidance and Control 1, 1978.
    """
    r = rotation
    trace = np.trace(r, axis1=-2, axis2=-1)
    # Shepperd: of the four quaternion components the largest is found by a root, the others by division.
    squares = np.stack([trace, r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]], axis=-1)
    largest = np.argmax(squares, axis=-1)
    w = np.stack([1 + trace, r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], -1)
    rows = [w]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        row = np.empty_like(w)
        row[..., 0] = r[..., k, j] - r[..., j, k]
        row[..., 1 + i] = 1 + 2 * r[..., i, i] - trace
        row[..., 1 + j] = r[..., i, j] + r[..., j, i]
        row[..., 1 + k] = r[..., i, k] + r[..., k, i]
        rows.append(row)
    quaternion = np.take_along_axis(np.stack(rows, axis=-2), largest[..., None, None], axis=-2)[..., 0, :]
    quaternion /= np.linalg.norm(quaternion, axis=-1, keepdims=True)
    quaternion *= np.where(quaternion[..., :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(quaternion[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, quaternion[..., :1])
    return quaternion[..., 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0)
