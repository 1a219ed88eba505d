"""A diagnosis as files, and back: the only writer and the only reader of its tables."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.diagnosis.diagnose import Diagnosis, Step, diagnose
from elastocal.diagnosis.next_experiment import facts_of, propose, table_of
from elastocal.diagnosis.search import initial_screening
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit
from elastocal.fitting.model import Estimate, case_from, parameters
from elastocal.fitting.noise import noise_facts, noise_from
from elastocal.io.json_files import read_json, write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import read_table, write_table
from elastocal.loop.schemas import CANDIDATES, CORRELATIONS, STEPS, measurements
from elastocal.mechanics.robot_file import joint_count
from elastocal.random_streams import stream

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence
    from pathlib import Path

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Model


def diagnose_campaign(job: Any) -> None:
    """The step of a rule: what the training poses say, and the next experiment."""
    # Who reads the tables of a diagnosis starts without pandas.
    from elastocal.io.data_frames import write_csv

    case = load_case(job.input.descriptions, job.input.training)
    name, seed = job.wildcards.campaign, job.params.seed
    found = diagnose(case, Settings(), seed, lambda line: print(f"{name}: {line}", file=sys.stderr, flush=True))
    robot, draws = case.campaign.robot, stream(seed, case.campaign.name, "next experiment", 0)
    proposal = propose(found, robot.joint_limits, Settings(), draws, job.params.states)
    write_csv(job.output.experiment, table_of(proposal, robot))
    found = replace(found, document=found.document | {"next_experiment": facts_of(proposal)})
    write_json(job.output.diagnosis, diagnosis_facts(found))
    origin = provenance(job.params, **job.wildcards)
    write_table(job.output.steps, STEPS, step_blocks(found), origin)
    write_table(job.output.correlations, CORRELATIONS, [correlation_columns(found.final)], origin)
    write_table(job.output.candidates, CANDIDATES, [candidate_columns(found)], origin)


def load_case(descriptions_path: str | Path, measurements_path: str | Path, part: str | None = None) -> Case:
    """A campaign from the files of step 1; `part` is the campaign that holds the test, where it is another one."""
    descriptions = read_json(descriptions_path)
    described = (part and descriptions[part]) or descriptions
    joints = joint_count(described["robot"], described["source"])
    return case_from(described, read_table(measurements_path, measurements(joints)))


def step_blocks(diagnosis: Diagnosis) -> Iterator[dict[str, np.ndarray | list[str]]]:
    """Blocks of the steps table."""
    for number, step in enumerate(diagnosis.steps):
        columns = parameter_columns(step.fitted)
        yield {"step": np.full(len(columns["value"]), number), **columns}


def diagnosis_facts(diagnosis: Diagnosis) -> dict[str, Any]:
    """What diagnosis.json holds."""
    fits = [(step, step.fitted.model.effects) for step in diagnosis.steps]
    steps = [
        {"name": s.name, "kind": s.kind, "noise": noise_facts(s.fitted.noise), "effects": [effect.key for effect in effects]}
        for s, effects in fits
    ]
    return {"document": diagnosis.document, "steps": steps}


def final_parameters(facts: Mapping[str, Any], columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Parameters of the final model.

    `facts`: of diagnosis.json. `columns` (N,): of the steps table. Returns (N,): columns of the steps table, of the last step.
    """
    last = len(facts["steps"]) - 1
    return {name: values[columns["step"] == last] for name, values in columns.items()}


def diagnosis_from(case: Case, facts: Mapping[str, Any], columns: Mapping[str, np.ndarray]) -> Diagnosis:
    """A diagnosis from diagnosis.json and its steps table; without the evidence, which only training poses have.

    `case`: of the training poses. `facts`: of `diagnosis_facts`. `columns` (N,): of the steps table.
    """
    measurements, left_out = case.campaign.measurements, rows_left_out(case, facts)
    case = case.select(~left_out)
    steps = [
        Step(step["name"], step["kind"], step_fit(case, facts, columns, number)) for number, step in enumerate(facts["steps"])
    ]
    return Diagnosis(case, tuple(steps), None, facts["document"], measurements.select(left_out))


