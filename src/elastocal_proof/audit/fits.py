"""Audit of the fits of a campaign: a least-squares step by statsmodels on pinocchio's
kinematics at the stated estimates, and residuals from MuJoCo's equilibrium.

Models with effects other than joint springs and links of one section are left out, and
so are campaigns with fitted frames or targets, declared effects or masses, and points of
loads that are not exact.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pandas as pd
import pinocchio as pin
import statsmodels.api as sm
from scipy import stats
from scipy.spatial.transform import Rotation
from statsmodels.robust.norms import HuberT

from elastocal_proof.audit.arm import Arm, compute_link_compliance
from elastocal_proof.audit.finished_run import (
    COMPONENTS,
    POSITION,
    WRENCH,
    Finding,
    FinishedRun,
    compare,
)

_STATE = ["session", "pose", "load"]
_ROTATION = ["rx", "ry", "rz"]
# A converged estimate moves by at most this many of its standard errors, at the actual
# scatter, in a further step.
SETTLED = 2e-3
# Relative tolerance of standard errors, which belong to the step before the last one.
_STANDARD_ERROR_TOLERANCE = 1e-3
# Absolute tolerance of residuals, m: a fit read from its file still moves this much.
_POSITION_TOLERANCE_M = 2e-8
# Passes after which the package evaluates the position; its loads are those after two.
_PACKAGE_PASSES = 3
# Effects whose equations the audit implements a second time, and parameters of a link.
_JOINT_EFFECT = "joint_compliance"
_LINK_EFFECT = "link_elasticity"
_LINK_PARAMETERS = ("bending_1_over_EI", "torsion_1_over_GJ", "taper")
# Measurements beyond this quantile of the distance from the prediction lose weight.
_HUBER_QUANTILE = 0.99
# Upper bound of a link's taper.
_LARGEST_TAPER = 0.6
# Step in the taper for its central difference.
_TAPER_STEP = 1e-4
# Links shorter than this, m, do not bend.
_SHORTEST_M = 0.05
# Passes towards the equilibrium: each leaves some 1/500 of the error of the one before.
_PASSES = 8
# Measurements this many times farther from the median of their repeats than repeats
# usually are were not fitted (Hampel).
_OUTLIER_DISTANCE = 12.0
_BY = "statsmodels on pinocchio"


@dataclass(frozen=True)
class FittedModel:
    """One model of a diagnosis with P parameters, at its estimates.

    Attributes
    ----------
    kind : kind of the step of the diagnosis
    parameter_rows : rows of steps.parquet
    noise : standard deviations of the measurements
    springs : (C, C) array, compliance of all coordinates
    derivatives : (P, C, C) array, of `springs` with respect to each parameter
    """

    kind: str
    parameter_rows: pd.DataFrame
    noise: Mapping[str, Any]
    springs: np.ndarray
    derivatives: np.ndarray


@dataclass(frozen=True)
class AuditedCampaign:
    """A campaign of joint springs and links.

    Attributes
    ----------
    arm : the robot
    target_rotations : of each target; empty if only positions are measured
    models : of each step, None for a model that the audit leaves out
    """

    arm: Arm
    target_rotations: list[np.ndarray]
    models: list[FittedModel | None]


def read_audited_campaign(run: FinishedRun, name: str) -> AuditedCampaign | None:
    """Read a campaign's robot and models; return None for a campaign that is left
    out."""
    folder = f"results/loop/{name}"
    facts = run.document(f"{folder}/campaign.json")
    campaign = facts["campaign"]
    targets = list(campaign["targets"].values())
    rows = run.table(f"{folder}/steps.parquet")
    if (
        any("unknown" in (t["offset_m"], t.get("rotation")) for t in targets)
        or campaign["frame"] != "base"
        or facts.get("held_out") is not None
        or rows["owner"].str.contains("frame|session", regex=True).any()
        or campaign["declared"]
        or "masses" in facts["robot"]
    ):
        return None
    arm = Arm(
        {**facts["robot"], "links": {}},
        {
            number: (target["point"], target["offset_m"])
            for number, target in enumerate(targets)
        },
    )
    steps = run.document(f"{folder}/diagnosis.json")["steps"]
    models = [
        _build_model(arm, step, rows[rows["step"] == number])
        for number, step in enumerate(steps)
    ]
    rotations = []
    if campaign["measured"] == "pose":
        vectors = [np.array(t.get("rotation", np.zeros(3)), float) for t in targets]
        rotations = [pin.exp3(vector) for vector in vectors]
    return AuditedCampaign(arm, rotations, models)


def _build_model(
    arm: Arm, step: Mapping[str, Any], parameters: pd.DataFrame
) -> FittedModel | None:
    """Build the springs of a model from its estimates; return None for a model with an
    effect that is left out."""
    if not _has_second_implementation(arm, step["effects"]):
        return None
    elastic = {
        number: vector
        for number, vector in enumerate(arm.links)
        if np.linalg.norm(vector) > _SHORTEST_M
    }

    def build_springs(joints: np.ndarray, *link_parameters: float) -> np.ndarray:
        links = {
            number: compute_link_compliance(vector, *link_parameters)
            for number, vector in elastic.items()
        }
        return arm.build_springs(joints, links)

    values = dict(zip(parameters["parameter"], parameters["value"], strict=True))
    bending, torsion, taper = (values.get(name, 0.0) for name in _LINK_PARAMETERS)
    rigid = np.zeros(arm.joints)
    higher = build_springs(rigid, bending, torsion, taper + _TAPER_STEP)
    lower = build_springs(rigid, bending, torsion, taper - _TAPER_STEP)
    derivatives = {
        "bending_1_over_EI": build_springs(rigid, 1, 0, taper),
        "torsion_1_over_GJ": build_springs(rigid, 0, 1, taper),
        "taper": (higher - lower) / (2 * _TAPER_STEP),
    }
    joints = arm.compliance.copy()
    for index, unit in enumerate(np.eye(arm.joints)):
        name = f"c{index + 1}"
        derivatives[name] = build_springs(unit, 0, 0, 0)
        joints[index] = values.get(name, joints[index])
    stacked = np.array([derivatives[name] for name in parameters["parameter"]])
    return FittedModel(
        step["kind"],
        parameters,
        step["noise"],
        build_springs(joints, bending, torsion, taper),
        stacked.reshape(-1, *higher.shape),
    )


def _has_second_implementation(arm: Arm, effects: list[str]) -> bool:
    """Whether the audit implements all effects: joint springs, and links of one section
    whose ends are those of sections of translations."""
    link_effects = [key for key in effects if key.startswith(_LINK_EFFECT)]
    if not link_effects:
        return {*effects} <= {_JOINT_EFFECT}
    # A fixed rotation or a coupled joint divides a section of translations.
    chain = arm.document["chain"]
    return (
        len(link_effects) == 1
        and {*effects} <= {_JOINT_EFFECT, *link_effects}
        and "one section" in link_effects[0]
        and "deg)" not in chain
        and len(re.findall(r"q\d+", chain)) == arm.joints
    )


def _find_outliers(frame: pd.DataFrame) -> np.ndarray:
    """Find measurements, (N,) bool, far from the median of at least three repeats, by
    the median distance of all."""
    repeats = frame.groupby([*_STATE, "target"])[list(POSITION)]
    distance = (frame[list(POSITION)] - repeats.transform("median")).abs().to_numpy()
    repeated = repeats.transform("size").to_numpy() > 2
    nonzero = distance[repeated]
    nonzero = nonzero[nonzero > 0]
    if not len(nonzero):
        return np.zeros(len(frame), bool)
    return repeated & (distance > _OUTLIER_DISTANCE * np.median(nonzero)).any(axis=1)


def average_repeats(campaign: AuditedCampaign, kept: pd.DataFrame) -> pd.DataFrame:
    """Average the repeated measurements of each state and target.

    The column `repeats` counts them for the target of the state with the fewest.
    """
    loads = [*(f"q{j}" for j in range(1, campaign.arm.joints + 1)), *WRENCH]
    kept = kept.assign(**kept.groupby(_STATE)[loads].transform("mean"))
    groups = kept.groupby([*_STATE, "target"])
    repeats = groups.size().groupby(_STATE).transform("min")
    averages = groups[[*loads, *POSITION]].mean().assign(repeats=repeats)
    if campaign.target_rotations:
        vectors = [
            Rotation.from_rotvec(group[_ROTATION].to_numpy(copy=True))
            .mean()
            .as_rotvec()
            for _, group in groups
        ]
        averages = averages.join(pd.DataFrame(vectors, averages.index, _ROTATION))
    return averages.reset_index()


def compute_residuals(
    campaign: AuditedCampaign, springs: np.ndarray, rows: pd.DataFrame
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute residuals of M measurements at the deflected arm.

    Returns
    -------
    residuals : (M, 3 or 6) array, measured minus predicted, m and rad
    jacobians : (M, 3 or 6, C) array
    forces : (M, C) array, generalized forces
    """
    arm = campaign.arm
    angles = rows[[f"q{j}" for j in range(1, arm.joints + 1)]].to_numpy()
    wrenches = rows[list(WRENCH)].to_numpy()
    columns = [*POSITION, *_ROTATION] if campaign.target_rotations else [*POSITION]
    residuals = []
    jacobians = []
    loads = []
    for q, wrench, measured, target in zip(
        angles, wrenches, rows[columns].to_numpy(), rows["target"], strict=True
    ):
        coordinates, forces = arm.deflect(springs, q, wrench, _PASSES)
        residuals.append(_compute_residual(campaign, coordinates, target, measured))
        jacobians.append(arm.jacobian(coordinates, target)[: len(measured)])
        loads.append(forces)
    return np.array(residuals), np.array(jacobians), np.array(loads)


