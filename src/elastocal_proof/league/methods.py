"""A method of the league: a physical model, and perhaps a regression on what it leaves; what is kept of each of its folds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.diagnosis.averaging import squares_explained
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.errors import InputError
from elastocal.fitting.tolerances import estimated_noise, fit_declared
from elastocal.io.json_files import read_json, write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import read_table, write_table
from elastocal.loop.diagnosis_tables import diagnosis_facts, parameter_columns, step_fit
from elastocal.remainder.corrected import Plan, corrected, regressions
from elastocal.validation.held_out import position_residuals
from elastocal.validation.placing import outside_poses, placed
from elastocal_proof.league.folds import RANDOM, load_data_set, rounds
from elastocal_proof.league.schemas import ENTRIES, FITS, MECHANISMS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.fitting.observations import Observations
    from elastocal.remainder.protocol import Setting

FRAMES, GEOMETRY, DIAGNOSIS = "frames", "geometry", "diagnosis"
# Of the steps of a diagnosis only the last is kept.
_KEPT = 0


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

    def columns(self, fold: int, other: int) -> dict[str, np.ndarray]:
        """Columns of the entries table (M,) of one fold; `other`: number of the data set that is the test, 0 for the same."""
        seen, states = self.observations, self.observations.states
        columns = {"fold": np.full(len(seen), fold), "set": np.full(len(seen), other)}
        columns |= {name: getattr(states, name)[seen.state] for name in ("session", "pose", "load")}
        columns |= {"target": seen.target, "outside_range": self.outside}
        columns |= {f"d{axis}": self.residual[:, number] for number, axis in enumerate("xyz")}
        return columns | {f"std_{axis}": self.std[:, number] for number, axis in enumerate("xyz")}


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
    """Fit frames, or what the campaign declares, to training poses."""
    model = replace(case.model, effects=()) if physics == FRAMES else case.model
    return fit_declared(model, case.observations, estimated_noise(case)[0])


def entered(method: Method, fitted: Fit, case: Case, held_out: Case, split: str, seed: int) -> Entry:
    """Predict held-out poses.

    A regression is tuned by the same kind of split that judges, within the training poses, see `remainder.corrected`. Poses of
    another campaign have their frames and targets fitted to them, whatever the method.

    `fitted`: its physical model, fitted to the training poses. `case`: of the training poses.
    """
    beyond, there = outside_poses(fitted, case, held_out), held_out.observations
    if method.regression is not None:
        plan = Plan(method.regression, blocks=split != RANDOM, within_range=method.within_range, seed=seed)
        found = corrected(plan, fitted, case, held_out)
        std = np.full_like(found.residual, np.nan) if found.std is None else found.std
        return Entry(there, found.residual, std, beyond[there.cluster], found.chosen.setting)
    residual = position_residuals(*placed(fitted, case, held_out), there)
    return Entry(there, residual, np.full_like(residual, np.nan), beyond[there.cluster], None)


def fold_tables(diagnosis: Diagnosis, fold: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Of one fold: facts, as diagnosis.json with the last step alone, and columns of the fits table."""
    facts, columns = diagnosis_facts(diagnosis), parameter_columns(diagnosis.final)
    count = len(columns["value"])
    return facts | {"steps": facts["steps"][-1:]}, {"fold": np.full(count, fold), "step": np.full(count, _KEPT), **columns}


def fit_of_fold(case: Case, facts: Mapping[str, Any], fits: Mapping[str, np.ndarray], fold: int) -> Fit:
    """The physical model as the diagnosis of a fold left it; `facts`: of all folds by their numbers."""
    mine = fits["fold"] == fold
    return step_fit(case, facts[str(fold)], {name: values[mine] for name, values in fits.items()}, _KEPT)


def mechanism_columns(diagnosis: Diagnosis, fold: int) -> dict[str, np.ndarray | list[str]]:
    """Columns of the mechanisms table (K,) of one fold; none where the data are at fault.

    The share of a mechanism is the sum of squares that it displaces the measurements by, beyond what geometry and frames take
    up, over that of the residual which these leave; all in units of the noise. Mechanisms that resemble each other share, so
    shares need not add up to that of all together.
    """
    mechanisms: Mapping[str, float] = {}
    shares: list[float] = []
    if evidence := diagnosis.evidence:
        mechanisms, best, problem = evidence.conclusion.mechanisms, evidence.conclusion.best, evidence.linearized.problem
        explained = squares_explained(problem, evidence.posterior.models[best.model]) if best.named else {}
        shares = [explained.get(name, 0.0) / float(problem.statistics.squares[0]) for name in mechanisms]
    return {
        "fold": np.full(len(mechanisms), fold),
        "mechanism": [*mechanisms],
        "probability": np.array([*mechanisms.values()], float),
        "share": np.array(shares, float),
    }


def diagnose_league_folds(job: Any) -> None:
    """What the training poses of each fold lack, by the whole diagnosis."""
    data = load_data_set(job.input.descriptions, job.input.measurements, job.input.folds)
    facts, fits, mechanisms = {}, [], []
    for fold, training, _ in rounds(job.wildcards.split, data):
        found = diagnose(training, Settings(), job.params.seed)
        facts[str(fold)], columns = fold_tables(found, fold)
        fits.append(columns)
        mechanisms.append(mechanism_columns(found, fold))
    origin = provenance(job.params, **job.wildcards)
    write_json(job.output.facts, facts)
    write_table(job.output.fits, FITS, fits, origin)
    write_table(job.output.mechanisms, MECHANISMS, mechanisms, origin)


def enter_league(job: Any) -> None:
    """What one method predicts of the poses of each fold, which it has not seen."""
    split, method = job.wildcards.split, method_from(job.params.method, job.wildcards.method, "config.yaml")
    files = zip(job.input.descriptions, job.input.measurements, job.input.folds, strict=True)
    data, *others = (load_data_set(*paths) for paths in files)
    blocks, settings = [], {}
    for fold, training, tests in rounds(split, data, others):
        if method.physics == DIAGNOSIS:
            fitted = fit_of_fold(training, read_json(job.input.facts), read_table(job.input.fits, FITS), fold)
        else:
            fitted = fitted_physics(method.physics, training)
        for number, held_out in enumerate(tests, 1 if others else 0):
            entry = entered(method, fitted, training, held_out, split, job.params.seed)
            blocks.append(entry.columns(fold, number))
            settings[str(fold)] = entry.setting
    write_table(job.output.entries, ENTRIES, blocks, provenance(job.params, chosen=settings, **job.wildcards))
