"""Laws of the gears: how far the arm behind a drive turns under the torque that it transmits.

Each law adds its share to the deflection of the linear springs, theta = c tau, ndarray (S, n) of `GearStates`, rad. The shapes
are those of machines rather than of regressions: a dead band with edges, a stiffness that steps, a hysteresis with a history.
"""

from dataclasses import dataclass

import numpy as np

_HISTORY_STEPS = 48
_REFERENCE_C = 20.0


@dataclass(frozen=True)
class GearStates:
    """What the gears of a robot are exposed to, in S states of it.

    `torque`, `unloaded` (S, n): N m, now and before the external load came on. `angle` (S, n): of the drives, rad. `approach`
    (S, n): sense in which each drive moved last, -1, 0, +1. `temperature_c` (S,): of the gears. `previous` (S,) of int: state
    from which the load was changed to this one without a move of the drives; -1 after a fresh approach.
    """

    torque: np.ndarray
    unloaded: np.ndarray
    angle: np.ndarray
    approach: np.ndarray
    temperature_c: np.ndarray
    previous: np.ndarray


@dataclass(frozen=True)
class LinearSprings:
    """theta = c tau at each joint; `compliance` (n,) in rad/(N m)."""

    compliance: np.ndarray

    def __call__(self, states: GearStates) -> np.ndarray:
        return self.compliance * states.torque


@dataclass(frozen=True)
class _AtJoint:
    """A law of one joint, from 0. Subclasses give `turn(states, torque)`, (S,)."""

    joint: int

    def __call__(self, states: GearStates) -> np.ndarray:
        found = np.zeros_like(states.torque)
        found[:, self.joint] = self.turn(states, states.torque[:, self.joint])
        return found

    def turn(self, states: GearStates, torque: np.ndarray) -> np.ndarray:
        raise NotImplementedError


@dataclass(frozen=True)
class DeadBand(_AtJoint):
    """Play between flanks that only a seal's weak spring bridges: theta = D clip(tau / tau_t, -1, 1).

    In series with the gear's spring, so that beyond the torque tau_t that closes the gap the flanks lie on each other and the
    play adds a constant D, half of the gap. For tau_t -> 0 it is a true dead band.
    """

    half_play_rad: float
    closing_torque_Nm: float

    def turn(self, states: GearStates, torque: np.ndarray) -> np.ndarray:
        return self.half_play_rad * np.clip(torque / self.closing_torque_Nm, -1.0, 1.0)


@dataclass(frozen=True)
class StepwiseStiffening(_AtJoint):
    """Teeth that come to bear one after another: beyond each torque tau_k the compliance falls by a further step d_k.

    theta = - sum_k d_k sign(tau) max(|tau| - tau_k, 0).

    `steps` (float, float): (tau_k in N m, d_k in rad/(N m)).
    """

    steps: tuple[tuple[float, float], ...]

    def turn(self, states: GearStates, torque: np.ndarray) -> np.ndarray:
        return -np.sign(torque) * sum(drop * np.maximum(np.abs(torque) - start, 0.0) for start, drop in self.steps)


@dataclass(frozen=True)
class AngleDependentStiffness(_AtJoint):
    """A stiffness that varies with an angle: theta = c (1 / (1 + e cos(k q_m - phase)) - 1) tau.

    `compliance`: rad/(N m) of the joint. `share`: e. `of`: joint m whose angle matters; the joint's own or another. `order`: k.
    """

    compliance: float
    share: float
    phase_rad: float
    of: int
    order: float = 1.0

    def turn(self, states: GearStates, torque: np.ndarray) -> np.ndarray:
        stiffness = 1.0 + self.share * np.cos(self.order * states.angle[:, self.of] - self.phase_rad)
        return self.compliance * (1.0 / stiffness - 1.0) * torque


@dataclass(frozen=True)
class CompensatorStiffness(_AtJoint):
    """Stiffness that a coil spring adds at the shoulder, whose torque the controller has taken care of.

    With anchor at distance a, crank at L and free length s0, s^2 = a^2 + L^2 - 2 a L cos(u), u = q - u0, the spring stores
    k (s - s0)^2 / 2, whose second derivative is k_c = k a L [cos u (1 - s0/s) + (a L sin^2 u) s0 / s^3].
    theta = (1 / (1/c + k_c) - c) tau.

    `zero_rad`: u0, where crank and anchor point the same way.
    """

    compliance: float
    stiffness_N_per_m: float
    anchor_m: float
    crank_m: float
    free_length_m: float
    zero_rad: float

    def turn(self, states: GearStates, torque: np.ndarray) -> np.ndarray:
        u, product = states.angle[:, self.joint] - self.zero_rad, self.anchor_m * self.crank_m
        s = np.sqrt(self.anchor_m**2 + self.crank_m**2 - 2.0 * product * np.cos(u))
        ratio = self.free_length_m / s
        added = self.stiffness_N_per_m * product * (np.cos(u) * (1.0 - ratio) + product * np.sin(u) ** 2 * ratio / s**2)
        return (1.0 / (1.0 / self.compliance + added) - self.compliance) * torque


