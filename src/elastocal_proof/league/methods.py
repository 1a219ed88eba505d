"""Methods of the league on the same folds: a physical model, and perhaps a regression
on what it leaves of poses not seen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.campaign import (
    Measurements,
    build_measurements,
    tabulate_measurements,
)
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.holdout import (
    list_poses,
    number_configurations,
    partition_poses,
)
from elastocal.diagnosis.diagnose import Diagnosis, diagnose
from elastocal.diagnosis.model_averaging import compute_explained_squares
from elastocal.diagnosis.settings import Settings
from elastocal.errors import InputError
from elastocal.fitting.least_squares import Fit
from elastocal.fitting.model import Case, build_case
from elastocal.fitting.noise import estimate_noise, fit_declared_model
from elastocal.io.json_files import read_json, write_json
from elastocal.io.origin import describe_provenance
from elastocal.io.storage import read_table, write_table
from elastocal.loop.diagnosis_tables import refit_step, serialize_diagnosis
from elastocal.loop.loading import read_described_campaign
from elastocal.loop.schemas import build_measurements_schema
from elastocal.mechanics.robot_file import parse_robot
from elastocal.random_streams import open_stream
from elastocal.residual_model.regressions import REGRESSIONS
from elastocal.residual_model.selection import validate_residual_model
from elastocal.validation.held_out import compute_position_residuals
from elastocal.validation.transfer import transfer_fit
from elastocal_proof.league.schemas import ENTRIES, FOLDS, MECHANISMS

Columns = Mapping[str, np.ndarray]
RANDOM = "random"
BLOCKS = "blocks"
SESSION = "session"
FRAMES = "frames"
GEOMETRY = "geometry"
DIAGNOSIS = "diagnosis"


@dataclass(frozen=True)
class DataSet:
    """A data set as its tables hold it: descriptions of the campaign, columns of all
    measurements (N,), and `dealt` (P,)."""

    descriptions: Mapping[str, Any]
    columns: Columns
    dealt: Columns

    def case(self, chosen: np.ndarray | slice = slice(None)) -> Case:
        """A case of some of the measurements, or of all."""
        return build_case(
            self.descriptions,
            {name: values[chosen] for name, values in self.columns.items()},
        )


@dataclass(frozen=True)
class Method:
    """A method of the league.

    `physics`: what is fitted first: frames and targets alone; what the campaign
    declares too, such as geometry; or what a diagnosis of the training poses finds.
    `regression`: of `remainder`, fitted to what that leaves. `within_range`: whether it
    is left out where a pose lies outside the range of those fitted. `words`: what
    tables and pictures call the method.
    """

    physics: str
    regression: str | None = None
    within_range: bool = False
    words: str = ""


def load_data_set(
    descriptions_path: str | Path, measurements_path: str | Path, folds_path: str | Path
) -> DataSet:
    """Read a data set from files as `deal_league_folds` wrote them."""
    descriptions = read_json(descriptions_path)
    joints = parse_robot(descriptions["robot"], descriptions["source"]).joints
    return DataSet(
        descriptions,
        read_table(measurements_path, build_measurements_schema(joints)),
        read_table(folds_path, FOLDS),
    )


def deal_folds(
    seen: Measurements, count: int, draws: np.random.Generator
) -> dict[str, np.ndarray]:
    """Columns (P,) of poses dealt into folds from 1, those of a configuration into one,
    at random and by blocks of joint space.

    Random folds have neighbours among the poses fitted, so they ask how well a method
    interpolates; blocks of joint space ask how well it extrapolates [1].

    [1] Roberts, D. R. et al., Cross-validation strategies for data with temporal, spatial, hierarchical, or phylogenetic
        structure, Ecography 40, 2017.
    """
    pairs, index = list_poses(seen)
    configuration = number_configurations(seen.joint_angles, index)
    shuffled = draws.permutation(configuration.max() + 1)[configuration] % count + 1
    blocks = partition_poses(seen.joint_angles, index, count) + 1
    return {
        "session": pairs[:, 0],
        "pose": pairs[:, 1],
        RANDOM: shuffled,
        BLOCKS: blocks,
    }


def split_rounds(
    split: str, data: DataSet, others: Sequence[DataSet] = ()
) -> Iterator[tuple[int, Case, list[Case]]]:
    """Number, from 1, training poses, and held-out poses of each fold; of `SESSION`
    these are the robot's other data sets."""
    if split == SESSION:
        yield 1, data.case(), [other.case() for other in others]
        return
    fold = np.asarray(data.dealt[split])[
        list_poses(build_measurements(data.columns))[1]
    ]
    for number in np.unique(fold):
        yield int(number), data.case(fold != number), [data.case(fold == number)]


def parse_method(described: Mapping[str, Any], name: str, source: str) -> Method:
    """A method as a configuration describes it. Raises `InputError`: a regression that
    the catalogue does not have."""
    method = Method(**described)
    if method.regression is not None and method.regression not in REGRESSIONS:
        raise InputError(
            source,
            f"league.methods.{name}.regression",
            repr(method.regression),
            ", ".join(REGRESSIONS),
        )
    return method


