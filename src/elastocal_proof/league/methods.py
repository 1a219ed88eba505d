"""Fit the methods of the benchmark to the same folds: a physical model, and optionally
a regression of its residual, which predict the held-out poses."""

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
from elastocal.fitting.cases import build_case
from elastocal.fitting.least_squares import Fit
from elastocal.fitting.model import (
    Case,
)
from elastocal.fitting.noise import estimate_noise, fit_declared_model
from elastocal.io.documents import Document
from elastocal.io.json_files import read_json, write_json
from elastocal.io.origin import describe_provenance
from elastocal.io.storage import Columns, read_table, write_table
from elastocal.loop.diagnosis_tables import refit_step, serialize_diagnosis
from elastocal.loop.loading import read_described_campaign
from elastocal.loop.schemas import MEASUREMENTS
from elastocal.mechanics.robot_file import parse_robot
from elastocal.random_streams import open_stream
from elastocal.residual_model.regressions import REGRESSIONS
from elastocal.residual_model.selection import (
    ResidualModelPlan,
    validate_residual_model,
)
from elastocal.validation.held_out import compute_position_residuals
from elastocal.validation.transfer import transfer_fit
from elastocal_proof.league.schemas import ENTRIES, FOLDS, MECHANISMS

# Splits: held-out poses are drawn at random, are a block of joint space, or are those
# of another session of the same robot.
RANDOM = "random"
BLOCKS = "blocks"
SESSION = "session"
# Physical models, see `Method`.
FRAMES = "frames"
GEOMETRY = "geometry"
DIAGNOSIS = "diagnosis"


@dataclass(frozen=True)
class DataSet:
    """A data set of the benchmark as its tables hold it.

    Attributes
    ----------
    descriptions
        Descriptions of robot and campaign.
    columns
        Columns (N,) of all measurements.
    folds
        Columns (P,) of `deal_folds`.
    """

    descriptions: Document
    columns: Columns
    folds: Columns

    def build_case(self, chosen: np.ndarray | slice = slice(None)) -> Case:
        """Build a case of the chosen measurements, by default of all."""
        columns = {name: values[chosen] for name, values in self.columns.items()}
        return build_case(self.descriptions, columns)


@dataclass(frozen=True)
class Method:
    """A method of the benchmark.

    Attributes
    ----------
    physics
        Model that is fitted first: "frames" and targets alone; "geometry" and
        everything else that the campaign declares; or the model that a "diagnosis" of
        the training poses finds.
    regression
        Of `residual_model`, fitted to the residual of the physical model.
    within_range
        Whether the regression is not applied to poses outside the range of the training
        poses.
    words
        Name of the method in tables and figures.
    """

    physics: str
    regression: str | None = None
    within_range: bool = False
    words: str = ""


def load_data_set(
    descriptions_path: str | Path, measurements_path: str | Path, folds_path: str | Path
) -> DataSet:
    """Read a data set from the files of `deal_league_folds`."""
    descriptions = read_json(descriptions_path)
    joints = parse_robot(descriptions["robot"], descriptions["source"]).joints
    return DataSet(
        descriptions,
        read_table(measurements_path, MEASUREMENTS.for_joints(joints)),
        read_table(folds_path, FOLDS),
    )


def deal_folds(
    measured: Measurements, count: int, draws: np.random.Generator
) -> dict[str, np.ndarray]:
    """Deal P poses into folds from 1, at random and by blocks of joint space.

    Poses of the same configuration belong to the same fold. Random folds have
    neighbours among the training poses, so they test interpolation; blocks of joint
    space test extrapolation [1]_.

    Parameters
    ----------
    measured
        All measurements.
    count
        Number of folds.
    draws
        Random numbers.

    References
    ----------
    .. [1] Roberts, D. R. et al., Cross-validation strategies for data with temporal,
       spatial, hierarchical, or phylogenetic structure, Ecography 40, 2017.
    """
    poses, index = list_poses(measured)
    configuration = number_configurations(measured.joint_angles, index)
    shuffled = draws.permutation(configuration.max() + 1)[configuration]
    return {
        "session": poses[:, 0],
        "pose": poses[:, 1],
        RANDOM: shuffled % count + 1,
        BLOCKS: partition_poses(measured.joint_angles, index, count) + 1,
    }


def split_rounds(
    split: str, data: DataSet, other_sessions: Sequence[DataSet] = ()
) -> Iterator[tuple[int, Case, list[Case]]]:
    """Yield number, from 1, training poses, and held-out poses of each fold.

    With `SESSION`, the only fold has all poses for training, and the held-out ones are
    the robot's other data sets.
    """
    if split == SESSION:
        yield 1, data.build_case(), [session.build_case() for session in other_sessions]
        return
    pose = list_poses(build_measurements(data.columns))[1]
    fold = np.asarray(data.folds[split])[pose]
    for number in np.unique(fold):
        held_out = data.build_case(fold == number)
        yield int(number), data.build_case(fold != number), [held_out]


def parse_method(description: Document, name: str, source: str) -> Method:
    """Parse a method of a configuration.

    Parameters
    ----------
    description
        Fields of `Method`.
    name, source
        Name of the method, and of the configuration, for errors.

    Raises
    ------
    InputError
        If the catalogue has no such regression.
    """
    method = Method(**description)
    if method.regression is not None and method.regression not in REGRESSIONS:
        raise InputError(
            source,
            f"league.methods.{name}.regression",
            repr(method.regression),
            ", ".join(REGRESSIONS),
        )
    return method


