"""The whole calibrated model in one JSON file.

The file has two parts. Other programs evaluate `ModelFile.kinematics`, the terms of its
effects and its regression: chain, springs, weights and effects as explicit formulas, see
`effects.formulas`. This package restores the robot from `ModelFile.fit` and
`ModelFile.robot`, with the covariance, the fitted states and the verdict, so that it
predicts and bounds errors as after the diagnosis. docs/model_file.md states the format.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal import __version__
from elastocal.application.calibrated import CampaignFit, ResidualModel
from elastocal.application.scope import calibrate_by_campaign_fit, set_form_error
from elastocal.campaigns.campaign import APPLICATION_POINT_STD_M, Target
from elastocal.effects.catalogue import candidates_on, list_effects
from elastocal.effects.conditions import MASS_PARAMETERS
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.formulas import Term, derive_formulas, sum_formulas
from elastocal.effects.geometry import declared_base
from elastocal.effects.gravity import declared_application_point, declared_weight
from elastocal.errors import InputError
from elastocal.fitting.model import (
    LOAD_EFFECTS,
    LOAD_ITERATIONS,
    Model,
    get_joint_compliances,
    get_mass_corrections,
)
from elastocal.fitting.noise import parse_noise, serialize_noise
from elastocal.fitting.observations import Observations, States
from elastocal.fitting.stored_models import restore_model, serialize_model
from elastocal.io.atomic_writes import write_text
from elastocal.io.documents import check_document
from elastocal.io.json_files import read_json
from elastocal.io.texts import check_file
from elastocal.io.typed_json import (
    OMITTED_BY_DEFAULT,
    build_json_schema,
    from_document,
    to_document,
)
from elastocal.mechanics.chain import AXES
from elastocal.mechanics.robot_file import describe_robot, parse_robot
from elastocal.mechanics.sites import build_sites
from elastocal.residual_model.laws import DisplacementLaw, ProcessLaw, TreesLaw
from elastocal.residual_model.selection import (
    compute_effect_factors,
    compute_regression_range,
    fit_to_observations,
)
from elastocal.validation.transfer import compute_joint_range, compute_load_limits
from elastocal.verdict import RegressionChoice, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.effects.protocol import Candidate, Parameter, Shape
    from elastocal.mechanics.robot import Robot
    from elastocal.mechanics.sites import Sites
    from elastocal.residual_model.laws import Law

    Numbers = tuple[float, ...]
    Rows = tuple[Numbers, ...]

FORMAT = "elastocal model"
# Version of the format: a program refuses files of a later one.
VERSION = 1
_WRITTEN_BY = "a file that CorrectedRobot.save or `elastocal export` has written"
_INNERMOST_LIST = re.compile(r"\[\s+([^\[\]{}]*?)\s+\]")
_BLANKS = re.compile(r"\s+")
# Upper bound on the size of a file: a campaign of 100,000 states has some 40 MB.
_LARGEST_BYTES = 500_000_000
# What messages about a law without formula name.
_PART = "model file"
# Types of the columns of states that are no floating-point numbers.
_STATE_TYPES = dict.fromkeys(("session", "pose", "load", "repeats", "row"), int)


@dataclass(frozen=True)
class ElementaryTransform:
    """One transform of the chain.

    Attributes
    ----------
    kind : str
        "T" along or "R" about the axis.
    axis : str
        "x", "y" or "z" of the moving frame.
    constant : float
        Amount of a fixed transform, m or rad.
    coordinate : int, optional
        Coordinate that is the amount, from 0.
    sign : float
        Sense of the coordinate.
    """

    kind: str
    axis: str
    constant: float = field(default=0.0, metadata=OMITTED_BY_DEFAULT)
    coordinate: int | None = field(default=None, metadata=OMITTED_BY_DEFAULT)
    sign: float = field(default=1.0, metadata=OMITTED_BY_DEFAULT)


@dataclass(frozen=True)
class Body:
    """A weight that loads the coordinates before it.

    Attributes
    ----------
    after : int
        Number of transforms before its frame.
    mass_kg : float
    moment_kg_m : tuple of float
        First moment in that frame.
    loads_joints : bool
        Whether it loads the joints, or only the coordinates behind them.
    """

    after: int
    mass_kg: float
    moment_kg_m: tuple[float, float, float]
    loads_joints: bool


@dataclass(frozen=True)
class Kinematics:
    """The chain with all coordinates, and the bodies that load it.

    Attributes
    ----------
    joints, coordinates : int
        The joints are the first coordinates.
    joint_limits : tuple
        Lowest and highest angle of each joint of the chain, rad; of prismatic joints m.
    reported_matrix, reported_offset : tuple
        Angles of the chain are matrix @ reported + offset. There are fewer reported
        angles than joints if joints follow others.
    transforms : tuple of ElementaryTransform
        From the base to the last measuring point.
    end_effector : str
        Name of that point.
    end_effector_offset_m : tuple of float
        Point whose pose is predicted, in the frame behind the last transform. The wrench
        refers to the origin of that frame.
    gravity_m_s2 : tuple of float
        Base axes.
    bodies : tuple of Body
        Declared weights.
    load_iterations : int
        How often loads are evaluated again at the displaced pose.
    """

    joints: int
    coordinates: int
    joint_limits: tuple[tuple[float, ...], ...]
    reported_matrix: tuple[tuple[float, ...], ...]
    reported_offset: tuple[float, ...]
    transforms: tuple[ElementaryTransform, ...]
    end_effector: str
    end_effector_offset_m: tuple[float, ...]
    gravity_m_s2: tuple[float, ...]
    bodies: tuple[Body, ...]
    load_iterations: int


@dataclass(frozen=True)
class ModelEffect:
    """One effect that a command contains.

    Attributes
    ----------
    key : str
        Its name in the catalogue, with the joints.
    parameters : tuple of (str, str, float)
        Name, unit and value of each parameter.
    terms : tuple of Term
        What it adds to the coordinates.
    """

    key: str
    parameters: tuple[tuple[str, str, float], ...]
    terms: tuple[Term, ...]


@dataclass(frozen=True)
class FittedRange:
    """Commands at which a model was fitted.

    Attributes
    ----------
    low, high : tuple of float
        Angles of the chain, rad; of prismatic joints m.
    force_N, moment_Nm : float
        Largest load.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    force_N: float
    moment_Nm: float


