"""The evidence of a diagnosis as a document: the whitened columns and the models from
which its probabilities follow. The audit computes the probabilities from them again."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.effects.catalogue import list_effects

if TYPE_CHECKING:
    from elastocal.diagnosis.hypotheses import ModelTerm
    from elastocal.diagnosis.search import ScoredModel
    from elastocal.diagnosis.verdict import Evidence
    from elastocal.fitting.model import Case


def trace_evidence(case: Case, seed: int) -> dict[str, object]:
    """Diagnose a case once more and describe its evidence.

    Parameters
    ----------
    case : training measurements of a campaign
    seed : int
        Seed of the diagnosis.

    Returns
    -------
    dict
        Whitened residual and columns, priors, terms and models with their log odds;
        empty if the data are at fault.
    """
    evidence = diagnose(case, Settings(), seed).evidence
    return _serialize_evidence(evidence) if evidence else {}


def _serialize_evidence(evidence: Evidence) -> dict[str, object]:
    """Describe the columns of all terms that some stated model has, and the models."""
    problem = evidence.design.problem
    posterior = evidence.posterior
    used = sorted(set().union(*(model.term_indices for model in posterior.models)))
    terms = [problem.terms[index] for index in used]
    is_used = np.zeros(problem.statistics.gram.shape[1], bool)
    for term in terms:
        is_used[term.columns] = True
    slots = {term.slot for term in problem.terms}
    rows = evidence.design.rows
    candidates = rows.candidates.select_columns(is_used).dense()
    prior_std, present = evidence.design.priors
    used_columns = np.flatnonzero(is_used).tolist()
    new_column = {column: index for index, column in enumerate(used_columns)}
    return {
        "settings": vars(problem.settings),
        "effects": len(list_effects()),
        "locations": Counter(mechanism for mechanism, *_ in slots),
        "pose_error_rad": problem.statistics.pose_error_rad.tolist(),
        "degrees_of_freedom": problem.statistics.degrees_of_freedom,
        "pose": np.repeat(rows.pose, rows.residual.shape[1]).tolist(),
        "residual": rows.residual.ravel().tolist(),
        "jacobian": _list_rows(rows.jacobian),
        "declared": _list_rows(rows.declared),
        "candidates": _list_rows(candidates),
        "prior_std": prior_std.tolist(),
        "present": present.tolist(),
        "terms": [_serialize_term(term, new_column) for term in terms],
        "models": [_serialize_model(model, used) for model in posterior.models],
    }


def _serialize_model(model: ScoredModel, used: list[int]) -> dict[str, object]:
    """Describe a model; `used` are the indices of the described terms."""
    return {
        "terms": [used.index(index) for index in model.term_indices],
        "scales": model.scales.tolist(),
        "pose_error_rad": model.pose_error_rad,
        "log_odds": model.log_odds,
    }


def _serialize_term(term: ModelTerm, new_column: dict[int, int]) -> dict[str, object]:
    """Describe a term; `new_column` has the described columns by those of the
    problem."""
    return {
        "mechanism": term.mechanism,
        "columns": [new_column[column] for column in term.columns.tolist()],
        "signs": term.signs.tolist(),
        "log_prior": term.log_prior,
        "smallest": term.smallest,
        "largest": term.largest,
    }


def _list_rows(values: np.ndarray) -> list[list[float]]:
    """List the rows of an array (M, rows, K) as (M * rows, K)."""
    return values.reshape(-1, values.shape[2]).tolist()
