"""A method of the league: a physical model, and perhaps a regression on what it leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.errors import InputError
from elastocal.fitting.tolerances import estimated_noise, fit_declared
from elastocal.remainder.corrected import Plan, corrected, regressions
from elastocal.validation.fitted_range import outside_poses
from elastocal.validation.held_out import position_residuals
from elastocal.validation.placing import placed
from elastocal_proof.league.folds import RANDOM

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.fitting.case import Case
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.observations import Observations
    from elastocal.remainder.protocol import Setting

FRAMES, GEOMETRY, DIAGNOSIS = "frames", "geometry", "diagnosis"


@dataclass(frozen=True)
class Method:
    """A method of the league.

    `physics`: what is fitted first: frames and targets alone; what the campaign declares too, such as geometry; or what a
    diagnosis of the training poses finds. `regression`: name of a regression of `remainder`: fitted to what the physical model
    leaves. `within_range`: whether the regression is left out where a pose lies outside the range of those fitted. `words`:
    what tables and pictures call it.
    """

    physics: str
    regression: str | None = None
    within_range: bool = False
    words: str = ""


@dataclass(frozen=True)
class Entry:
    """What a method predicts of poses that it has not seen; arrays of M.

    `residual` (M, 3): measured less predicted positions, m, base axes. `std` (M, 3): standard deviation that the method states
    for them, m; not a number where it states none. `outside` (M,) of bool: whether the pose lies outside the range of the
    training poses. `setting`: of the regression, as chosen; None without one, or where none helped.
    """

    observations: Observations
    residual: np.ndarray
    std: np.ndarray
    outside: np.ndarray
    setting: Setting | None


def method_from(described: Mapping[str, Any], name: str, source: str) -> Method:
    """A method as a configuration describes it.

    `described`: ``physics`` and perhaps ``regression`` and ``within_range``. `name`, `source`: named in errors. Raises
    `InputError`: a regression that the catalogue does not have.
    """
    method = Method(**described)
    if method.regression is not None and method.regression not in regressions():
        allowed = ", ".join(regressions())
        raise InputError(source, f"league.methods.{name}.regression", repr(method.regression), allowed)
    return method


def fitted_physics(physics: str, case: Case) -> Fit:
    """Fit frames, or what the campaign declares, to training poses.

    `physics`: one of "frames", "geometry".
    """
    model = replace(case.model, effects=()) if physics == FRAMES else case.model
    return fit_declared(model, case.observations, estimated_noise(case)[0])


def entered(method: Method, fitted: Fit, case: Case, held_out: Case, split: str, seed: int) -> Entry:
    """Predict held-out poses.

    A regression is tuned by the same kind of split that judges, within the training poses, see `remainder.corrected`. Poses of
    another campaign have their frames and targets fitted to them, whatever the method.

    `fitted`: its physical model, fitted to the training poses. `case`: of the training poses. `split`: one of `folds.SPLITS`.
    """
    beyond = outside_poses(fitted, case, held_out)
    if method.regression is not None:
        plan = Plan(method.regression, blocks=split != RANDOM, within_range=method.within_range, seed=seed)
        found = corrected(plan, fitted, case, held_out, beyond)
        std = np.full_like(found.residual, np.nan) if found.std is None else found.std
        return Entry(held_out.observations, found.residual, std, found.outside, found.chosen.setting)
    there = held_out.observations
    residual = position_residuals(*placed(fitted, case, held_out), there)
    return Entry(there, residual, np.full_like(residual, np.nan), beyond[there.cluster], None)