@dataclass(frozen=True)
class DisplacementSeries:
    """Terms that displace the coordinates of the chain at the angles of its joints; the
    position of the end effector moves by its Jacobian there times the sum.

    Attributes
    ----------
    displacements : tuple of Term
    """

    displacements: tuple[Term, ...]


@dataclass(frozen=True)
class GaussianProcess:
    """The mean of a Gaussian process, see `residual_model.laws.ProcessLaw`.

    Attributes
    ----------
    columns : tuple of int
        Inputs, from 0: joint angles of the chain, then wrench, then target_offset_m.
    target_offset_m : tuple of float
    center, spread, lengths, points, weights, offset, size : as in `ProcessLaw`.
    """

    columns: tuple[int, ...]
    target_offset_m: tuple[float, ...]
    center: tuple[float, ...]
    spread: tuple[float, ...]
    lengths: tuple[float, ...]
    points: tuple[tuple[float, ...], ...]
    weights: tuple[tuple[float, ...], ...]
    offset: tuple[float, ...]
    size: tuple[float, ...]


@dataclass(frozen=True)
class RegressionTree:
    """A regression tree, see `residual_model.laws.Tree`.

    Attributes
    ----------
    column, threshold, children, value : as in `Tree`; columns as in `GaussianProcess`.
    """

    column: tuple[int, ...]
    threshold: tuple[float, ...]
    children: tuple[tuple[int, ...], ...]
    value: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Forest:
    """The mean of regression trees.

    Attributes
    ----------
    target_offset_m : tuple of float
        As in `GaussianProcess`.
    trees : tuple of RegressionTree
    """

    target_offset_m: tuple[float, ...]
    trees: tuple[RegressionTree, ...]


@dataclass(frozen=True)
class RegressionFormula:
    """A regression on the residuals, which displaces the end effector, m, base axes.

    Attributes
    ----------
    name : str
    range : FittedRange
        Beyond which nothing is added.
    law : DisplacementSeries, GaussianProcess or Forest, optional
        Its formula; None if it has none, so that only elastocal evaluates it.
    """

    name: str
    range: FittedRange
    law: DisplacementSeries | GaussianProcess | Forest | None