def _compute_residual(
    campaign: AuditedCampaign,
    coordinates: np.ndarray,
    target: int,
    measured: np.ndarray,
) -> np.ndarray:
    """Residual (3 or 6,) of one measurement at displaced coordinates, m and rad."""
    position, rotation = campaign.arm.pose(coordinates, target)
    residual = measured[:3] - position
    if not campaign.target_rotations:
        return residual
    predicted = rotation @ campaign.target_rotations[target]
    error = np.array(pin.log3(pin.exp3(measured[3:]) @ predicted.T))
    return np.concatenate([residual, error])


def take_least_squares_step(
    campaign: AuditedCampaign, model: FittedModel, training: pd.DataFrame
) -> tuple[Any, np.ndarray]:
    """Take one robust least-squares step (Huber) of a model from its estimates.

    Returns
    -------
    fit : result of statsmodels for all free parameters
    moves : array
        Step of each parameter that is not at a bound, in standard errors at the actual
        scatter.
    """
    averages = average_repeats(campaign, training)
    residual, jacobian, forces = compute_residuals(campaign, model.springs, averages)
    rows = np.einsum(
        "mrc,pcd,md->mrp", jacobian, model.derivatives, forces, optimize=True
    )
    rows = np.concatenate([rows, residual[:, :, None]], axis=2)
    rows, scatter = _weigh_rows(
        rows, model.noise, averages, jacobian[:, :, : campaign.arm.joints]
    )
    value, prior_std, error = (
        model.parameter_rows[name].to_numpy()
        for name in ("value", "prior_std", "std_error")
    )
    prior_rows = np.column_stack([np.eye(len(value)), -value]) / prior_std[:, None]
    rows = np.concatenate([rows, prior_rows[np.isfinite(prior_std)]])
    free = ~model.parameter_rows["held"].to_numpy(bool)
    # A taper at one of its bounds stays there.
    is_taper = (model.parameter_rows["parameter"] == "taper").to_numpy()
    movable = free & ~(is_taper & np.isin(value, [0.0, _LARGEST_TAPER]))
    fit, step = (
        sm.OLS(rows[:, -1], rows[:, :-1][:, columns]).fit(
            cov_type="fixed scale", cov_kwds={"scale": 1.0}
        )
        for columns in (free, movable)
    )
    return fit, step.params / (scatter * error[movable])


