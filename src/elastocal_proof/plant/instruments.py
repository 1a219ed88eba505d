"""Tracker and load cell with all that they do wrong."""

from dataclasses import dataclass

import numpy as np

from elastocal_proof.plant.arm import turned

_HOUR_S = 3600.0
# Of one axis, so that the whole is 0.3 mrad and 0.2 mm in the mean square.
_TILT_RAD, _SHIFT_M = 3e-4 / np.sqrt(3.0), 2e-4 / np.sqrt(3.0)
_SWEEPS, _SETTLED_N = 40, 1e-9


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
    measurements that are off by far. `outlier_sigmas`: of how many standard deviations these are. `nest`: (m, axis) of the
    flange's target whose centre circles twice a turn of the tool, e (cos 2 q_n, sin 2 q_n) across an axis of its frame: from
    the next axis to the one after that.
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
    nest: tuple[float, int] | None = None

    def seen(
        self, position: np.ndarray, rotation: np.ndarray, time_s: np.ndarray, tool_angle: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Poses as read without noise, base frame.

        `position` (S, targets, 3): m, base frame; the flange's last. `rotation` (S, targets, 3, 3), `time_s`, `tool_angle`
        (S,). Returns `position`, `rotation` (S, targets, 3), (S, targets, 3, 3).
        """
        if self.nest:
            radius, axis = self.nest
            circle = np.stack([np.zeros_like(tool_angle), np.cos(2 * tool_angle), np.sin(2 * tool_angle)], axis=-1)
            position = position.copy()
            position[:, -1] += radius * np.einsum("sij,sj->si", rotation[:, -1], np.roll(circle, axis, axis=-1))
        stand, base = np.array(self.stand_m), np.zeros(3)
        sight = position - stand
        far = np.linalg.norm(sight, axis=-1, keepdims=True)
        position = (1.0 + self.scale) * position + self.refraction_per_m * far * sight
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
        own = turned(self.frame_turn)
        return (position - np.array(self.stand_m)) @ own, own.T @ rotation


@dataclass(frozen=True)
class LoadCell:
    """A cell between the pull and the flange, and where it pulls. The default is perfect.

    The experimenter pulls until the display shows what the plan says; a cell that errs makes the flange feel something else. So
    the campaign holds what was shown, and the arm deflects by what was felt. `scale`: shown = (1 + scale) felt. `turn_rad`:
    rotation vector by which the cell is mounted askew: it shows R(turn)^T felt. `bias_N`: shown without a force. It is not
    zeroed between poses. `shift_m`: where the force really acts, from where the plan says. `crosstalk_per_N`: quadratic: shown
    x gets k F_y F_z, and so on round the axes. `in_flange`: which of "turn", "bias" and "shift" are fixed in the flange's axes
    rather than in the base's. `mount`: in the line of pull one number is measured: a force that is wrong acts at the same lever
    and brings a wrong moment. Between flange and tool six are: the forces may be wrong where the moments are right.
    """

    scale: float = 0.0
    turn_rad: tuple[float, ...] = (0.0, 0.0, 0.0)
    bias_N: tuple[float, ...] = (0.0, 0.0, 0.0)
    shift_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    crosstalk_per_N: float = 0.0
    in_flange: tuple[str, ...] = ()
    mount: str = "pull"

    def shown(self, felt: np.ndarray, flange_rotation: np.ndarray) -> np.ndarray:
        """Force on the display for the force that is felt, both (S, 3), N, base axes."""
        turn, bias = (self._in_base(name, flange_rotation) for name in ("turn", "bias"))
        askew = np.einsum("sji,sj->si", turned(turn), felt)
        crossed = self.crosstalk_per_N * np.roll(felt, -1, axis=1) * np.roll(felt, -2, axis=1)
        return (1.0 + self.scale) * askew + bias + crossed

    def felt(self, force: np.ndarray, lever: np.ndarray, flange_rotation: np.ndarray) -> np.ndarray:
        """Wrench on the flange, which solves shown = cell(felt) by fixed-point iteration: what is lacking is pulled more.

        `force` (S, 3): as shown, N, base axes; a row of zeros where nothing pulls. `lever` (S, 3): from the flange's origin to
        where the plan lets the force act, m, base axes. `flange_rotation` (S, 3, 3). Returns (S, 6): N, N m at the flange's
        origin, base axes.
        """
        found = force.copy()
        for _ in range(_SWEEPS):
            missing = force - self.shown(found, flange_rotation)
            found += missing
            if np.abs(missing).max() < _SETTLED_N:
                break
        felt = np.where(force.any(axis=1, keepdims=True), found, 0.0)
        moment = np.cross(lever, felt if self.mount == "pull" else force)
        return np.concatenate([felt, moment + np.cross(self._in_base("shift", flange_rotation), felt)], axis=1)

    def _in_base(self, name: str, flange_rotation: np.ndarray) -> np.ndarray:
        """An error in base axes, (S, 3)."""
        error = np.array({"turn": self.turn_rad, "bias": self.bias_N, "shift": self.shift_m}[name])
        shape = (len(flange_rotation), 3)
        return np.broadcast_to(flange_rotation @ error if name in self.in_flange else error, shape)