def fit_physics(physics: str, case: Case) -> Fit:
    """Fit frames, or the declared model of the campaign, to training poses."""
    model = replace(case.model, effects=()) if physics == FRAMES else case.model
    return fit_declared_model(model, case.observations, estimate_noise(case)[0])


def predict_held_out(
    method: Method, fitted: Fit, case: Case, held_out: Case, split: str, seed: int
) -> dict[str, np.ndarray]:
    """Predict held-out poses by a method and tabulate its residuals.

    A regression is tuned within the training poses by a split of the same kind, see
    `residual_model.selection`. Frames and targets of another campaign are fitted to it,
    whatever the method.

    Parameters
    ----------
    method, fitted
        Method, and the fit of its physical model.
    case, held_out
        Training and held-out poses.
    split, seed
        Kind of the split, and seed of the regression.

    Returns
    -------
    Columns (M,) of the entries table; standard deviations are NaN if the method states
    none.
    """
    observed = held_out.observations
    std = None
    if method.regression is None:
        model, estimate = transfer_fit(fitted, case, held_out)
        residual = compute_position_residuals(model, estimate, observed)
    else:
        plan = ResidualModelPlan(
            method.regression,
            blocks=split != RANDOM,
            within_range=method.within_range,
            seed=seed,
        )
        prediction = validate_residual_model(fitted, case, held_out, plan)
        residual = prediction.residual
        std = prediction.std
    if std is None:
        std = np.full_like(residual, np.nan)
    columns = {
        name: getattr(observed.states, name)[observed.state]
        for name in ("session", "pose", "load")
    }
    columns["target"] = observed.target
    for prefix, values in (("d", residual), ("std_", std)):
        columns |= {f"{prefix}{axis}": values[:, k] for k, axis in enumerate("xyz")}
    return columns


def tabulate_mechanisms(
    diagnosis: Diagnosis, fold: int
) -> dict[str, np.ndarray | list[str]]:
    """Tabulate the K mechanisms that the diagnosis of a fold found.

    The share of a mechanism is the sum of squares of its contribution to the
    measurements, beyond geometry and frames, divided by that of the residual of
    geometry and frames, in units of the noise. Similar mechanisms share it. If the data
    are at fault, there are no mechanisms.
    """
    mechanisms: Mapping[str, float] = {}
    shares: list[float] = []
    if evidence := diagnosis.evidence:
        mechanisms = evidence.conclusion.mechanisms
        best = evidence.conclusion.best
        problem = evidence.design.problem
        explained: Mapping[str, float] = {}
        if best.named:
            best_model = evidence.posterior.models[best.model]
            explained = compute_explained_squares(problem, best_model)
        residual_squares = float(problem.statistics.residual_squares[0])
        shares = [explained.get(name, 0.0) / residual_squares for name in mechanisms]
    return {
        "fold": np.full(len(mechanisms), fold),
        "mechanism": [*mechanisms],
        "probability": np.array([*mechanisms.values()], float),
        "share": np.array(shares, float),
    }


def deal_league_folds(job: Any) -> None:
    """Check a data set of the benchmark and deal its poses into folds."""
    descriptions, campaign = read_described_campaign(
        read_campaign_folder(job.params.folder, job.params.robots)
    )
    measured = campaign.measurements
    origin = describe_provenance(job.params, **job.wildcards)
    draws = open_stream(job.params.seed, job.wildcards.data, "league folds", 0)
    folds = deal_folds(measured, job.params.folds, draws)
    schema = MEASUREMENTS.for_joints(measured.joint_angles.shape[1])
    columns = tabulate_measurements(measured)
    write_table(job.output.measurements, schema, [columns], origin)
    write_table(job.output.folds, FOLDS, [folds], origin)
    write_json(job.output.descriptions, descriptions)


def diagnose_league_folds(job: Any) -> None:
    """Diagnose the training poses of each fold; keep the last step and the
    mechanisms."""
    data = load_data_set(
        job.input.descriptions, job.input.measurements, job.input.folds
    )
    facts = {}
    mechanisms = []
    for fold, training, _ in split_rounds(job.wildcards.split, data):
        diagnosis = diagnose(training, Settings(), job.params.seed)
        facts[str(fold)] = serialize_diagnosis(diagnosis)["steps"][-1]
        mechanisms.append(tabulate_mechanisms(diagnosis, fold))
    origin = describe_provenance(job.params, **job.wildcards)
    write_json(job.output.facts, facts)
    write_table(job.output.mechanisms, MECHANISMS, mechanisms, origin)


def enter_league(job: Any) -> None:
    """Predict the held-out poses of each fold by one method."""
    split = job.wildcards.split
    method = parse_method(job.params.method, job.wildcards.method, "config.yaml")
    steps = read_json(job.input.facts) if method.physics == DIAGNOSIS else {}
    data, *other_sessions = map(
        load_data_set, job.input.descriptions, job.input.measurements, job.input.folds
    )
    # Number 0 is the data set itself; the other sessions count from 1.
    first_set = 1 if other_sessions else 0
    blocks = []
    for fold, training, tests in split_rounds(split, data, other_sessions):
        if steps:
            fitted = refit_step(training, steps[str(fold)])
        else:
            fitted = fit_physics(method.physics, training)
        for number, held_out in enumerate(tests, first_set):
            columns = predict_held_out(
                method, fitted, training, held_out, split, job.params.seed
            )
            count = len(columns["pose"])
            columns["fold"] = np.full(count, fold)
            columns["set"] = np.full(count, number)
            blocks.append(columns)
    write_table(
        job.output.entries,
        ENTRIES,
        blocks,
        describe_provenance(job.params, **job.wildcards),
    )
