"""A diagnosis as files, and back: the only writer and the only reader of its tables."""

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
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import Estimate, build_case, list_parameters
from elastocal.fitting.noise import parse_noise, serialize_noise
from elastocal.io.json_files import read_json, write_json
from elastocal.io.origin import describe_provenance
from elastocal.io.storage import read_table, write_table
from elastocal.io.typed_json import from_document
from elastocal.loop.schemas import STEPS, measurements
from elastocal.mechanics.robot_file import parse_robot
from elastocal.random_streams import open_stream
from elastocal.verdict import TrainingVerdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from elastocal.diagnosis.verdict import Evidence
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Model


# Parts of an estimate in diagnosis.json: arrays, and an array for each effect.
_PLACEMENTS = ("frame_rotation", "frame_position", "target_offset", "target_rotation")
_OF_EFFECTS = ("coefficients", "shapes")


def diagnose_campaign(job: Any) -> None:
    """The step of a rule: what the training poses say, and the next experiment."""
    # Who reads the tables of a diagnosis starts without pandas.
    import pandas as pd

    from elastocal.io.data_frames import write_csv

    case = load_case(job.input.descriptions, job.input.training)
    name = job.wildcards.campaign
    seed = job.params.seed
    found = diagnose(
        case,
        Settings(),
        seed,
        lambda line: print(f"{name}: {line}", file=sys.stderr, flush=True),
    )
    columns, proposal = propose_experiment(
        found,
        open_stream(seed, case.campaign.name, "next experiment", 0),
        job.params.states,
    )
    write_csv(job.output.experiment, pd.DataFrame(columns))
    found = replace(found, verdict=replace(found.verdict, next_experiment=proposal))
    write_csv(job.output.candidates, pd.DataFrame(candidate_rows(found)))
    write_json(
        job.output.diagnosis,
        diagnosis_facts(found) | {"covariance": found.final.covariance.tolist()},
    )
    write_table(
        job.output.steps,
        STEPS,
        step_blocks(found),
        describe_provenance(job.params, **job.wildcards),
    )


def load_case(
    descriptions_path: str | Path,
    measurements_path: str | Path,
    part: str | None = None,
) -> Case:
    """A campaign from the files of step 1; `part` is the campaign that holds the test,
    where it is another one."""
    descriptions = read_json(descriptions_path)
    described = (part and descriptions[part]) or descriptions
    joints = parse_robot(described["robot"], described["source"]).joints
    return build_case(described, read_table(measurements_path, measurements(joints)))


def step_blocks(diagnosis: Diagnosis) -> Iterator[dict[str, np.ndarray | list[str]]]:
    """Blocks of the steps table."""
    for number, step in enumerate(diagnosis.steps):
        yield {
            "step": np.full(len(step.fitted.unidentifiable), number),
            **parameter_columns(step.fitted),
        }


def diagnosis_facts(diagnosis: Diagnosis) -> dict[str, Any]:
    """What diagnosis.json holds: of each step its model, with the priors under which it
    was fitted, and its estimate."""
    return {
        "document": diagnosis.document,
        "steps": [_step_facts(step) for step in diagnosis.steps],
    }


def _step_facts(step: Step) -> dict[str, Any]:
    """Return model, priors and estimate of a step, as diagnosis.json has them."""
    effects = step.fitted.model.effects
    estimate = step.fitted.estimate
    stated: dict[str, Any] = {"sessions": [int(entry) for entry in estimate.sessions]}
    for name in _PLACEMENTS:
        stated[name] = getattr(estimate, name).tolist()
    for name in _OF_EFFECTS:
        stated[name] = _list_arrays(getattr(estimate, name))
    return {
        "name": step.name,
        "kind": step.kind,
        "noise": serialize_noise(step.fitted.noise),
        "effects": [effect.key for effect in effects],
        "priors": [_list_priors(effect) for effect in effects],
        "estimate": stated,
    }


def _list_arrays(arrays: Iterable[np.ndarray]) -> list[list[float]]:
    return [values.tolist() for values in arrays]


def _list_priors(effect: Candidate) -> list[float | None]:
    return [parameter.prior_std for parameter in effect.parameters]


