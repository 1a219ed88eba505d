"""Write a diagnosis to files and restore it from them: this module alone knows the
layout of diagnosis.json, of the steps table and of candidates.csv."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.diagnosis.diagnose import Diagnosis, Step, diagnose
from elastocal.diagnosis.next_experiment import propose_experiment
from elastocal.diagnosis.search import screen_terms
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.cases import build_case
from elastocal.fitting.features import state_features
from elastocal.fitting.least_squares import IterationOptions, fit_robustly
from elastocal.fitting.model import (
    Estimate,
    build_nominal_model,
    list_parameters,
)
from elastocal.fitting.noise import parse_noise, serialize_noise
from elastocal.fitting.stored_models import restore_model, serialize_model
from elastocal.io.json_files import read_json, write_json
from elastocal.io.origin import describe_provenance
from elastocal.io.storage import read_table, write_table
from elastocal.io.typed_json import from_document
from elastocal.loop.schemas import MEASUREMENTS, STEPS
from elastocal.mechanics.robot_file import parse_robot
from elastocal.random_streams import open_stream
from elastocal.verdict import TrainingVerdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from elastocal.diagnosis.next_experiment import Table
    from elastocal.diagnosis.verdict import Evidence
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Model


def diagnose_campaign(job: Any) -> None:
    """Diagnose the training poses and propose the next experiment. Called by a rule of
    the workflow."""
    # Import pandas only here, because restoring a diagnosis does not need it.
    import pandas as pd

    from elastocal.io.data_frames import write_csv

    case = load_case(job.input.descriptions, job.input.training)
    name = job.wildcards.campaign
    seed = job.params.seed
    diagnosis, experiment = diagnose_with_proposal(
        case,
        seed,
        job.params.states,
        lambda line: print(f"{name}: {line}", file=sys.stderr, flush=True),
    )
    write_csv(job.output.experiment, pd.DataFrame(experiment))
    write_csv(job.output.candidates, pd.DataFrame(tabulate_candidates(diagnosis)))
    covariance = diagnosis.final.covariance.tolist()
    write_json(
        job.output.diagnosis,
        serialize_diagnosis(diagnosis) | {"covariance": covariance},
    )
    write_table(
        job.output.steps,
        STEPS,
        generate_step_blocks(diagnosis),
        describe_provenance(job.params, **job.wildcards),
    )


def diagnose_with_proposal(
    case: Case, seed: int, states: int, report_progress: Callable[[str], None]
) -> tuple[Diagnosis, Table]:
    """Diagnose the training poses and propose the next experiment.

    Parameters
    ----------
    case : Case
        Training poses.
    seed : int
        Seed of all random streams.
    states : int
        Number of proposed poses.
    report_progress : callable
        Takes a line on each stage of the diagnosis.

    Returns
    -------
    diagnosis : Diagnosis
        Its verdict contains a summary of the proposal.
    experiment : Table
        Columns of the proposed poses, see `propose_experiment`.
    """
    diagnosis = diagnose(case, Settings(), seed, report_progress)
    stream = open_stream(seed, case.campaign.name, "next experiment", 0)
    experiment, proposal = propose_experiment(diagnosis, stream, states)
    verdict = replace(diagnosis.verdict, next_experiment=proposal)
    return replace(diagnosis, verdict=verdict), experiment


def load_case(
    descriptions_path: str | Path,
    measurements_path: str | Path,
    validation_key: str | None = None,
) -> Case:
    """Load a campaign from the files that step 1 has written.

    Parameters
    ----------
    descriptions_path : str or path
        campaign.json.
    measurements_path : str or path
        Table of training or held-out measurements.
    validation_key : str, optional
        Key of campaign.json with the campaign that validates this one. If it has none,
        the measurements belong to the campaign itself.
    """
    descriptions = read_json(descriptions_path)
    described = descriptions
    if validation_key is not None and descriptions[validation_key]:
        described = descriptions[validation_key]
    joints = parse_robot(described["robot"], described["source"]).joints
    schema = MEASUREMENTS.for_joints(joints)
    return build_case(described, read_table(measurements_path, schema))


def generate_step_blocks(
    diagnosis: Diagnosis,
) -> Iterator[dict[str, np.ndarray | list[str]]]:
    """Generate the blocks of the steps table, one for each model."""
    for number, step in enumerate(diagnosis.steps):
        yield {
            "step": np.full(len(step.fitted.unidentifiable), number),
            **tabulate_parameters(step.fitted),
        }


def serialize_diagnosis(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the contents of diagnosis.json: the training verdict, and for each step its
    model, its estimate and the priors under which it was fitted."""
    return {
        "document": diagnosis.document,
        "steps": [_serialize_step(step) for step in diagnosis.steps],
    }


def _serialize_step(step: Step) -> dict[str, Any]:
    return {
        "name": step.name,
        "kind": step.kind,
        "noise": serialize_noise(step.fitted.noise),
        **serialize_model(step.fitted.model, step.fitted.estimate),
    }