@dataclass(frozen=True)
class Coupling:
    """Two gears in one housing: theta_i = c tau_j, theta_j = c tau_i.

    `pair` (int, int).
    """

    pair: tuple[int, int]
    compliance: float

    def __call__(self, states: GearStates) -> np.ndarray:
        found = np.zeros_like(states.torque)
        one, other = self.pair
        found[:, one] = self.compliance * states.torque[:, other]
        found[:, other] = self.compliance * states.torque[:, one]
        return found


@dataclass(frozen=True)
class BoucWen(_AtJoint):
    """Friction that remembers: theta = -h z, dz = (d tau / tau_h) (1 - |z|^m (beta sign(z d tau) + 1 - beta)).

    The Bouc-Wen model of hysteresis [1]. Friction holds back: an arm that came in the sense s stays behind its drive, z = s
    with all of its friction wound up. Each change of the load then moves z along a loop that depends on the order of loads and
    not on their speed, the deflection lagging behind the torque. h / tau_h must be less than the gear's compliance, or the arm
    would recede from a push.

    `half_width_rad`: h. `torque_Nm`: tau_h, over which z turns round. `sharpness`: m. `beta`: 1/2: unloading starts along the
    straight line of slope 1 / tau_h.

    [1] Wen, Y.-K., Method for random vibration of hysteretic systems, Journal of the Engineering Mechanics Division ASCE 102,
        1976.
    """

    half_width_rad: float
    torque_Nm: float
    sharpness: float = 2.0
    beta: float = 0.5

    def turn(self, states: GearStates, torque: np.ndarray) -> np.ndarray:
        wound = states.approach[:, self.joint].astype(float)
        start = states.unloaded[:, self.joint]
        z = np.empty_like(wound)
        fresh = states.previous < 0
        z[fresh] = self.moved(wound[fresh], (torque - start)[fresh])
        # A state follows one of a smaller number, so that in order each finds its past done.
        for state in np.flatnonzero(~fresh):
            before = states.previous[state]
            z[state] = self.moved(z[before : before + 1], torque[state : state + 1] - torque[before])[0]
        return -self.half_width_rad * z

    def moved(self, z: np.ndarray, change: np.ndarray) -> np.ndarray:
        """z (S,) after the torque has changed steadily by `change` (S,), by the explicit midpoint method."""
        step = change / (self.torque_Nm * _HISTORY_STEPS)
        for _ in range(_HISTORY_STEPS):
            middle = z + 0.5 * step * self._slope(z, step)
            z = np.clip(z + step * self._slope(middle, step), -1.0, 1.0)
        return z

    def _slope(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        return 1.0 - np.abs(z) ** self.sharpness * (self.beta * np.sign(z * step) + 1.0 - self.beta)


@dataclass(frozen=True)
class Asymmetric(_AtJoint):
    """Flanks of unlike shape: theta = k tau^2, alike for both signs of the torque; `curvature` k in rad/(N m)^2."""

    curvature: float

    def turn(self, states: GearStates, torque: np.ndarray) -> np.ndarray:
        return self.curvature * torque**2


@dataclass(frozen=True)
class CableTransmission(_AtJoint):
    """Cables from the motor over the joint before: theta = s (tau (1 + f q / pi) + tau_o / 2).

    They yield to the tension of their joint as their free length, which falls or grows by a share f as it winds, and to that of
    the neighbour o whose pulley they pass.

    `softness`: s, rad/(N m). `winding`: f. `other`: o, from 0.
    """

    softness: float
    winding: float
    other: int

    def turn(self, states: GearStates, torque: np.ndarray) -> np.ndarray:
        free = 1.0 + self.winding * states.angle[:, self.joint] / np.pi
        return self.softness * (torque * free + 0.5 * states.torque[:, self.other])


@dataclass(frozen=True)
class WarmSoftening(_AtJoint):
    """A gear that softens as it warms: theta = c r (T - 20 °C) tau.

    `compliance`: rad/(N m). `per_K`: r.
    """

    compliance: float
    per_K: float

    def turn(self, states: GearStates, torque: np.ndarray) -> np.ndarray:
        return self.compliance * self.per_K * (states.temperature_c - _REFERENCE_C) * torque
