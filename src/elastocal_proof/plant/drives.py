"""Where the drives really stand, against what the controller shows: errors of angle that no load is needed for.

Each law gives ndarray (S, n) of `Visits`, rad, unless it says otherwise.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

_REFERENCE_C = 20.0


@dataclass(frozen=True)
class Visits:
    """What the drives went through, for S states of the arm.

    `angle` (S, n): as the controller believes, rad. `approach` (S,) of int: number of the approach; states of one number were
    reached by the same move. `pose` (S,) of int, `time_s` (S,). `seed`: of what is random about the drives.
    """

    angle: np.ndarray
    approach: np.ndarray
    pose: np.ndarray
    time_s: np.ndarray
    seed: int

    def each_approach(self, draws: np.random.Generator, *shape: int) -> np.ndarray:
        """Standard normal numbers (S, ...), the same within one approach."""
        return draws.standard_normal((int(self.approach.max()) + 1, *shape))[self.approach]


@dataclass(frozen=True)
class ZeroOffset:
    """A drive that was mastered wrong by `offset_rad`; `joint` from 0."""

    joint: int
    offset_rad: float

    def __call__(self, visits: Visits) -> np.ndarray:
        return _one(visits, self.joint, np.full(len(visits.angle), self.offset_rad))


@dataclass(frozen=True)
class TransmissionError:
    """Teeth and eccentric wheels: the sum of a_k sin(k q + phase_k).

    `waves` (float, float, float): (order k, which need be no integer; amplitude in rad; phase in rad).
    """

    joint: int
    waves: tuple[tuple[float, float, float], ...]

    def __call__(self, visits: Visits) -> np.ndarray:
        q = visits.angle[:, self.joint]
        turn = sum((size * np.sin(order * q + phase) for order, size, phase in self.waves), np.zeros_like(q))
        return _one(visits, self.joint, turn)


@dataclass(frozen=True)
class WrongRatio:
    """A drive that turns with another's angle, or with its own by a wrong ratio: e q_m, rad/rad."""

    joint: int
    of: int
    per_rad: float

    def __call__(self, visits: Visits) -> np.ndarray:
        return _one(visits, self.joint, self.per_rad * visits.angle[:, self.of])


@dataclass(frozen=True)
class CablePull:
    """A hose that is wound by two joints at once and pulls at a third: e q_a q_b, rad/rad^2."""

    joint: int
    wound: tuple[int, int]
    per_rad2: float

    def __call__(self, visits: Visits) -> np.ndarray:
        one, other = self.wound
        return _one(visits, self.joint, self.per_rad2 * visits.angle[:, one] * visits.angle[:, other])


@dataclass(frozen=True)
class SlippingZero:
    """A coupling that slips a little at some moves: a random walk from approach to approach.

    `step_rad`: standard deviation of a slip. `share`: of the moves at which it slips.
    """

    joint: int
    step_rad: float
    share: float = 0.3

    def __call__(self, visits: Visits) -> np.ndarray:
        sizes, whether = (np.random.default_rng([visits.seed, 7, part]) for part in range(2))
        # Approaches are numbered in the order of time.
        number = int(visits.approach.max()) + 1
        slips = self.step_rad * sizes.standard_normal(number) * (whether.random(number) < self.share)
        return _one(visits, self.joint, np.cumsum(slips)[visits.approach])


@dataclass(frozen=True)
class Runout:
    """One coordinate of an axis that wobbles as its bearing turns: size cos(order q - phase), (S,), rad or m.

    `joint`: from 0. `order`: times a turn.
    """

    joint: int
    order: int
    size: float
    phase_rad: float

    def __call__(self, visits: Visits) -> np.ndarray:
        return self.size * np.cos(self.order * visits.angle[:, self.joint] - self.phase_rad)


class Castings(Protocol):
    """What is warm."""

    def of_castings(self, time_s: np.ndarray) -> np.ndarray:
        """Temperature (S,) at times (S,), °C."""


@dataclass(frozen=True)
class WarmBend:
    """A piece of a link that bends as one side of it warms up: per_K (T - 20 °C), (S,), rad."""

    per_K: float
    warmth: Castings

    def __call__(self, visits: Visits) -> np.ndarray:
        return self.per_K * (self.warmth.of_castings(visits.time_s) - _REFERENCE_C)


@dataclass(frozen=True)
class Repeatability:
    """Each approach ends a little elsewhere; `sigma_rad` (n,). No defect: what every drive does."""

    sigma_rad: tuple[float, ...]

    def __call__(self, visits: Visits) -> np.ndarray:
        draws = np.random.default_rng([visits.seed, 11])
        return np.array(self.sigma_rad) * visits.each_approach(draws, visits.angle.shape[1])


@dataclass(frozen=True)
class PoseError:
    """An error of the angles common to all measurements of a pose; `sigma_rad` (n,). No defect: every arm has it."""

    sigma_rad: tuple[float, ...]

    def __call__(self, visits: Visits) -> np.ndarray:
        draws = np.random.default_rng([visits.seed, 13])
        drawn = draws.standard_normal((int(visits.pose.max()) + 1, visits.angle.shape[1]))
        return np.array(self.sigma_rad) * drawn[visits.pose]


def _one(visits: Visits, joint: int, turn: np.ndarray) -> np.ndarray:
    found = np.zeros_like(visits.angle)
    found[:, joint] = turn
    return found