def final_parameters(
    facts: Mapping[str, Any], columns: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Parameters of the final model, (N,): `columns` of the steps table, of the last
    step of diagnosis.json, `facts`."""
    return {
        name: values[columns["step"] == len(facts["steps"]) - 1]
        for name, values in columns.items()
    }


def diagnosis_from(case: Case, facts: Mapping[str, Any]) -> Diagnosis:
    """A diagnosis from diagnosis.json, `facts`; without the evidence, which only
    training poses have.

    `case`: of the training poses.
    """
    measurements = case.campaign.measurements
    left_out = rows_left_out(case, facts)
    case = case.select(~left_out)
    steps = tuple(
        Step(step["name"], step["kind"], step_fit(case, step))
        for step in facts["steps"]
    )
    return Diagnosis(
        case,
        steps,
        None,
        from_document(TrainingVerdict, facts["document"], "diagnosis.json"),
        measurements.select(left_out),
        Settings.from_document(facts["document"]["settings"]),
    )


def rows_left_out(case: Case, facts: Mapping[str, Any]) -> np.ndarray:
    """Which measurements of the training poses a diagnosis left out as gross errors,
    ndarray of bool (N,)."""
    left_out = [
        row for entry in facts["document"]["gross_errors"] for row in entry["rows"]
    ]
    return np.isin(case.campaign.measurements.row, left_out)


def step_fit(case: Case, step: Mapping[str, Any]) -> Fit:
    """The fit of one step of diagnosis.json; it starts where it once ended."""
    model, estimate = step_model(case, step)
    return fit_model(model, case.observations, parse_noise(step), estimate)


def step_model(case: Case, step: Mapping[str, Any]) -> tuple[Model, Estimate]:
    """Return model and estimate of one step of diagnosis.json, without a fit."""
    catalogue = {effect.key: effect for effect in case.model.effects} | case.candidates
    effects = []
    for key, priors in zip(step["effects"], step["priors"], strict=True):
        effect = catalogue[key]
        # A prior that differs from the catalogue's is one whose size was estimated.
        parameters = tuple(
            replace(parameter, prior_std=prior, sized=prior != parameter.prior_std)
            for parameter, prior in zip(effect.parameters, priors, strict=True)
        )
        effects.append(replace(effect, parameters=parameters))
    stated = step["estimate"]
    values: dict[str, Any] = {}
    for name in _PLACEMENTS:
        values[name] = np.array(stated[name], float)
    for name in _OF_EFFECTS:
        values[name] = tuple(np.array(entry, float) for entry in stated[name])
    model = replace(case.model, effects=tuple(effects))
    return model, Estimate(tuple(stated["sessions"]), **values)


def candidate_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the rows of candidates.csv.

    Tested candidates come first, by falling Bayes factor, then the others with a note
    why they were not tested. ``log_bayes_factor`` is that of the candidate alone against
    the declared model, averaged over its size; ``probability`` is that of being in the
    model; ``chosen`` says whether the most probable model contains it.
    """
    candidates = diagnosis.case.candidates
    rows = []
    untestable = dict.fromkeys(candidates, "the measurements are at fault")
    if diagnosis.evidence:
        rows = _tested_candidate_rows(diagnosis.evidence)
        untestable = diagnosis.evidence.linearized.untestable
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


def _tested_candidate_rows(evidence: Evidence) -> list[dict[str, Any]]:
    """Return the rows of the candidates that were tested, by falling Bayes factor."""
    problem = evidence.linearized.problem
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


def parameter_columns(fitted: Fit) -> dict[str, np.ndarray | list[str]]:
    """Columns of the parameters table of a fit."""
    named = list_parameters(fitted.model, fitted.estimate)
    return {
        "owner": [owner for owner, _ in named],
        "parameter": [parameter.name for _, parameter in named],
        "unit": [parameter.unit for _, parameter in named],
        "value": _absolute_values(fitted.model, fitted.estimate),
        "std_error": np.sqrt(np.diag(fitted.covariance)),
        "held": fitted.unidentifiable,
        "prior_std": np.array(
            [np.nan if p.prior_std is None else p.prior_std for _, p in named]
        ),
    }


def _absolute_values(model: Model, estimate: Estimate) -> np.ndarray:
    parts = []
    if model.fitted_frames:
        for shift, turn in zip(
            estimate.frame_position, estimate.frame_rotation, strict=True
        ):
            parts += [shift, Rotation.from_matrix(turn).as_rotvec()]
    for number, fitted in model.fitted_target_components:
        turn = Rotation.from_matrix(estimate.target_rotation[number]).as_rotvec()
        parts.append(np.concatenate([estimate.target_offset[number], turn])[fitted])
    effects = [
        part
        for pair in zip(estimate.coefficients, estimate.shapes, strict=True)
        for part in pair
    ]
    return np.concatenate([*parts, *effects]) if parts or effects else np.zeros(0)
