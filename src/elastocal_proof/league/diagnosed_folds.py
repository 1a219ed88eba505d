"""Diagnoses of the folds as files, and the fit of each fold back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.loop.diagnosis_tables import diagnosis_facts, step_fit
from elastocal.loop.fit_columns import parameter_columns
from elastocal_proof.league.methods import DIAGNOSIS, fitted_physics

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.fitting.case import Case
    from elastocal.fitting.fit_result import Fit
    from elastocal_proof.league.methods import Method

# Of the steps of a diagnosis only the last is kept.
_KEPT = 0


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
