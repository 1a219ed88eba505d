"""What the league keeps of a fold, as columns of its tables: entries, the diagnosis, its mechanisms; and its fit back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.averaging import squares_explained
from elastocal.loop.diagnosis_tables import diagnosis_facts, parameter_columns, step_fit
from elastocal_proof.league.methods import DIAGNOSIS, fitted_physics

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.fitting.case import Case
    from elastocal.fitting.fit_result import Fit
    from elastocal_proof.league.methods import Entry, Method

# Of the steps of a diagnosis only the last is kept.
_KEPT = 0


def entry_columns(entry: Entry, fold: int, other: int) -> dict[str, np.ndarray]:
    """Columns of the entries table (M,) of one fold, from 1.

    `other`: number of the other data set that is the test, from 1; 0 where it is a part of the same.
    """
    seen, states = entry.observations, entry.observations.states
    columns = {"fold": np.full(len(seen), fold), "set": np.full(len(seen), other)}
    columns |= {name: getattr(states, name)[seen.state] for name in ("session", "pose", "load")}
    columns |= {"target": seen.target, "outside_range": entry.outside}
    columns |= {f"d{axis}": entry.residual[:, number] for number, axis in enumerate("xyz")}
    return columns | {f"std_{axis}": entry.std[:, number] for number, axis in enumerate("xyz")}


def fold_facts(diagnosis: Diagnosis) -> dict[str, Any]:
    """What diagnoses.json holds of one fold: as diagnosis.json, with the last step alone."""
    facts = diagnosis_facts(diagnosis)
    return facts | {"steps": facts["steps"][-1:]}


def fold_fits(diagnosis: Diagnosis, fold: int) -> dict[str, np.ndarray | list[str]]:
    """Columns of the fits table, of the final model of one fold."""
    columns = parameter_columns(diagnosis.final)
    count = len(columns["value"])
    return {"fold": np.full(count, fold), "step": np.full(count, _KEPT), **columns}


def physics_of_fold(
    method: Method, training: Case, facts: Mapping[str, Any] | None, fits: Mapping[str, np.ndarray] | None, fold: int
) -> Fit:
    """The physical model of a method, fitted to the training poses of a fold, or as its diagnosis left it.

    `facts`: contents of diagnoses.json, for a method that needs a diagnosis. `fits`: columns of the fits table, likewise.
    """
    if method.physics != DIAGNOSIS or facts is None or fits is None:
        return fitted_physics(method.physics, training)
    mine = fits["fold"] == fold
    return step_fit(training, facts[str(fold)], {name: values[mine] for name, values in fits.items()}, _KEPT)


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
