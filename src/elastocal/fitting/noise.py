"""Noise of the measurements: a sensor part, alike in all directions, and the repeatability of the joints, seen through the
Jacobian.

Repeats of a state tell both: each repeat is a fresh approach, so that the joints come to rest a little differently and move all
targets together, while the sensor errs for each target on its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy  # Its optimizers load where a campaign has repeats enough for them.
from scipy.linalg import helmert
from scipy.special import gammaincinv

from elastocal.fitting.displacement import conditions
from elastocal.fitting.linearization import linearize
from elastocal.fitting.observations import each_approach, select_states, standard_uncertainty, without_outlying_repeats

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

# Fewer contrasts of repeats than this do not separate the joints' part from the sensor's.
FEWEST_FOR_JOINTS = 60
# Fewer than this say nothing of their own.
FEWEST = 9
# So many tell every deviation to a percent; more only take time.
MOST = 20_000
# No sensor repeats to less than this, m or rad: a sixtieth of the wavelength of a laser.
FINEST = 1e-8
# How sure the joint part should be to be no smaller than taken: too small a value raises false alarms, too large one costs
# power.
_UPPER = 0.8
_SMALLEST_RAD, _LARGEST_RAD = 1e-8, 1e-2
# Deviations of a joint that are tried between these: steps of two fifths.
_DEVIATIONS = 40


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one measurement.

    `source`: one of "repeats", "declared". `position_m`, `orientation_rad`: sensor part, each component. `joint_rad` (n,):
    repeatability of each joint. `degrees_of_freedom`: contrasts of repeats behind the figures; 0 where they are declared.
    `pose_rad`: error of each joint that all measurements of a pose have in common. `usual_m`: where measurements state
    uncertainties of their own, that with which a measurement has `position_m`; others are in proportion. 0 where all are alike.
    """

    source: str
    position_m: float
    orientation_rad: float
    joint_rad: np.ndarray
    degrees_of_freedom: int = 0
    pose_rad: float = 0.0
    usual_m: float = 0.0

    @property
    def of_measurements(self) -> Noise:
        """The same without what the measurements of a pose have in common."""
        return replace(self, pose_rad=0.0)

    def scaled(self, factor: float) -> Noise:
        """The same with the noise of single measurements multiplied."""
        return replace(
            self,
            position_m=factor * self.position_m,
            orientation_rad=factor * self.orientation_rad,
            joint_rad=factor * self.joint_rad,
        )

    def spread(self, observations: Observations) -> np.ndarray | None:
        """Standard deviation of each position over `position_m`, (M,); None where all are alike."""
        if not self.usual_m or observations.position_std is None:
            return None
        return observations.position_std / self.usual_m


def declared_noise(campaign: Campaign) -> Noise | None:
    """Noise as a campaign, or each of its measurements, declares it; None where neither does."""
    usual, stated = _usual(campaign.measurements), campaign.noise or {}
    if not usual and not stated:
        return None
    position = usual or stated["position_m"]
    joints = np.zeros(campaign.robot.joints) + stated.get("joint_rad", 0.0)
    return Noise("declared", position, stated.get("orientation_rad", position), joints, usual_m=usual)


def _usual(measurements: Measurements) -> float:
    """Root mean square of the standard deviations that measurements state, m; 0 where they do not."""
    if measurements.u95_m is None:
        return 0.0
    return float(np.sqrt((standard_uncertainty(measurements.u95_m) ** 2).mean()))