@dataclass(frozen=True)
class RegressionFit:
    """What a regression is fitted to again.

    Attributes
    ----------
    choice : RegressionChoice
    target_offset_m : tuple of float
    sensor_m : float
        As in `ResidualModel`.
    state, target : tuple of int
        State and target of each observation.
    position_m : tuple
        Measured positions, in the frames of their sessions.
    """

    choice: RegressionChoice
    target_offset_m: tuple[float, ...]
    sensor_m: float
    state: tuple[int, ...]
    target: tuple[int, ...]
    position_m: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class FitRecord:
    """The fit of the campaign, from which elastocal restores the robot.

    Attributes
    ----------
    targets : tuple of Target
        As the campaign declares them.
    fitted_frames : bool
        Whether the placement of the base was fitted.
    base_std_m : float
        As in `Model`.
    rows : int
        3 if positions were measured, 6 if poses were.
    nominal_compliance : tuple of float
        rad/(N m); of prismatic joints m/N.
    compliance_known, bears_typical_weight : bool
        As in `Model` and `Sites`.
    time_zero_s, row_span : as in `Model`.
    model : dict
        Keys, priors and values of all effects, frames and targets, see
        `stored_models.serialize_model`.
    covariance : tuple
        Of all parameters: frames, targets, then the effects, each with its linear and
        nonlinear parameters; SI units.
    noise : dict
        Of the measurements.
    repeatability_dof, form_m : float
    contradicted : bool
        As in `Scope`.
    states : dict
        Columns of the fitted states, see `States`.
    regression : RegressionFit, optional
    """

    targets: tuple[Target, ...]
    fitted_frames: bool
    base_std_m: float
    rows: int
    nominal_compliance: tuple[float, ...]
    compliance_known: bool
    bears_typical_weight: bool
    time_zero_s: float
    row_span: tuple[int, int] | None
    model: dict[str, Any]
    covariance: tuple[tuple[float, ...], ...]
    noise: dict[str, Any]
    repeatability_dof: float
    form_m: float
    contradicted: bool
    states: dict[str, Any]
    regression: RegressionFit | None

    @property
    def measures_poses(self) -> bool:
        """Whether orientations were measured."""
        return self.rows > len(AXES)


@dataclass(frozen=True)
class ModelFile:
    """Contents of a model file.

    Attributes
    ----------
    format, version : str and int
    program : str
        Version of elastocal that has written it.
    campaign : str
        Name of the campaign.
    robot : dict
        Contents of the nominal robot's file.
    kinematics : Kinematics
    springs : tuple of Term
        Displacements of the joints by their compliances.
    effects : tuple of ModelEffect
    range : FittedRange
        Beyond which a command is an extrapolation.
    regression : RegressionFormula, optional
    fit : FitRecord
    verdict : Verdict
    """

    format: str
    version: int
    program: str
    campaign: str
    robot: dict[str, Any]
    kinematics: Kinematics
    springs: tuple[Term, ...]
    effects: tuple[ModelEffect, ...]
    range: FittedRange
    regression: RegressionFormula | None
    fit: FitRecord
    verdict: Verdict


def build_model_schema() -> dict[str, Any]:
    """Return the JSON schema of a model file."""
    return build_json_schema(ModelFile)


def describe_model(calibrated: CalibratedRobot, verdict: Verdict) -> ModelFile:
    """Describe a calibrated robot, with its campaign, as the contents of a model file.

    Raises
    ------
    InputError
        The law of an effect has no formula.
    """
    robot = calibrated.robot
    sites = calibrated.model.sites
    compliance = get_joint_compliances(calibrated.model, calibrated.estimate)
    springs = [
        Term(joint, float(value), loads=(joint,))
        for joint, value in enumerate(compliance)
        if value
    ]
    return ModelFile(
        FORMAT,
        VERSION,
        __version__,
        verdict.campaign,
        describe_robot(robot),
        _describe_kinematics(calibrated, robot),
        tuple(springs),
        tuple(_describe_effects(calibrated, compliance)),
        _make_range(
            *compute_joint_range(calibrated.states),
            *compute_load_limits(calibrated.states),
        ),
        _describe_regression(calibrated, compliance),
        _describe_fit(calibrated, sites),
        verdict,
    )


def write_model(path: str | Path, model: ModelFile) -> None:
    """Write a model file; lists of numbers are on one line."""
    text = json.dumps(to_document(model), indent=1, allow_nan=False)
    one_line = _INNERMOST_LIST.sub(
        lambda match: f"[{_BLANKS.sub(' ', match[1])}]", text
    )
    write_text(path, one_line + "\n")


