"""Diagnose a campaign once more and write the whitened columns and the models from which
its probabilities follow: for the audit, which computes them from these."""

from collections import Counter

from job import Job, run

import numpy as np

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.hypotheses import ModelTerm
from elastocal.diagnosis.search import ScoredModel
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import Evidence
from elastocal.effects.catalogue import list_effects
from elastocal.io.json_files import write_json
from elastocal.loop.diagnosis_tables import load_case


def trace_evidence(job: Job) -> None:
    case = load_case(job.input.descriptions, job.input.training)
    evidence = diagnose(case, Settings(), job.params.seed).evidence
    write_json(job.output.evidence, _serialize(evidence) if evidence else {})


def _serialize(evidence: Evidence) -> dict[str, object]:
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
    number = {column: n for n, column in enumerate(np.flatnonzero(is_used).tolist())}
    return {
        "settings": vars(problem.settings),
        "effects": len(list_effects()),
        "locations": Counter(mechanism for mechanism, *_ in slots),
        "pose_error_rad": problem.statistics.pose_error_rad.tolist(),
        "degrees_of_freedom": problem.statistics.degrees_of_freedom,
        "pose": np.repeat(rows.pose, rows.residual.shape[1]).tolist(),
        "residual": rows.residual.ravel().tolist(),
        "jacobian": _flatten(rows.jacobian),
        "declared": _flatten(rows.declared),
        "candidates": _flatten(candidates),
        "prior_std": prior_std.tolist(),
        "present": present.tolist(),
        "terms": [_serialize_term(term, number) for term in terms],
        "models": [_serialize_model(model, used) for model in posterior.models],
    }


def _serialize_model(model: ScoredModel, used: list[int]) -> dict[str, object]:
    return {
        "terms": [used.index(index) for index in model.term_indices],
        "scales": model.scales.tolist(),
        "pose_error_rad": model.pose_error_rad,
        "log_odds": model.log_odds,
    }


def _serialize_term(term: ModelTerm, number: dict[int, int]) -> dict[str, object]:
    return {
        "mechanism": term.mechanism,
        "columns": [number[column] for column in term.columns.tolist()],
        "signs": term.signs.tolist(),
        "log_prior": term.log_prior,
        "smallest": term.smallest,
        "largest": term.largest,
    }


def _flatten(values: np.ndarray) -> list[list[float]]:
    """Return the rows of an array (M, rows, K) as (M * rows, K)."""
    return values.reshape(-1, values.shape[2]).tolist()


run(trace_evidence, snakemake)