def noise_from_repeats(model: Model, estimate: Estimate, measurements: Measurements) -> Noise | None:
    """Noise by restricted maximum likelihood from the differences between repeats.

    The likelihood is that of error contrasts [1], here of orthonormal Helmert contrasts of repeats; L-BFGS-B [2] finds its
    maximum. The joints' part is taken where it is worth its parameters by Akaike's criterion [3], at the upper limit of a
    one-sided chi-squared interval of 80 %; with fewer contrasts than show it, their mean square is the sensor's part.

    `estimate`: its frames turn measurements into base axes; nothing else of it matters. Returns None where there are too few
    repeats, or where they do not differ at all.

    [1] Patterson, H. D. and Thompson, R., Recovery of inter-block information when block sizes are unequal, Biometrika 58,
        1971.
    [2] Byrd, R. H., Lu, P., Nocedal, J. and Zhu, C., A limited memory algorithm for bound constrained optimization, SIAM
        Journal on Scientific Computing 16, 1995.
    [3] Akaike, H., A new look at the statistical model identification, IEEE Transactions on Automatic Control 19, 1974.
    """
    parts = _contrasts(model, estimate, measurements)
    total = sum(contrasts.size for contrasts, _ in parts)
    if total < FEWEST:
        return None
    rows, joints = model.rows, model.sites.joints
    every = np.concatenate([contrasts.reshape(-1, rows) for contrasts, _ in parts])
    position = np.sqrt((every[:, :3] ** 2).mean())
    orientation = np.sqrt((every[:, 3:] ** 2).mean()) if rows == 6 else position
    if min(position, orientation) < FINEST:
        # The same number again and again is a sensor that stands still or digits that were cut off, not one without noise.
        return None
    usual = _usual(measurements)
    sensor = Noise("repeats", float(position), float(orientation), np.zeros(joints), total, usual_m=usual)
    if total < FEWEST_FOR_JOINTS:
        return sensor
    data = ([_seen(*part) for part in parts],)
    nothing = np.full(joints, np.log(_SMALLEST_RAD))
    both = [np.log(position), np.log(orientation)][: rows // 3]
    start = np.concatenate([both, np.full(joints, np.log(0.3 * position))])
    bounds = [(value - 7, value + 1) for value in both] + [(np.log(_SMALLEST_RAD), np.log(_LARGEST_RAD))] * joints
    fitted = scipy.optimize.minimize(_negative_log_likelihood, start, data, "L-BFGS-B", jac=True, bounds=bounds)
    # Akaike: the joints' part must be worth its parameters.
    if fitted.fun + joints > _negative_log_likelihood(np.concatenate([both, nothing]), *data)[0]:
        return sensor
    values = np.exp(fitted.x)
    # Each approach draws a joint once, however many targets are read.
    per_joint = max(min(total // (joints + 1), sum(len(contrasts) for contrasts, _ in parts)), 1)
    inflation = np.sqrt(per_joint / (2 * gammaincinv(per_joint / 2, 1 - _UPPER)))
    sensors = float(values[0]), float(values[rows // 3 - 1])
    return Noise("repeats", *sensors, values[rows // 3 :] * inflation, total, usual_m=usual)


def hidden_repeatability(model: Model, estimate: Estimate, measurements: Measurements) -> tuple[float, float]:
    """How well joints repeat, all alike, where the sensor hides each of them: root mean square of what repeats leave possible,
    and the degrees of freedom that its square has.

    rad; by the restricted likelihood of `noise_from_repeats`, its maximum over the sensor's part, evenly over the deviation of
    a joint. Zeros where there are too few repeats to say anything: then it is not known.
    """
    parts = _contrasts(model, estimate, measurements)
    if sum(contrasts.size for contrasts, _ in parts) < FEWEST:
        return 0.0, 0.0
    data = [_seen(*part) for part in parts]
    sensors, joints = model.rows // 3, model.sites.joints
    counts, squares = sum(part.count for part in data), np.sum([part.squares for part in data], axis=0)
    start = 0.5 * np.log(np.maximum(squares / counts, FINEST**2))
    deviations = np.geomspace(_SMALLEST_RAD, _LARGEST_RAD, _DEVIATIONS)

    def value(free: np.ndarray, joint: float) -> tuple[float, np.ndarray]:
        total, slope = _negative_log_likelihood(np.concatenate([free, np.full(joints, np.log(joint))]), data)
        return total, slope[:sensors]

    bounds = [(at - 7, at + 1) for at in start]
    likelihood = -np.array(
        [scipy.optimize.minimize(value, start, (joint,), "L-BFGS-B", jac=True, bounds=bounds).fun for joint in deviations]
    )
    # Even steps of the logarithm: each stands for a range as wide as the deviation itself.
    weights = np.exp(likelihood - likelihood.max()) * deviations
    weights /= weights.sum()
    mean = float(weights @ deviations**2)
    return float(np.sqrt(mean)), 2.0 * mean**2 / float(weights @ (deviations**2 - mean) ** 2)


def chosen_noise(
    campaign: Campaign, model: Model, estimate: Estimate, measurements: Measurements
) -> tuple[Noise | None, list[str]]:
    """Noise from repeats where there are enough, else as declared.

    A ratio of the two outside the chi-squared interval of 99 % of a variance is a warning.

    `model`, `estimate`, `measurements`: as in `noise_from_repeats`. Returns `noise`: None where there are neither.
    """
    repeats, declared = noise_from_repeats(model, estimate, measurements), declared_noise(campaign)
    if repeats is None:
        return declared, [] if declared else ["no repeats and no declared noise: nothing says how large the residual may be"]
    if declared is None:
        return repeats, []
    ratio = repeats.position_m / declared.position_m
    of_positions = repeats.degrees_of_freedom * 3 // model.rows
    low, high = np.sqrt(2 * gammaincinv(of_positions / 2, [0.005, 0.995]) / of_positions)
    if low < ratio < high:
        return repeats, []
    return repeats, [f"repeats show {ratio:.2f} times the declared noise of positions; the repeats are used"]


def measurement_covariances(noise: Noise, jacobians: np.ndarray, rows: int, spread: np.ndarray | None = None) -> np.ndarray:
    """Covariance of all measurements of one approach.

    `jacobians` (G, k, rows, n): of the k targets, with respect to the joints. `rows`: 3 for positions, 6 for poses. `spread`
    (G, k): of `Noise.spread`. Returns (G, k * rows, k * rows).
    """
    groups, targets = jacobians.shape[:2]
    stacked = jacobians.reshape(groups, targets * rows, -1) * noise.joint_rad
    sensor = np.tile(np.repeat([noise.position_m, noise.orientation_rad], 3)[:rows] ** 2, targets)
    if spread is not None:
        sensor = sensor * of_components(spread, rows).reshape(groups, -1) ** 2
    covariance = stacked @ stacked.transpose(0, 2, 1)
    covariance[:, np.arange(targets * rows), np.arange(targets * rows)] += sensor
    return covariance


def of_components(spread: np.ndarray, rows: int) -> np.ndarray:
    """Spread of each component of observations.

    `spread` (...): of positions; orientations are alike. `rows`: 3 for positions, 6 for poses. Returns (..., rows).
    """
    whole = np.ones((*spread.shape, rows))
    whole[..., :3] = spread[..., None]
    return whole


def _contrasts(model: Model, estimate: Estimate, measurements: Measurements) -> list[tuple[np.ndarray, np.ndarray]]:
    """Orthonormal contrasts between repeats (G, k * rows) and their Jacobians (G, k, rows, n), for each number k of targets."""
    if not len(measurements) or not np.ptp(measurements.repeat):
        return []
    bare, at = replace(model, effects=()), replace(estimate, coefficients=(), shapes=())
    observations, repeated = each_approach(without_outlying_repeats(measurements))
    first = np.flatnonzero(np.diff(repeated, prepend=-1))
    # The targets that an approach saw, beside those of the first approach to its state.
    seen = np.bincount(observations.state)
    start = np.concatenate([[0], np.cumsum(seen)])
    targets = np.full((len(seen), seen.max()), -1)
    targets[observations.state, np.arange(len(observations)) - start[observations.state]] = observations.target
    alike = (targets == targets[first[repeated]]).all(axis=1)
    number = np.bincount(repeated, alike).astype(int)
    degrees = (number - 1) * seen[first] * model.rows
    # As many as tell, of states spread over the campaign.
    wanted = np.flatnonzero(number > 1)
    share = degrees.sum() / MOST
    wanted = wanted[np.linspace(0, len(wanted) - 1, int(len(wanted) / share)).astype(int)] if share > 1 else wanted
    chosen = alike & np.isin(repeated, wanted)
    if not chosen.any():
        return []
    some = select_states(observations, chosen)
    line = linearize(bare, at, some, conditions(bare, at, some.states))
    usual = _usual(measurements)
    spread = some.position_std / usual if some.position_std is not None else None
    state, seen = repeated[chosen], seen[chosen]
    start = np.concatenate([[0], np.cumsum(seen)[:-1]])
    first = np.flatnonzero(np.diff(state, prepend=-1))
    many = np.diff(first, append=len(state))
    parts: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for repeats, count in np.unique(np.column_stack([many, seen[first]]), axis=0):
        mine = first[(many == repeats) & (seen[first] == count)]
        of_first = start[mine][:, None] + np.arange(count)
        members = start[mine[:, None] + np.arange(repeats)][..., None] + np.arange(count)
        residual = line.residual[members].reshape(len(mine), repeats, -1)
        found = (helmert(repeats) @ residual).reshape(-1, residual.shape[2])
        jacobian = line.coordinate_jacobian[of_first][..., : model.sites.joints]
        if spread is not None:
            # As if all positions were alike; repeats of a state are taken to be.
            each = of_components(spread[of_first], model.rows)
            found = found / np.repeat(each.reshape(len(mine), -1), repeats - 1, axis=0)
            jacobian = jacobian / each[..., None]
        parts.setdefault(count, []).append((found, np.repeat(jacobian, repeats - 1, axis=0)))
    pairs = (zip(*part, strict=True) for part in parts.values())
    return [(np.concatenate(contrasts), np.concatenate(jacobians)) for contrasts, jacobians in pairs]


@dataclass(frozen=True)
class _Seen:
    """What contrasts v (G, k * rows) of one number k of targets say of the noise, Jacobians S (G, k * rows, n) beside them.

    `count`: numbers of one sensor's part, of positions or of orientations, in v. `squares` (s,): v'v of each sensor's part, of
    all groups. `along` (G, s, n): S'v of each. `gram` (G, s, n, n): S'S of each.
    """

    count: int
    squares: np.ndarray
    along: np.ndarray
    gram: np.ndarray


def _seen(contrasts: np.ndarray, jacobians: np.ndarray) -> _Seen:
    groups, targets, rows, joints = jacobians.shape
    sensors = rows // 3
    stacked = jacobians.reshape(groups, targets, sensors, 3, joints).swapaxes(1, 2).reshape(groups, sensors, -1, joints)
    vectors = contrasts.reshape(groups, targets, sensors, 3).swapaxes(1, 2).reshape(groups, sensors, -1)
    across = stacked.swapaxes(2, 3)
    along = (across @ vectors[..., None])[..., 0]
    return _Seen(groups * targets * 3, (vectors**2).sum(axis=(0, 2)), along, across @ stacked)


def _negative_log_likelihood(logs: np.ndarray, parts: Sequence[_Seen]) -> tuple[float, np.ndarray]:
    """Minus the logarithm of the restricted likelihood, and its derivatives by the logarithms of the deviations.

    With D the variances of the sensors and L those of the joints, Sigma = D + S L S' has the determinant |D| |I + L C| and the
    inverse D^-1 - D^-1 S A S' D^-1, C = S' D^-1 S and A = (I + L C)^-1 L, by Woodbury's identity [1].

    [1] Hager, W. W., Updating the inverse of a matrix, SIAM Review 31, 1989.
    """
    sensors = len(logs) - parts[0].along.shape[2]
    precision, deviation = np.exp(-2.0 * logs[:sensors]), np.exp(logs[sensors:])
    total, slope = 0.0, np.zeros(len(logs))
    for part in parts:
        along, gram = precision @ part.along, (precision[:, None, None] * part.gram).sum(axis=1)
        inner = np.eye(len(deviation)) + deviation[:, None] * gram * deviation
        left = deviation[:, None] * np.linalg.inv(inner) * deviation
        solved = (left @ along[..., None])[..., 0]
        total += part.count * logs[:sensors].sum() + 0.5 * (precision @ part.squares - (along * solved).sum())
        total += 0.5 * np.linalg.slogdet(inner)[1].sum()
        # S' times what the inverse makes of v; of each sensor's part, what the joints explain of its squares and its variance.
        rest = along - (gram @ solved[..., None])[..., 0]
        explained = 2.0 * (part.along @ solved[..., None])[..., 0]
        explained -= ((part.gram @ solved[:, None, :, None])[..., 0] * solved[:, None]).sum(axis=2)
        explained -= (left[:, None] * part.gram).sum(axis=(2, 3))
        slope[:sensors] += part.count + precision * (explained.sum(axis=0) - part.squares)
        variance = np.diagonal(gram, axis1=1, axis2=2) - (gram * (gram @ left)).sum(axis=2)
        slope[sensors:] += deviation**2 * (variance - rest**2).sum(axis=0)
    return total, slope