def select_final_parameters(
    facts: Mapping[str, Any], columns: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Select the parameters of the final model.

    Parameters
    ----------
    facts : mapping
        Contents of diagnosis.json.
    columns : mapping of (N,) arrays
        Columns of the steps table.
    """
    is_final = columns["step"] == len(facts["steps"]) - 1
    return {name: values[is_final] for name, values in columns.items()}


def restore_diagnosis(case: Case, facts: Mapping[str, Any]) -> Diagnosis:
    """Restore a diagnosis from its file, without the evidence, which is not stored.

    Parameters
    ----------
    case : Case
        All training poses.
    facts : mapping
        Contents of diagnosis.json.
    """
    measurements = case.campaign.measurements
    is_rejected = find_rejected_rows(case, facts)
    kept_case = case.select(~is_rejected)
    steps = tuple(
        Step(step["name"], step["kind"], refit_step(kept_case, step))
        for step in facts["steps"]
    )
    document = facts["document"]
    return Diagnosis(
        kept_case,
        steps,
        None,
        from_document(TrainingVerdict, document, "diagnosis.json"),
        measurements.select(is_rejected),
        Settings.from_document(document["settings"]),
    )


def find_rejected_rows(case: Case, facts: Mapping[str, Any]) -> np.ndarray:
    """Find the training measurements (N,) that a diagnosis rejected as gross errors."""
    rejected = [
        row for entry in facts["document"]["gross_errors"] for row in entry["rows"]
    ]
    return np.isin(case.campaign.measurements.row, rejected)


def refit_step(case: Case, step: Mapping[str, Any]) -> Fit:
    """Fit the model of a step of diagnosis.json again, starting at its estimate.

    All observations are fitted from the first step on. Fits to samples, with which
    `fit_model` starts, would only lead away from an estimate that has converged.
    """
    model, estimate = restore_step_model(case, step)
    options = IterationOptions(reweight_first_step=True)
    return fit_robustly(model, case.observations, parse_noise(step), estimate, options)


def restore_step_model(case: Case, step: Mapping[str, Any]) -> tuple[Model, Estimate]:
    """Restore model and estimate of a step of diagnosis.json without a fit."""
    catalogue = {effect.key: effect for effect in case.model.effects} | case.candidates
    model, estimate = restore_model(case.model, catalogue, step)
    if step["kind"] in ("frames", "kept"):
        model = build_nominal_model(model)
    return model, estimate


def tabulate_candidates(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the rows of candidates.csv.

    Tested candidates come first, by falling Bayes factor, then the others with a note
    why they were not tested. ``log_bayes_factor`` compares the model with this
    candidate alone to the declared model, averaged over its size; ``probability`` is its
    posterior inclusion probability; ``chosen`` says whether the most probable model contains it.
    """
    candidates = diagnosis.case.candidates
    rows = []
    untestable = dict.fromkeys(candidates, "the measurements are at fault")
    if diagnosis.evidence:
        rows = _tabulate_tested_candidates(diagnosis.evidence)
        untestable = diagnosis.evidence.design.untestable
    tested = {row["candidate"] for row in rows}
    for key, candidate in candidates.items():
        if key not in tested:
            rows.append(
                {
                    "candidate": candidate.key,
                    "family": candidate.family,
                    "shape": None,
                    "log_bayes_factor": None,
                    "probability": None,
                    "chosen": False,
                    "note": untestable[key],
                }
            )
    return rows


def _tabulate_tested_candidates(evidence: Evidence) -> list[dict[str, Any]]:
    """Return the rows of the candidates that were tested, by falling Bayes factor."""
    problem = evidence.design.problem
    posterior = evidence.posterior
    log_bayes_factors = screen_terms(problem)[1]
    inclusion = np.zeros(len(problem.terms))
    for model, probability in zip(
        posterior.models, posterior.probabilities, strict=True
    ):
        inclusion[list(model.term_indices)] += probability
    best = evidence.conclusion.best
    chosen = set(posterior.models[best.model].term_indices) if best.named else set()
    rows = []
    for index in np.argsort(-log_bayes_factors):
        term = problem.terms[index]
        if term.candidate:
            rows.append(
                {
                    "candidate": term.candidate.key,
                    "family": term.candidate.family,
                    "shape": term.shapes[0] if term.shapes else None,
                    "log_bayes_factor": log_bayes_factors[index],
                    "probability": inclusion[index],
                    "chosen": index in chosen,
                    "note": "",
                }
            )
    return rows


def tabulate_parameters(fitted: Fit) -> dict[str, np.ndarray | list[str]]:
    """Return the columns of the steps table for the parameters of one fit."""
    owners = []
    parameters = []
    for owner, parameter in list_parameters(fitted.model, fitted.estimate):
        owners.append(owner)
        parameters.append(parameter)
    prior_std = [parameter.prior_std for parameter in parameters]
    return {
        "owner": owners,
        "parameter": [parameter.name for parameter in parameters],
        "unit": [parameter.unit for parameter in parameters],
        "value": _stack_values(fitted.model, fitted.estimate),
        "std_error": np.sqrt(np.diag(fitted.covariance)),
        "held": fitted.unidentifiable,
        # A missing prior becomes NaN.
        "prior_std": np.array(prior_std, float),
    }


def _stack_values(model: Model, estimate: Estimate) -> np.ndarray:
    """Return the values of all parameters (P,), in the order of `list_parameters`;
    placements are absolute."""
    values = [np.zeros(0)]
    if model.has_frame_parameters:
        for position, rotation in zip(
            estimate.frame_position, estimate.frame_rotation, strict=True
        ):
            values += [position, Rotation.from_matrix(rotation).as_rotvec()]
    for target, fitted in model.fitted_target_components:
        rotation_vector = Rotation.from_matrix(
            estimate.target_rotation[target]
        ).as_rotvec()
        placement = np.concatenate([estimate.target_offset[target], rotation_vector])
        values.append(placement[fitted])
    values += state_features(model.fitted_features, estimate.features)
    for pair in zip(estimate.coefficients, estimate.shapes, strict=True):
        values += pair
    return np.concatenate(values)