def read_model_file(path: str | Path) -> ModelFile:
    """Read and check a model file.

    Raises
    ------
    InputError
        It is no model file, or one of a later version, or was changed by hand.
    """
    if not Path(path).exists():
        raise InputError(path, "", "no such file", _WRITTEN_BY)
    size = check_file(path, _WRITTEN_BY)
    if size > _LARGEST_BYTES:
        allowed = f"at most {_LARGEST_BYTES // 1_000_000} MB"
        raise InputError(path, "", f"a file of {size // 1_000_000} MB", allowed)
    document = read_json(path)
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(path, "format", "no model file", _WRITTEN_BY)
    if document.get("version") != VERSION:
        version = repr(document.get("version"))
        allowed = f"version {VERSION}, which this program knows"
        raise InputError(path, "version", version, allowed)
    return from_document(ModelFile, document, path)


def restore_calibrated(contents: ModelFile, source: str | Path) -> CalibratedRobot:
    """Restore the calibrated robot of a model file.

    Parameters
    ----------
    contents : contents of the file
    source : the file, for messages

    Raises
    ------
    InputError
        The file names an effect that this installation does not have, or its parts do
        not belong together.
    """
    try:
        return _restore(contents, source)
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        finding = f"parts that do not belong together ({error})"
        raise InputError(source, "fit", finding, _WRITTEN_BY) from None


def _restore(contents: ModelFile, source: str | Path) -> CalibratedRobot:
    check_document(contents.robot, "robot", str(source))
    robot = parse_robot(contents.robot, str(source))
    record = contents.fit
    model = _restore_declared_model(robot, record)
    catalogue = _list_known_effects(model.sites)
    unknown = [key for key in record.model["effects"] if key not in catalogue]
    if unknown:
        allowed = "effects of this installation and its plug-ins"
        raise InputError(source, "fit.model.effects", repr(unknown[0]), allowed)
    model, estimate = restore_model(model, catalogue, record.model)
    observations = _restore_observations(record)
    covariance = np.array(record.covariance).reshape(len(record.covariance), -1)
    fit = CampaignFit(model, estimate, covariance, observations)
    calibrated = calibrate_by_campaign_fit(
        robot,
        fit,
        parse_noise({"noise": record.noise}),
        _restore_residual_model(fit, record.regression),
        record.repeatability_dof,
    )
    return set_form_error(calibrated, record.form_m, contradicted=record.contradicted)


def _describe_kinematics(calibrated: CalibratedRobot, robot: Robot) -> Kinematics:
    chain = calibrated.model.sites.chain
    transforms = [
        ElementaryTransform(
            entry.kind, AXES[entry.axis], entry.constant, entry.coordinate, entry.sign
        )
        for entry in chain.transforms
    ]
    return Kinematics(
        robot.joints,
        chain.coordinates,
        _as_rows(robot.joint_limits),
        _as_rows(robot.reported_matrix),
        _as_numbers(robot.reported_offset),
        tuple(transforms),
        chain.end_effector.name,
        _as_numbers(chain.end_effector.offset_m),
        _as_numbers(calibrated.model.sites.gravity_m_s2),
        tuple(_describe_bodies(calibrated)),
        LOAD_ITERATIONS,
    )


def _describe_bodies(calibrated: CalibratedRobot) -> Iterable[Body]:
    """Yield the weights that are part of every load."""
    sites = calibrated.model.sites
    if sites.bears_typical_weight:
        ends = sites.tracked_points[1:]
        for end, mass_kg in zip(ends, sites.typical_masses_kg.tolist(), strict=False):
            yield Body(end.after, mass_kg, (0.0, 0.0, 0.0), loads_joints=False)
        return
    corrections = get_mass_corrections(calibrated.model, calibrated.estimate)
    bodies = sites.tracked_points[sites.joints + 2 :]
    for body, mass, correction in zip(
        bodies, sites.masses, corrections.reshape(-1, MASS_PARAMETERS), strict=True
    ):
        mass_kg = float(mass.mass_kg + correction[0])
        x, y, z = (mass_kg * np.array(mass.centre_m) + correction[1:]).tolist()
        yield Body(body.after, mass_kg, (x, y, z), loads_joints=True)