def rows_left_out(case: Case, facts: Mapping[str, Any]) -> np.ndarray:
    """Which measurements of the training poses a diagnosis left out as gross errors, ndarray of bool (N,)."""
    left_out = [row for entry in facts["document"]["gross_errors"] for row in entry["rows"]]
    return np.isin(case.campaign.measurements.row, left_out)


def step_fit(case: Case, facts: Mapping[str, Any], columns: Mapping[str, np.ndarray], number: int) -> Fit:
    """The fit of one step; it starts where it once ended.

    `case`, `facts`, `columns`: as in `diagnosis_from`. `number`: of the step, from 0.
    """
    model, estimate = step_model(case, facts, columns, number)
    return fit(model, case.observations, noise_from({"noise": facts["steps"][number]["noise"]}), estimate)


def step_model(case: Case, facts: Mapping[str, Any], columns: Mapping[str, np.ndarray], number: int) -> tuple[Model, Estimate]:
    """Model and estimate of one step, without fitting it again.

    `case`, `facts`, `columns`: as in `diagnosis_from`. `number`: of the step, from 0. Returns `model`: with the priors under
    which it was fitted.
    """
    mine = {name: values[columns["step"] == number] for name, values in columns.items()}
    known = {effect.key: effect for effect in case.model.effects} | case.candidates
    effects = tuple(_with_priors(known[key], mine) for key in facts["steps"][number]["effects"])
    model = replace(case.model, effects=effects)
    return model, estimate_from(mine, model, np.unique(case.observations.states.session))


def candidate_columns(diagnosis: Diagnosis) -> dict[str, list[Any]]:
    """Columns of the candidates table: those tested by falling Bayes factor, then the others with the reason."""
    evidence, candidates = diagnosis.evidence, diagnosis.case.candidates
    rows: list[tuple[Any, ...]] = []
    untestable = dict.fromkeys(candidates, "the measurements are at fault")
    if evidence:
        problem, untestable = evidence.linearized.problem, evidence.linearized.untestable
        factors = initial_screening(problem)[1]
        inclusion = np.zeros(len(problem.units))
        for model, probability in zip(evidence.posterior.models, evidence.posterior.probabilities, strict=True):
            inclusion[list(model.units)] += probability
        best = evidence.conclusion.best
        chosen = set(evidence.posterior.models[best.model].units) if best.named else set()
        for number in np.argsort(-factors):
            unit = problem.units[number]
            if unit.candidate:
                shape = unit.shapes[0] if unit.shapes else np.nan
                rows.append((unit.candidate, shape, factors[number], inclusion[number], number in chosen, ""))
    tested = {row[0].key for row in rows}
    rows += [(candidates[key], np.nan, np.nan, np.nan, False, untestable[key]) for key in candidates if key not in tested]
    listed = [
        (each.key, each.effect, each.family, "+".join(map(str, each.joints)), shape, len(each.parameters), *figures)
        for each, shape, *figures in rows
    ]
    return {column.name: [row[place] for row in listed] for place, column in enumerate(CANDIDATES.columns)}


def _with_priors(effect: Candidate, columns: Mapping[str, np.ndarray]) -> Candidate:
    """An effect with the priors under which it was fitted."""
    mine = columns["owner"] == effect.key
    prior = dict(zip(columns["parameter"][mine], columns["prior_std"][mine], strict=True))
    priors = [None if np.isnan(prior[p.name]) else float(prior[p.name]) for p in effect.parameters]
    # A prior that the catalogue does not have is one whose size was estimated.
    parameters = tuple(
        replace(p, prior_std=deviation, sized=deviation != p.prior_std)
        for p, deviation in zip(effect.parameters, priors, strict=True)
    )
    return replace(effect, parameters=parameters)


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