def fit_physics(physics: str, case: Case) -> Fit:
    """Fit frames, or what the campaign declares, to training poses."""
    model = replace(case.model, effects=()) if physics == FRAMES else case.model
    return fit_declared_model(model, case.observations, estimate_noise(case)[0])


def predict_held_out(
    method: Method, fitted: Fit, case: Case, held_out: Case, split: str, seed: int
) -> dict[str, np.ndarray]:
    """Columns (M,) of what a method, fitted to the poses of a case, predicts of
    held-out ones.

    A regression is tuned within the training poses by the same kind of split that
    judges, see `residual_model.selection`; frames and targets of another campaign are fitted
    to it, whatever the method. What a method does not state is not a number.
    """
    seen = held_out.observations
    std = None
    if method.regression is None:
        residual = compute_position_residuals(
            *transfer_fit(fitted, case, held_out), seen
        )
    else:
        blocks = split != RANDOM
        within_range = method.within_range
        found = validate_residual_model(
            fitted,
            case,
            held_out,
            method.regression,
            blocks=blocks,
            within_range=within_range,
            seed=seed,
        )
        residual = found.residual
        std = found.std
    columns = {
        name: getattr(seen.states, name)[seen.state]
        for name in ("session", "pose", "load")
    }
    columns["target"] = seen.target
    for head, values in (
        ("d", residual),
        ("std_", np.full_like(residual, np.nan) if std is None else std),
    ):
        columns |= {
            f"{head}{axis}": values[:, number] for number, axis in enumerate("xyz")
        }
    return columns


def tabulate_mechanisms(
    diagnosis: Diagnosis, fold: int
) -> dict[str, np.ndarray | list[str]]:
    """Columns of the mechanisms table (K,) of one fold; none where the data are at
    fault.

    The share of a mechanism is the sum of squares that it displaces the measurements
    by, beyond what geometry and frames take up, over that of the residual which these
    leave, in units of the noise. Mechanisms that resemble each other share it.
    """
    mechanisms: Mapping[str, float] = {}
    shares: list[float] = []
    if evidence := diagnosis.evidence:
        mechanisms = evidence.conclusion.mechanisms
        best = evidence.conclusion.best
        problem = evidence.design.problem
        explained = (
            compute_explained_squares(problem, evidence.posterior.models[best.model])
            if best.named
            else {}
        )
        shares = [
            explained.get(name, 0.0) / float(problem.statistics.residual_squares[0])
            for name in mechanisms
        ]
    columns: dict[str, np.ndarray | list[str]] = {
        "fold": np.full(len(mechanisms), fold),
        "mechanism": [*mechanisms],
    }
    return columns | {
        "probability": np.array([*mechanisms.values()], float),
        "share": np.array(shares, float),
    }


def deal_league_folds(job: Any) -> None:
    """A data set of the league, checked, with its poses dealt into folds."""
    descriptions, campaign = read_described_campaign(
        read_campaign_folder(job.params.folder, job.params.robots)
    )
    seen = campaign.measurements
    origin = describe_provenance(job.params, **job.wildcards)
    draws = open_stream(job.params.seed, job.wildcards.data, "league folds", 0)
    write_table(
        job.output.measurements,
        build_measurements_schema(seen.joint_angles.shape[1]),
        [tabulate_measurements(seen)],
        origin,
    )
    write_table(
        job.output.folds, FOLDS, [deal_folds(seen, job.params.folds, draws)], origin
    )
    write_json(job.output.descriptions, descriptions)


def diagnose_league_folds(job: Any) -> None:
    """What the training poses of each fold lack, by the whole diagnosis: its last step
    and the mechanisms."""
    data = load_data_set(
        job.input.descriptions, job.input.measurements, job.input.folds
    )
    facts = {}
    mechanisms = []
    for fold, training, _ in split_rounds(job.wildcards.split, data):
        found = diagnose(training, Settings(), job.params.seed)
        facts[str(fold)] = serialize_diagnosis(found)["steps"][-1]
        mechanisms.append(tabulate_mechanisms(found, fold))
    write_json(job.output.facts, facts)
    write_table(
        job.output.mechanisms,
        MECHANISMS,
        mechanisms,
        describe_provenance(job.params, **job.wildcards),
    )


def enter_league(job: Any) -> None:
    """What one method predicts of the poses of each fold, which it has not seen."""
    split = job.wildcards.split
    method = parse_method(job.params.method, job.wildcards.method, "config.yaml")
    steps = read_json(job.input.facts) if method.physics == DIAGNOSIS else {}
    data, *others = map(
        load_data_set, job.input.descriptions, job.input.measurements, job.input.folds
    )
    blocks = []
    for fold, training, tests in split_rounds(split, data, others):
        fitted = (
            refit_step(training, steps[str(fold)])
            if steps
            else fit_physics(method.physics, training)
        )
        for number, held_out in enumerate(tests, 1 if others else 0):
            columns = predict_held_out(
                method, fitted, training, held_out, split, job.params.seed
            )
            count = len(columns["pose"])
            blocks.append(
                {"fold": np.full(count, fold), "set": np.full(count, number)} | columns
            )
    write_table(
        job.output.entries,
        ENTRIES,
        blocks,
        describe_provenance(job.params, **job.wildcards),
    )