def _weigh_rows(
    rows: np.ndarray,
    noise: Mapping[str, Any],
    averages: pd.DataFrame,
    jacobian: np.ndarray,
) -> tuple[np.ndarray, float]:
    """Whiten rows (M, 3 or 6, K), whose last column is the residual, with Huber's
    weight of each measurement.

    Returns the stacked rows, and the scatter over the declared noise, at least one.
    """
    whitened = _whiten(noise, averages, jacobian, rows)[..., -1]
    distance = np.sqrt((whitened**2).mean(axis=1))
    count = rows.shape[1]
    expected_median = np.sqrt(stats.chi2.median(count) / count)
    scatter = max(float(np.median(distance) / expected_median), 1.0)
    threshold = np.sqrt(stats.chi2.ppf(_HUBER_QUANTILE, count) / count)
    weights = HuberT(threshold).weights(distance / scatter)
    weighted = np.sqrt(weights)[:, None, None] * rows
    whitened = _whiten(noise, averages, jacobian, weighted)
    return whitened.reshape(-1, rows.shape[2]), scatter


def _whiten(
    noise: Mapping[str, Any],
    averages: pd.DataFrame,
    jacobian: np.ndarray,
    values: np.ndarray,
) -> np.ndarray:
    """Solve the Cholesky factor of each pose's covariance for values (M, 3 or 6, K).

    The sensor noise is independent for each measurement, one error of the joints is
    common to a state, and another one to a pose.
    """
    components = jacobian.shape[1]
    sensor_std = np.repeat([noise["position_m"], noise["orientation_rad"]], 3)
    sensor = sensor_std[:components] ** 2
    joint_variance = np.array(noise["joint_rad"]) ** 2
    pose_variance = noise["pose_rad"] ** 2
    load = averages["load"].to_numpy()
    pose = averages.groupby(_STATE[:2]).ngroup().to_numpy()
    whitened = np.empty(values.shape)
    for number in np.unique(pose):
        members = pose == number
        stacked = jacobian[members].reshape(-1, len(joint_variance))
        same_load = load[members][:, None] == load[members]
        same_state = np.kron(same_load, np.ones((components, components)))
        covariance = np.diag(np.tile(sensor, members.sum()))
        covariance = covariance + same_state * ((stacked * joint_variance) @ stacked.T)
        covariance /= np.repeat(averages["repeats"].to_numpy()[members], components)
        covariance += pose_variance * stacked @ stacked.T
        block = values[members]
        whitened[members] = np.linalg.solve(
            np.linalg.cholesky(covariance), block.reshape(len(stacked), -1)
        ).reshape(block.shape)
    return whitened


