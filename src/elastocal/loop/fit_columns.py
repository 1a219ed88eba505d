"""Fits to columns of tables and back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.fitting.model import Estimate
from elastocal.fitting.parameters import parameters

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Model


def parameter_columns(fitted: Fit) -> dict[str, np.ndarray | list[str]]:
    """Columns of the parameters table of a fit."""
    named = parameters(fitted.model, fitted.estimate)
    return {
        "owner": [owner for owner, _ in named],
        "parameter": [parameter.name for _, parameter in named],
        "unit": [parameter.unit for _, parameter in named],
        "value": _absolute_values(fitted.model, fitted.estimate),
        "std_error": np.sqrt(np.diag(fitted.covariance)),
        "held": fitted.held,
        "prior_std": np.array([np.nan if p.prior_std is None else p.prior_std for _, p in named]),
    }


def correlation_columns(fitted: Fit) -> dict[str, np.ndarray | list[str]]:
    """Columns of the correlations table of a fit: every pair of parameters that are not held."""
    named = [f"{owner} {parameter.name}" for owner, parameter in parameters(fitted.model, fitted.estimate)]
    free = np.flatnonzero(~fitted.held)
    deviation = np.sqrt(np.diag(fitted.covariance))[free]
    correlation = fitted.covariance[np.ix_(free, free)] / np.outer(deviation, deviation)
    rows, columns = np.tril_indices(len(free), -1)
    return {
        "one": [named[free[row]] for row in rows],
        "other": [named[free[column]] for column in columns],
        "correlation": correlation[rows, columns],
    }


def covariance_from(parameters: Mapping[str, np.ndarray], correlations: Mapping[str, np.ndarray]) -> np.ndarray:
    """The covariance of a fit from its tables, the inverse of `parameter_columns` and `correlation_columns`.

    `parameters`, `correlations`: columns of one fit. Returns (P, P): zero where held.
    """
    names = [f"{owner} {parameter}" for owner, parameter in zip(parameters["owner"], parameters["parameter"], strict=True)]
    place = {name: number for number, name in enumerate(names)}
    deviation = np.where(parameters["held"], 0.0, parameters["std_error"])
    correlation = np.eye(len(names))
    for one, other, value in zip(correlations["one"], correlations["other"], correlations["correlation"], strict=True):
        correlation[place[one], place[other]] = correlation[place[other], place[one]] = value
    return correlation * np.outer(deviation, deviation)


def estimate_from(columns: Mapping[str, np.ndarray], model: Model, sessions: Collection[int]) -> Estimate:
    """The estimate of a model from the columns of its parameters.

    `columns` (N,).
    """
    values = {(o, p): v for o, p, v in zip(columns["owner"], columns["parameter"], columns["value"], strict=True)}

    def placed(owner: str, *stated: Sequence[float] | None) -> tuple[list[float], np.ndarray]:
        shift, turn = (
            [values.get((owner, name), missing) for name, missing in zip(names, each or (0.0, 0.0, 0.0), strict=True)]
            for names, each in zip((("dx", "dy", "dz"), ("rx", "ry", "rz")), stated, strict=True)
        )
        return shift, Rotation.from_rotvec(turn).as_matrix()

    frames = [placed(f"frame {session}", None, None) for session in sessions]
    targets = [placed(f"target {target.name}", target.offset_m, target.rotation) for target in model.targets]
    return Estimate(
        tuple(int(session) for session in sessions),
        np.array([turn for _, turn in frames]),
        np.array([shift for shift, _ in frames]),
        np.array([shift for shift, _ in targets]),
        np.array([turn for _, turn in targets]),
        tuple(np.array([values[effect.key, p.name] for p in effect.parameters]) for effect in model.effects),
        tuple(np.array([values[effect.key, s.name] for s in effect.shapes]) for effect in model.effects),
    )


def _absolute_values(model: Model, estimate: Estimate) -> np.ndarray:
    parts = []
    if model.fitted_frames:
        for shift, turn in zip(estimate.frame_position, estimate.frame_rotation, strict=True):
            parts += [shift, Rotation.from_matrix(turn).as_rotvec()]
    for number, fitted in model.fitted_parts:
        turn = Rotation.from_matrix(estimate.target_rotation[number]).as_rotvec()
        parts.append(np.concatenate([estimate.target_offset[number], turn])[fitted])
    effects = [part for pair in zip(estimate.coefficients, estimate.shapes, strict=True) for part in pair]
    return np.concatenate([*parts, *effects]) if parts or effects else np.zeros(0)