def _describe_effects(
    calibrated: CalibratedRobot, compliance: np.ndarray
) -> Iterable[ModelEffect]:
    estimate = calibrated.estimate
    for effect, values, shapes in zip(
        calibrated.model.effects, estimate.coefficients, estimate.shapes, strict=True
    ):
        unknowns: list[Parameter | Shape] = [*effect.parameters, *effect.shapes]
        parameters = [
            (unknown.name, unknown.unit, float(value))
            for unknown, value in zip(unknowns, (*values, *shapes), strict=True)
        ]
        terms: list[Term] = []
        # Springs and weights are in the loads already.
        if effect.effect not in LOAD_EFFECTS:
            sites = calibrated.model.sites
            formulas = derive_formulas(effect, shapes, sites, compliance, _PART)
            terms = sum_formulas(values, formulas)
        yield ModelEffect(effect.key, tuple(parameters), tuple(terms))


def _describe_regression(
    calibrated: CalibratedRobot, compliance: np.ndarray
) -> RegressionFormula | None:
    residual_model = calibrated.residual_model
    if residual_model is None or residual_model.choice is None:
        return None
    law = _express(residual_model)
    formula: DisplacementSeries | GaussianProcess | Forest | None = None
    if isinstance(law, DisplacementLaw):
        formula = _describe_displacements(calibrated, law, compliance)
    elif isinstance(law, ProcessLaw):
        formula = _describe_process(residual_model, law)
    elif isinstance(law, TreesLaw):
        formula = _describe_trees(residual_model, law)
    states = calibrated.states
    name = residual_model.choice.regression
    span = _make_range(*compute_regression_range(states), *compute_load_limits(states))
    return RegressionFormula(name, span, formula)


def _express(residual_model: ResidualModel) -> Law | None:
    """Express the regression by its formula, if it has one."""
    express = residual_model.predictor.law
    return None if express is None else express()


def _describe_process(
    residual_model: ResidualModel, law: ProcessLaw
) -> GaussianProcess:
    return GaussianProcess(
        tuple(law.columns.tolist()),
        _as_numbers(residual_model.target_offset_m),
        _as_numbers(law.center),
        _as_numbers(law.spread),
        _as_numbers(law.lengths),
        _as_rows(law.points),
        _as_rows(law.weights),
        _as_numbers(law.offset),
        _as_numbers(law.size),
    )


def _describe_trees(residual_model: ResidualModel, law: TreesLaw) -> Forest:
    trees = []
    for tree in law.trees:
        column = tuple(tree.column.tolist())
        threshold = _as_numbers(tree.threshold)
        children = tuple(map(tuple, tree.children.tolist()))
        trees.append(RegressionTree(column, threshold, children, _as_rows(tree.value)))
    return Forest(_as_numbers(residual_model.target_offset_m), tuple(trees))


def _describe_displacements(
    calibrated: CalibratedRobot, law: DisplacementLaw, compliance: np.ndarray
) -> DisplacementSeries:
    """Describe a regression on the columns of the Jacobian, those of coordinates first,
    then those of effects, and on functions of joints."""
    model = calibrated.model
    coordinates = model.sites.chain.coordinates
    constants, by_effects = np.split(law.geometry, [coordinates])
    terms = [Term(k, float(value)) for k, value in enumerate(constants) if value]
    factors = compute_effect_factors(model)
    scaled = iter(by_effects * factors)
    for effect, shapes in zip(model.effects, calibrated.estimate.shapes, strict=True):
        if effect.effect in list_effects():
            formulas = derive_formulas(effect, shapes, model.sites, compliance, _PART)
            terms += sum_formulas([next(scaled) for _ in formulas], formulas)
    return DisplacementSeries((*terms, *law.terms))


def _describe_fit(calibrated: CalibratedRobot, sites: Sites) -> FitRecord:
    fit = calibrated.fit
    assert fit is not None, "a robot without a campaign has no model file"
    model = fit.model
    scope = calibrated.scope
    states = {}
    for name, column in vars(fit.observations.states).items():
        states[name] = None if column is None else _as_json(column)
    return FitRecord(
        model.targets,
        model.fitted_frames,
        model.base_std_m,
        model.rows,
        _as_numbers(model.nominal_compliance),
        model.compliance_known,
        sites.bears_typical_weight,
        model.time_zero_s,
        model.row_span,
        serialize_model(model, fit.estimate),
        _as_rows(fit.covariance),
        serialize_noise(calibrated.noise),
        float(scope.repeatability_dof),
        scope.form_m,
        scope.contradicted,
        states,
        _describe_regression_fit(calibrated, fit.observations),
    )


