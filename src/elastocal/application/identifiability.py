"""Errors of a robot that a set-up without a tracker cannot see, and the rows that would.

A frame, a tool or a feature that is fitted follows some errors of the robot exactly. An
error that they follow leaves no residual, whatever its size: it is in the null space of
the design. Each error is tested by itself, at the size of a usual tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.counting import list_first
from elastocal.fitting.features import evaluate_channels
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    evaluate_conditions,
    find_placement_parameters,
    list_parameters,
    place_in_session,
    predict,
)
from elastocal.fitting.normal_equations import compute_whitening
from elastocal.fitting.sensor_noise import compute_sensor_roots
from elastocal.measuring.protocol import span_plane

if TYPE_CHECKING:
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

# Sizes of the errors that are tested: a millimetre, a milliradian, and a thousandth of
# all lengths.
_SIZE = 1e-3
# An error of this size is seen if it is so many standard errors, which a test at 1 %
# finds with a probability of two thirds.
_SEEN = 3.0
# Columns that are this small against the others after projection are rounding.
_RANK_ROUNDING = 1e-9
_MOST_NAMED = 6
# Distance of two sockets, m, that a gauge or a printed tool has.
_PAIR_M = 0.05
_PAIR = "two sockets whose distance is known"
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
    """Rows of R numbers, whitened: columns of what is fitted beside the robot, and of
    the errors of the robot by name."""

    fitted: np.ndarray
    errors: Mapping[str, np.ndarray]

    def count_std_errors(self) -> dict[str, float]:
        """Size of each error in standard errors, after what is fitted has followed."""
        left, values, _ = np.linalg.svd(self.fitted, full_matrices=False)
        basis = left[:, values > _RANK_ROUNDING * values.max(initial=1.0)]
        sizes = {}
        for name, column in self.errors.items():
            remaining = column - basis @ (basis.T @ column)
            sizes[name] = float(np.linalg.norm(remaining))
        return sizes

    def join(self, other: _Rows) -> _Rows:
        """Join other rows, which have further fitted columns of their own."""
        own = self.fitted.shape[1]
        fitted = np.zeros((len(self.fitted) + len(other.fitted), other.fitted.shape[1]))
        fitted[: len(self.fitted), :own] = self.fitted
        fitted[len(self.fitted) :] = other.fitted
        errors = {
            name: np.concatenate([column, other.errors[name]])
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
    rows = _whiten_rows(model, estimate, observations, fitted)
    unseen = [name for name, size in rows.count_std_errors().items() if size < _SEEN]
    if not unseen:
        return []
    further = _list_further_rows(model, estimate, observations, fitted)
    found = {
        remedy: rows.join(_pad_fitted(extra, rows)).count_std_errors()
        for remedy, extra in further.items()
    }
    return [Unseen(name, _find_remedy(name, found)) for name in unseen]


def _find_remedy(name: str, found: Mapping[str, Mapping[str, float]]) -> str:
    """Find the first further rows that show an error, by what each of them makes of it;
    empty if none does. Only a distance shows a scale without the base."""
    for remedy, sizes in found.items():
        is_of_scale = (remedy == _PAIR) == (name == _SCALE) or remedy == _KNOWN
        if is_of_scale and sizes[name] >= _SEEN:
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
            others = [name for name in names if name not in _BASE_ERRORS]
            names = ["where the base stands and how it is turned", *others]
        listed = list_first(names, _MOST_NAMED)
        cure = f"{remedy} would show it"
        if not remedy:
            cure = "no further contact of this target shows it"
        sentences.append(f"these measurements cannot see {listed}: {cure}")
    return sentences


def predict_tip_error(fitted: Fit, observations: Observations) -> float | None:
    """Predict the RMS error of the target's position, m, that the fit leaves.

    It comes from the parameter covariance of the robot at the fitted poses, after the
    best placement of base and tool, which no row of features determines. A parameter
    that is not identified has its plausible size, or its prior. None if the model has no
    parameter of the robot.
    """
    model = replace(fitted.model, measuring=None, shaped_noise=None, rows=3)
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


def _as_positions(observations: Observations) -> Observations:
    """The same observations as if positions had been measured."""
    return replace(
        observations,
        position=np.zeros((len(observations), 3)),
        rotation=None,
        channel=None,
        spread=None,
    )


def _move_base(position: np.ndarray) -> np.ndarray:
    """Motion (M, 3, 6) of positions (M, 3) if the base is shifted or turned."""
    turns = np.cross(np.eye(3), position[:, None]).transpose(0, 2, 1)
    shifts = np.tile(np.eye(3), (len(position), 1, 1))
    return np.concatenate([shifts, turns], axis=2)


def _move_robot(
    model: Model, estimate: Estimate, observations: Observations
) -> dict[str, np.ndarray]:
    """Motion (M, 6) of the targets by each error of the robot at its size."""
    plain = _as_positions(observations)
    turned = replace(plain, rotation=np.tile(np.eye(3), (len(plain), 1, 1)))
    poses = replace(model, measuring=None, shaped_noise=None, rows=6)
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
    model: Model, estimate: Estimate, observations: Observations, fitted: Fit
) -> _Rows:
    """Rows of the campaign, with the priors of what is fitted beside the robot."""
    conditions = evaluate_conditions(model, estimate, observations.states)
    linear = linearize(model, estimate, observations, conditions)
    roots = compute_sensor_roots(model, estimate, observations, fitted.noise)
    whitening = compute_whitening(
        observations, linear.joint_jacobian, fitted.noise.without_pose_error, roots
    )
    by_pose = np.tile(np.eye(observations.rows, 6), (len(observations), 1, 1))
    if model.measuring is not None:
        poses = predict(model, estimate, observations, conditions)
        placed = place_in_session(estimate, observations, *poses)
        by_pose = evaluate_channels(
            model.measuring, observations, placed, estimate.features
        ).by_pose
    columns = whitening.apply(linear.sensitivities)
    parameters = [parameter for _, parameter in list_parameters(model, estimate)]
    priors = np.diag([1.0 / p.prior_std if p.prior_std else 0.0 for p in parameters])
    width = len(parameters)
    errors = {}
    for name, motion in _move_robot(model, estimate, observations).items():
        moved = (by_pose @ motion[..., None])[..., 0]
        white = whitening.apply(moved).ravel()
        errors[name] = np.concatenate([white, np.zeros(width)])
    return _Rows(np.vstack([columns.reshape(-1, width), priors]), errors)


def _pad_fitted(extra: _Rows, rows: _Rows) -> _Rows:
    """Put columns of unknowns of further rows behind those that the rows have."""
    missing = rows.fitted.shape[1] - extra.fitted.shape[1]
    if missing <= 0:
        return extra
    return replace(extra, fitted=np.pad(extra.fitted, ((0, 0), (0, missing))))


def _list_further_rows(
    model: Model, estimate: Estimate, observations: Observations, fitted: Fit
) -> dict[str, _Rows]:
    """Further rows, by what a user would add, cheapest first."""
    plain = _as_positions(observations)
    positions = replace(model, measuring=None, shaped_noise=None, rows=3)
    bare = replace(estimate, features=())
    conditions = evaluate_conditions(positions, bare, plain.states)
    owners = [owner for owner, _ in list_parameters(positions, bare)]
    further = _FurtherRows(
        predict(positions, bare, plain, conditions)[0],
        linearize(positions, bare, plain, conditions).sensitivities,
        len(list_parameters(model, estimate)) - len(owners),
        _move_robot(model, estimate, observations),
        fitted.noise.position_m,
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
    """What further rows share with those of a campaign.

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
        """Rows in two sockets, which are anywhere; only their distance is known."""
        count = len(self.position)
        places = _PAIR_M * np.eye(3)[np.arange(count) % 2]
        shifts = np.tile(np.eye(3), (count, 1, 1))
        turns = _move_base(places)[..., 3:]
        unknowns = np.concatenate([shifts, turns], axis=2)
        scaled = replace(self, motions={**self.motions, _SCALE: _SIZE * places})
        return scaled._make(np.eye(3), unknowns)

    def on_plane(self, normal: np.ndarray) -> _Rows:
        """Rows on a plane with a normal (3,) that is known only roughly."""
        tilts = self.position @ span_plane(normal).T
        unknowns = np.column_stack([tilts, np.ones(len(tilts))])[:, None]
        return self._make(normal[None], unknowns)

    def at_known_places(self) -> _Rows:
        """Rows at places that are known in the base frame."""
        return self._make(np.eye(3), np.zeros((len(self.position), 3, 0)))

    def _make(self, directions: np.ndarray, unknowns: np.ndarray) -> _Rows:
        """Rows along directions (r, 3), with own unknowns (M, r, k), whitened."""
        count = len(self.position) * len(directions)
        along = (directions @ self.shared).reshape(count, -1)
        # Features of the campaign come between shared and own columns.
        between = np.zeros((count, self.features))
        fitted = np.hstack([along, between, unknowns.reshape(count, -1)])
        errors = {
            name: (motion[:, :3] @ directions.T).ravel() / self.noise_m
            for name, motion in self.motions.items()
        }
        return _Rows(fitted / self.noise_m, errors)