def check_fits(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """Estimates and standard errors of every step, and correlations of the last one, of
    campaigns without recorded approaches."""
    audited = read_audited_campaign(run, campaign)
    training = run.table(f"results/loop/{campaign}/training.parquet")
    if audited is None or training["approach1"].notna().any():
        return
    diagnosis = run.document(f"results/loop/{campaign}/diagnosis.json")
    gross_errors = [
        row for entry in diagnosis["document"]["gross_errors"] for row in entry["rows"]
    ]
    rejected = training["row"].isin(gross_errors) | _find_outliers(training)
    for number, model in enumerate(audited.models):
        if model is None or model.parameter_rows["held"].all():
            continue
        fit, moves = take_least_squares_step(audited, model, training[~rejected])
        step = f"of step {number} ({model.kind})"
        yield compare(
            f"estimates {step} stand still, in standard errors",
            _BY,
            moves,
            0 * moves,
            absolute=SETTLED,
        )
        free = ~model.parameter_rows["held"].to_numpy(bool)
        ratios = model.parameter_rows["std_error"][free] / fit.bse
        yield compare(
            f"standard errors {step}",
            _BY,
            ratios,
            np.ones(len(ratios)),
            _STANDARD_ERROR_TOLERANCE,
        )
        if number == len(audited.models) - 1:
            covariance = np.array(diagnosis["covariance"])[free][:, free]
            deviation = np.sqrt(np.diag(covariance))
            yield compare(
                "correlations of the estimates",
                _BY,
                covariance / np.outer(deviation, deviation),
                fit.cov_params() / np.outer(fit.bse, fit.bse),
                absolute=_STANDARD_ERROR_TOLERANCE,
            )


def build_mujoco_model(arm: Arm) -> mujoco.MjModel:
    """Build the arm in MuJoCo, with its joints and springs as bodies."""
    tags = ['<mujoco><compiler angle="radian"/><worldbody>']
    bodies = 0
    for element in arm.elements:
        if element.kind == "point":
            for name, (point, offset) in arm.frames.items():
                if point == element.point:
                    position = " ".join(map(str, offset))
                    tags.append(f'<site name="{name}" pos="{position}"/>')
            continue
        bodies += 1
        axis = ["1 0 0", "0 1 0", "0 0 1"][element.axis]
        if element.coordinate is not None:
            joint = "hinge" if element.kind == "R" else "slide"
            tags.append('<body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>')
            tags.append(f'<joint type="{joint}" axis="{axis}"/>')
        elif element.kind == "R":
            tags.append(f'<body axisangle="{axis} {element.amount}">')
        else:
            tags.append(f'<body pos="{axis.replace("1", str(element.amount))}">')
    xml = "".join(tags) + bodies * "</body>" + "</worldbody></mujoco>"
    return mujoco.MjModel.from_xml_string(xml)


def iterate_equilibrium(
    arm: Arm,
    model: mujoco.MjModel,
    springs: np.ndarray,
    angles: np.ndarray,
    wrench: np.ndarray,
    target: Any,
) -> np.ndarray:
    """Iterate the equilibrium of an arm in MuJoCo with its springs.

    Parameters
    ----------
    arm : Arm
    model : the arm in MuJoCo
    springs : (C, C) array, compliance
    angles : (n,) array, commanded joint angles
    wrench : (6,) array, at the last measuring point
    target : name of a target

    Returns
    -------
    (passes, 3) array
        Position of the target, m, after each pass.
    """
    data = mujoco.MjData(model)
    commanded = arm.extend(angles)
    coordinates = commanded
    jacobian = np.zeros((6, model.nv))
    positions = []
    for _ in range(_PASSES + 1):
        data.qpos[:] = arm.order(coordinates)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        positions.append(data.site(f"target {target}").xpos.copy())
        site = model.site("wrench").id
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        coordinates = commanded + springs @ arm.collect(wrench @ jacobian)
    return np.array(positions[1:])


def check_residuals(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """Residuals of positions of sampled rows, before the calibration and with the
    effects found: measured less MuJoCo's."""
    audited = read_audited_campaign(run, campaign)
    frame = run.table(file).query("not gross_error")
    if audited is None:
        return
    rows = frame.iloc[run.pick(file, len(frame))]
    for state, model in (("before", audited.models[0]), ("after", audited.models[-1])):
        if model is not None:
            names = [f"{state}_{name}" for name in COMPONENTS[:3]]
            residuals = frame.loc[~frame["held_out"], names].to_numpy()
            scatter = float(np.sqrt((residuals**2).mean()))
            positions, tolerance = _predict_positions(audited.arm, model, rows, scatter)
            yield compare(
                f"residuals {state}, {len(rows)} rows",
                "MuJoCo",
                rows[names],
                rows[list(POSITION)].to_numpy(float) - positions,
                0.0,
                tolerance,
            )


def _predict_positions(
    arm: Arm, model: FittedModel, rows: pd.DataFrame, scatter_m: float
) -> tuple[np.ndarray, float]:
    """Predict positions (N, 3) of rows by MuJoCo.

    Returns them with their tolerance: estimates may still move by a share of their
    standard errors at the actual scatter, and the package stops after a few passes.
    """
    mujoco_model = build_mujoco_model(arm)
    angles = rows[[f"q{j}" for j in range(1, arm.joints + 1)]].to_numpy(float)
    wrenches = rows[list(WRENCH)].to_numpy(float)
    loads = list(zip(angles, wrenches, rows["target"], strict=True))

    def iterate(springs: np.ndarray) -> np.ndarray:
        """Positions (N, passes, 3) with such springs."""
        return np.array(
            [iterate_equilibrium(arm, mujoco_model, springs, *load) for load in loads]
        )

    passes = iterate(model.springs)
    equilibrium = passes[:, -1]
    tolerance = np.abs(equilibrium - passes[:, _PACKAGE_PASSES - 1]).max()
    tolerance += _POSITION_TOLERANCE_M
    errors = model.parameter_rows["std_error"].fillna(0.0).to_numpy()[:, None, None]
    moves = SETTLED * max(scatter_m / model.noise["position_m"], 1.0) * errors
    for change in moves * model.derivatives:
        tolerance += np.abs(iterate(model.springs + change)[:, -1] - equilibrium).max()
    return equilibrium, tolerance


CHECKS = {
    "results/loop/{campaign}/steps.parquet": check_fits,
    "reports/loop/{campaign}/residuals.parquet": check_residuals,
}
