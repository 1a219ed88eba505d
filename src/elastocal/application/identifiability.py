"""Robot errors that a set-up without a tracker cannot show, and rows that would show them.

Fitted frames, tools and features can compensate some errors of the robot exactly. Such an
error leaves no residual, whatever its size: it is in the null space of the design. Each
error is tested separately, at the size of a usual tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.counting import list_first
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    evaluate_conditions,
    find_placement_parameters,
    list_parameters,
    predict,
    predict_channels,
)
from elastocal.fitting.normal_equations import compute_whitening
from elastocal.fitting.sensor_noise import compute_sensor_roots
from elastocal.measuring.protocol import span_plane
from elastocal.mechanics.kinematics import form_cross_matrices

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

# Sizes of the errors that are tested: a millimetre, a milliradian, and a thousandth of
# all lengths.
_SIZE = 1e-3
# Smallest size of a visible error in standard errors. A test at the 1 % level detects
# it with a probability of two thirds.
_SEEN = 3.0
# Singular values below this share of the largest are rounding errors.
_RANK_ROUNDING = 1e-9
_MOST_NAMED = 6
# Distance of two sockets, m, that a gauge or a printed tool has.
_PAIR_M = 0.05
# A campaign may have such a distance already. Then it is not known well enough: the error
# of its scale has the tested size only if it is `_SEEN` standard deviations.
_PAIR = f"two sockets whose distance is known to {100 * _SIZE / _SEEN:.2f} %"
_KNOWN = "places that are known in the base frame"
_SCALE = "a common scale of all lengths"
_AXES = ("along x", "along y", "along z", "about x", "about y", "about z")
_BASE_ERRORS = tuple(f"where the base stands {axis}" for axis in _AXES)


@dataclass(frozen=True)
class Unseen:
    """An error that the measurements cannot show.

    Attributes
    ----------
    name : the error in words.
    remedy : rows that would show it, in words; empty if none of the tried ones does.
    """

    name: str
    remedy: str


@dataclass(frozen=True)
class _Rows:
    """Whitened design of R numbers.

    Attributes
    ----------
    fitted : (R, F) array, columns of the fitted frames, targets and features.
    errors : (R,) arrays, column of each error of the robot, by its name.
    """

    fitted: np.ndarray
    errors: Mapping[str, np.ndarray]

    def count_std_errors(self) -> dict[str, float]:
        """Size of each error in standard errors, less what the fitted columns explain."""
        vectors, values, _ = np.linalg.svd(self.fitted, full_matrices=False)
        basis = vectors[:, values > _RANK_ROUNDING * values.max(initial=1.0)]
        sizes = {}
        for name, column in self.errors.items():
            remaining = column - basis @ (basis.T @ column)
            sizes[name] = float(np.linalg.norm(remaining))
        return sizes

    def append(self, further: _Rows) -> _Rows:
        """Append further rows, whose fitted columns begin with those of these rows."""
        count, width = self.fitted.shape
        fitted = np.zeros((count + len(further.fitted), further.fitted.shape[1]))
        fitted[:count, :width] = self.fitted
        fitted[count:] = further.fitted
        errors = {
            name: np.concatenate([column, further.errors[name]])
            for name, column in self.errors.items()
        }
        return _Rows(fitted, errors)


def find_unseen_errors(fitted: Fit, observations: Observations) -> list[Unseen]:
    """Find the errors of a robot that its measurements cannot show.

    Parameters
    ----------
    fitted : Fit of the declared model
    observations : Observations that it was fitted to
    """
    model = replace(fitted.model, effects=())
    estimate = replace(fitted.estimate, coefficients=(), shapes=())
    motions = _move_robot(model, estimate, observations)
    rows = _whiten_rows(model, estimate, observations, fitted.noise, motions)
    unseen = [name for name, size in rows.count_std_errors().items() if size < _SEEN]
    if not unseen:
        return []
    remedies = _list_further_rows(model, estimate, observations, fitted.noise, motions)
    sizes_with = {
        remedy: rows.append(_pad_fitted(further, rows)).count_std_errors()
        for remedy, further in remedies.items()
    }
    return [Unseen(name, _find_remedy(name, sizes_with)) for name in unseen]


def _find_remedy(name: str, sizes_with: Mapping[str, Mapping[str, float]]) -> str:
    """Find the first remedy that shows an error; empty if none does.

    `sizes_with` are the sizes of all errors in standard errors, by remedy. Only places
    that are known in the base, and distances between places, show a scale; distances are
    no remedy for any other error.
    """
    for remedy, sizes in sizes_with.items():
        is_suitable = (remedy == _PAIR) == (name == _SCALE) or remedy == _KNOWN
        if is_suitable and sizes[name] >= _SEEN:
            return remedy
    return ""


def describe_unseen_errors(unseen: list[Unseen]) -> list[str]:
    """Describe unseen errors in sentences, one for each remedy."""
    by_remedy: dict[str, list[str]] = {}
    for error in unseen:
        by_remedy.setdefault(error.remedy, []).append(error.name)
    sentences = []
    for remedy, names in by_remedy.items():
        if set(_BASE_ERRORS) <= set(names):
            in_robot = [name for name in names if name not in _BASE_ERRORS]
            names = ["where the base stands and how it is turned", *in_robot]
        listed = list_first(names, _MOST_NAMED)
        cure = f"{remedy} would show it"
        if not remedy:
            cure = "no further contact of this target shows it"
        sentences.append(f"these measurements do not determine {listed}: {cure}")
    return sentences


def predict_tip_error(fitted: Fit, observations: Observations) -> float | None:
    """Predict the RMS error of the target's position, m, that the fit leaves.

    The error follows from the covariance of the robot's parameters at the fitted poses,
    after the best placement of base and tool, which no row of features determines. For a
    parameter that is not identified, its prior or its plausible size replaces the
    standard error. None if the model has no parameter of the robot.
    """
    model = _track_targets(fitted.model, 3)
    estimate = replace(fitted.estimate, features=())
    plain = _as_positions(observations)
    conditions = evaluate_conditions(model, estimate, plain.states)
    owners = [owner for owner, _ in list_parameters(model, estimate)]
    robot = ~find_placement_parameters(owners)
    if not robot.any():
        return None
    columns = linearize(model, estimate, plain, conditions).sensitivities[..., robot]
    position, rotation = predict(model, estimate, plain, conditions)
    placement = np.concatenate([_move_base(position), rotation], axis=2)
    rows = columns.reshape(-1, columns.shape[2])
    basis = np.linalg.qr(placement.reshape(-1, placement.shape[2]))[0]
    rows = rows - basis @ (basis.T @ rows)
    covariance = _complete_covariance(fitted)
    return float(np.sqrt(((rows @ covariance) * rows).sum() / len(plain)))


def _complete_covariance(fitted: Fit) -> np.ndarray:
    """Covariance of the parameters of the robot, with the priors or plausible sizes of
    those that are not identified."""
    robot = ~find_placement_parameters(owner for owner, _ in fitted.parameters)
    covariance = fitted.covariance[np.ix_(robot, robot)].copy()
    sizes = [p.prior_std or p.plausible for _, p in fitted.parameters]
    fixed = np.flatnonzero(fitted.unidentifiable[robot])
    covariance[fixed, fixed] = np.array(sizes)[robot][fixed] ** 2
    return covariance


def _track_targets(model: Model, rows: int) -> Model:
    """Return the model as if a tracker measured positions (3 rows) or poses (6 rows)."""
    return replace(model, measuring=None, shaped_noise=None, rows=rows)


def _as_positions(observations: Observations) -> Observations:
    """Return the observations as if positions had been measured."""
    return replace(
        observations,
        position=np.zeros((len(observations), 3)),
        rotation=None,
        channel=None,
        spread=None,
    )


def _move_base(position: np.ndarray) -> np.ndarray:
    """Motion (M, 3, 6) of positions (M, 3) if the base is shifted or turned."""
    shifts = np.tile(np.eye(3), (len(position), 1, 1))
    return np.concatenate([shifts, -form_cross_matrices(position)], axis=2)


def _move_robot(
    model: Model, estimate: Estimate, observations: Observations
) -> dict[str, np.ndarray]:
    """Motion (M, 6) of the targets by each error of the robot at its size."""
    plain = _as_positions(observations)
    turned = replace(plain, rotation=np.tile(np.eye(3), (len(plain), 1, 1)))
    poses = _track_targets(model, 6)
    conditions = evaluate_conditions(poses, estimate, turned.states)
    linear = linearize(poses, estimate, turned, conditions)
    position, _ = predict(poses, estimate, turned, conditions)
    base = np.concatenate(
        [_move_base(position), np.tile(np.eye(3, 6, 3), (len(position), 1, 1))], axis=1
    )
    motions = {name: base[..., index] for index, name in enumerate(_BASE_ERRORS)}
    for joint in range(model.sites.joints):
        motions[f"the zero of joint {joint + 1}"] = linear.joint_jacobian[..., joint]
    scaled = np.zeros((len(position), 6))
    scaled[:, :3] = position
    motions[_SCALE] = scaled
    return {name: _SIZE * motion for name, motion in motions.items()}


def _whiten_rows(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    noise: Noise,
    motions: Mapping[str, np.ndarray],
) -> _Rows:
    """Whiten the rows of the campaign, and append those of the priors of the parameters.

    Model and estimate have no effects, so the parameters are those of frames, targets
    and features. `motions` (M, 6) move the targets by each error of the robot.
    """
    conditions = evaluate_conditions(model, estimate, observations.states)
    linear = linearize(model, estimate, observations, conditions)
    roots = compute_sensor_roots(model, estimate, observations, noise)
    whitening = compute_whitening(
        observations, linear.joint_jacobian, noise.without_pose_error, roots
    )
    by_pose = _differentiate_by_pose(model, estimate, observations, conditions)
    columns = whitening.apply(linear.sensitivities)
    parameters = [parameter for _, parameter in list_parameters(model, estimate)]
    priors = np.diag([1.0 / p.prior_std if p.prior_std else 0.0 for p in parameters])
    width = len(parameters)
    errors = {}
    for name, motion in motions.items():
        moved = (by_pose @ motion[..., None])[..., 0]
        white = whitening.apply(moved).ravel()
        errors[name] = np.concatenate([white, np.zeros(width)])
    return _Rows(np.vstack([columns.reshape(-1, width), priors]), errors)


def _differentiate_by_pose(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> np.ndarray:
    """Derivative (M, r, 6) of M measurements in the poses of their targets, base axes."""
    if model.measuring is None:
        return np.tile(np.eye(observations.rows, 6), (len(observations), 1, 1))
    poses = predict(model, estimate, observations, conditions)
    return predict_channels(model, estimate, observations, *poses).by_pose


def _pad_fitted(further: _Rows, rows: _Rows) -> _Rows:
    """Append columns of zeros if the further rows have fewer fitted columns."""
    missing = rows.fitted.shape[1] - further.fitted.shape[1]
    if missing <= 0:
        return further
    return replace(further, fitted=np.pad(further.fitted, ((0, 0), (0, missing))))


def _list_further_rows(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    noise: Noise,
    motions: Mapping[str, np.ndarray],
) -> dict[str, _Rows]:
    """List further rows that a user could measure, by their description, cheapest first;
    `motions` (M, 6) move the targets by each error of the robot."""
    plain = _as_positions(observations)
    positions = _track_targets(model, 3)
    bare = replace(estimate, features=())
    conditions = evaluate_conditions(positions, bare, plain.states)
    owners = [owner for owner, _ in list_parameters(positions, bare)]
    further = _FurtherRows(
        predict(positions, bare, plain, conditions)[0],
        linearize(positions, bare, plain, conditions).sensitivities,
        len(list_parameters(model, estimate)) - len(owners),
        motions,
        noise.position_m,
    )
    in_base = np.array([not owner.startswith("frame ") for owner in owners], bool)
    without_frames = replace(further, shared=further.shared * in_base)
    return {
        _PAIR: further.in_pair(),
        "a further plane, level": further.on_plane(np.eye(3)[2]),
        "a further plane, upright": further.on_plane(np.eye(3)[0]),
        "a further plane, upright and across": further.on_plane(np.eye(3)[1]),
        _KNOWN: without_frames.at_known_places(),
    }


@dataclass(frozen=True)
class _FurtherRows:
    """Makes rows at the poses of a campaign, measured in another way.

    Attributes
    ----------
    position : (M, 3) array, m, of the target at the measured poses
    shared : (M, 3, F) array, motion of the target by fitted frames and targets
    features : number of fitted unknowns of the campaign's features
    motions : (M, 6) arrays, motion of the target by each error of the robot
    noise_m : standard deviation of a number
    """

    position: np.ndarray
    shared: np.ndarray
    features: int
    motions: Mapping[str, np.ndarray]
    noise_m: float

    def in_pair(self) -> _Rows:
        """Make rows in two sockets at unknown places, a known distance apart."""
        count = len(self.position)
        places = _PAIR_M * np.eye(3)[np.arange(count) % 2]
        shifts = np.tile(np.eye(3), (count, 1, 1))
        turns = _move_base(places)[..., 3:]
        unknowns = np.concatenate([shifts, turns], axis=2)
        scaled = replace(self, motions={**self.motions, _SCALE: _SIZE * places})
        return scaled._make(np.eye(3), unknowns)

    def on_plane(self, normal: np.ndarray) -> _Rows:
        """Make rows on a plane with a roughly known normal (3,)."""
        tilts = self.position @ span_plane(normal).T
        unknowns = np.column_stack([tilts, np.ones(len(tilts))])[:, None]
        return self._make(normal[None], unknowns)

    def at_known_places(self) -> _Rows:
        """Make rows at places that are known in the base frame."""
        return self._make(np.eye(3), np.zeros((len(self.position), 3, 0)))

    def _make(self, directions: np.ndarray, unknowns: np.ndarray) -> _Rows:
        """Make whitened rows along directions (r, 3), with further unknowns (M, r, k)."""
        count = len(self.position) * len(directions)
        along = (directions @ self.shared).reshape(count, -1)
        # The features of the campaign have the columns between the shared and the further
        # ones.
        between = np.zeros((count, self.features))
        fitted = np.hstack([along, between, unknowns.reshape(count, -1)])
        errors = {
            name: (motion[:, :3] @ directions.T).ravel() / self.noise_m
            for name, motion in self.motions.items()
        }
        return _Rows(fitted / self.noise_m, errors)