def _describe_regression_fit(
    calibrated: CalibratedRobot, observations: Observations
) -> RegressionFit | None:
    residual_model = calibrated.residual_model
    if residual_model is None or residual_model.choice is None:
        return None
    # A choice that was judged on validation poses states more than how to fit it again.
    choice = RegressionChoice(
        **{
            entry.name: getattr(residual_model.choice, entry.name)
            for entry in fields(RegressionChoice)
        }
    )
    law = _express(residual_model)
    if isinstance(law, ProcessLaw):
        choice = replace(choice, setting=_describe_hyperparameters(law.setting))
    return RegressionFit(
        choice,
        _as_numbers(residual_model.target_offset_m),
        residual_model.sensor_m,
        tuple(observations.state.tolist()),
        tuple(observations.target.tolist()),
        _as_rows(observations.position),
    )


def _describe_hyperparameters(setting: Mapping[str, Any]) -> dict[str, Any]:
    """Describe the hyperparameters of a process: estimated again, they would differ in
    the ninth digit from one run to the next. An input without influence has an infinite
    length, which is not used."""
    lengths = np.asarray(setting["lengths"])
    return {
        "variance": float(setting["variance"]),
        "lengths": _as_numbers(np.where(np.isfinite(lengths), lengths, 1.0)),
        "noise": float(setting["noise"]),
    }


def _restore_declared_model(robot: Robot, record: FitRecord) -> Model:
    sites = build_sites(robot)
    if record.bears_typical_weight:
        sites = replace(sites, bears_typical_weight=True)
    return Model(
        sites,
        record.targets,
        record.fitted_frames,
        record.rows,
        np.array(record.nominal_compliance),
        (),
        record.time_zero_s,
        record.row_span,
        record.compliance_known,
        record.base_std_m,
    )


def _list_known_effects(sites: Sites) -> dict[str, Candidate]:
    # The record has the priors with which the campaign was fitted.
    point_error = declared_application_point(sites, APPLICATION_POINT_STD_M)
    declared = [joint_compliance(sites), point_error, declared_base(sites)]
    if sites.masses:
        declared.append(declared_weight(sites))
    return {effect.key: effect for effect in declared} | candidates_on(sites)


def _restore_observations(record: FitRecord) -> Observations:
    columns: dict[str, Any] = {
        name: None
        if column is None
        else np.array(column, _STATE_TYPES.get(name, float))
        for name, column in record.states.items()
    }
    regression = record.regression
    states = States(**columns)
    if regression is None:
        nothing = np.zeros(0, int)
        return Observations(states, nothing, nothing, np.zeros((0, 3)), None)
    return Observations(
        states,
        np.array(regression.state, int),
        np.array(regression.target, int),
        np.array(regression.position_m, float).reshape(-1, 3),
        None,
    )


def _restore_residual_model(
    fit: CampaignFit, record: RegressionFit | None
) -> ResidualModel | None:
    if record is None:
        return None
    choice = record.choice
    assert choice.spread is not None, "no regression was chosen"
    predictor = fit_to_observations(choice, fit.model, fit.estimate, fit.observations)
    return ResidualModel(
        predictor,
        np.array(record.target_offset_m),
        record.sensor_m,
        choice.spread.typical,
        choice,
    )


def _make_range(
    low: np.ndarray, high: np.ndarray, force: float, moment: float
) -> FittedRange:
    return FittedRange(_as_numbers(low), _as_numbers(high), float(force), float(moment))


def _as_numbers(values: Iterable[float]) -> Numbers:
    return tuple(np.asarray(values, float).tolist())


def _as_rows(values: np.ndarray) -> Rows:
    return tuple(map(tuple, values.tolist()))


def _as_json(column: np.ndarray) -> list[Any]:
    """Return a column as lists, with None instead of NaN."""
    if column.dtype.kind != "f" or not np.isnan(column).any():
        listed: list[Any] = column.tolist()
        return listed
    objects = column.astype(object)
    objects[np.isnan(column)] = None
    listed = objects.tolist()
    return listed
