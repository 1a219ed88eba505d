"""Fits of a campaign: statsmodels' least squares on pinocchio's kinematics at the
estimates that a file states, and residuals from where the robot stands by MuJoCo.

Steps with other effects than joint springs and links of one section, and campaigns with
fitted frames or targets, declared effects or masses, are left out.
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
_TURN = ["rx", "ry", "rz"]
# Steps of a fit end at so many standard errors of the scatter that is there; standard
# errors belong to the step before.
SETTLED = 2e-3
_OF_ERRORS = 1e-3
# So much (m) a fit that is read from a file still moves; the loads of fits are those
# after two passes.
_STEP_BACK = 2e-8
_OF_FITS = 3
# Effects whose formulas are written down here a second time.
_SPRINGS = "joint_compliance"
_LINKS = "link_elasticity"
_OF_LINKS = ("bending_1_over_EI", "torsion_1_over_GJ", "taper")
# Beyond this quantile of the distance from the prediction a measurement loses weight; a
# link's taper is at most this. Links shorter than this (m) do not bend.
_HUBER = 0.99
_LARGEST_TAPER = 0.6
_SHORTEST_M = 0.05
# Each pass leaves some 1/500 of the pass before of the load's change by the deflection.
_PASSES = 8
# Measurements so many times as far from the median of their repeats as repeats usually
# are were not fitted (Hampel).
_FAR = 12.0
_BY = "statsmodels on pinocchio"


@dataclass(frozen=True)
class FittedModel:
    """One model: `parameters` are rows of steps.parquet, `springs` (C, C) and what a
    `unit` (P, C, C) of each adds to them."""

    kind: str
    parameters: pd.DataFrame
    noise: Mapping[str, Any]
    springs: np.ndarray
    units: np.ndarray


@dataclass(frozen=True)
class AuditedCampaign:
    """A campaign of stated springs: rotations of its targets, none where positions
    alone are measured, and its steps, None where one has what is not written down
    here."""

    arm: Arm
    mounts: list[np.ndarray]
    steps: list[FittedModel | None]


def read_audited_campaign(run: FinishedRun, name: str) -> AuditedCampaign | None:
    """A campaign's robot and models; None of one that is left out."""
    described, facts = (
        run.document(f"results/loop/{name}/{part}.json")
        for part in ("campaign", "diagnosis")
    )
    asked = described["campaign"]
    robot = described["robot"]
    targets = list(asked["targets"].values())
    table = run.table(f"results/loop/{name}/steps.parquet")
    known = all(
        target[key] != "unknown"
        for target in targets
        for key in ("offset_m", "rotation")
        if key in target
    )
    fitted = table["owner"].str.contains("frame|session", regex=True).any()
    placed = (
        asked["frame"] == "base" and described.get("held_out") is None and not fitted
    )
    if not known or not placed or asked["declared"] or "masses" in robot:
        return None
    arm = Arm(
        {**robot, "links": {}},
        {
            number: (each["point"], each["offset_m"])
            for number, each in enumerate(targets)
        },
    )
    steps = [
        _step(arm, stated, table[table["step"] == number])
        for number, stated in enumerate(facts["steps"])
    ]
    mounts = [
        pin.exp3(np.array(target.get("rotation", (0.0, 0.0, 0.0)), float))
        for target in targets
    ]
    return AuditedCampaign(arm, mounts if asked["measured"] == "pose" else [], steps)


def _step(
    arm: Arm, stated: Mapping[str, Any], parameters: pd.DataFrame
) -> FittedModel | None:
    links = [key for key in stated["effects"] if key.startswith(_LINKS)]
    # Where a fixed rotation or a coupled joint parts a link, its ends are not those of
    # a stretch of translations.
    chain = arm.document["chain"]
    plain = (
        "deg)" not in chain
        and len(re.findall(r"q\d+", chain)) == arm.joints
        and "one section" in "".join(links)
    )
    if (
        {*stated["effects"]} - {_SPRINGS, *links}
        or len(links) > 1
        or (links and not plain)
    ):
        return None
    values = dict(zip(parameters["parameter"], parameters["value"], strict=True))
    bending, torsion, taper = (values.get(name, 0.0) for name in _OF_LINKS)
    long = {
        number: vector
        for number, vector in enumerate(arm.links)
        if np.linalg.norm(vector) > _SHORTEST_M
    }

    def springs(joints: np.ndarray, *link: float) -> np.ndarray:
        return arm.spring_matrix(
            joints,
            {
                number: compute_link_compliance(vector, *link)
                for number, vector in long.items()
            },
        )

    still = np.zeros(arm.joints)
    small = 1e-4
    slope = (
        springs(still, bending, torsion, taper + small)
        - springs(still, bending, torsion, taper - small)
    ) / (2 * small)
    units = dict(
        zip(
            _OF_LINKS,
            (springs(still, 1, 0, taper), springs(still, 0, 1, taper), slope),
            strict=True,
        )
    )
    units |= {
        f"c{joint}": springs(unit, 0, 0, 0)
        for joint, unit in enumerate(np.eye(arm.joints), 1)
    }
    joints = np.array(
        [values.get(f"c{j}", nominal) for j, nominal in enumerate(arm.compliance, 1)]
    )
    each = np.array([units[name] for name in parameters["parameter"]]).reshape(
        -1, *slope.shape
    )
    return FittedModel(
        stated["kind"],
        parameters,
        stated["noise"],
        springs(joints, bending, torsion, taper),
        each,
    )


def _far_off(frame: pd.DataFrame) -> np.ndarray:
    """Which measurements (N,) are far from the median of at least three repeats, by the
    median distance of all."""
    group = frame.groupby([*_STATE, "target"])[list(POSITION)]
    off = (frame[list(POSITION)] - group.transform("median")).abs().to_numpy()
    apart = off[repeated := group.transform("size").to_numpy() > 2]
    return repeated & (
        off > _FAR * (np.median(apart[apart > 0]) if apart.any() else np.inf)
    ).any(axis=1)


def average_repeats(known: AuditedCampaign, kept: pd.DataFrame) -> pd.DataFrame:
    """Measurements with the repeats of a state averaged; `repeats`: how many, of the
    target that has the fewest."""
    loads = [*(f"q{j}" for j in range(1, known.arm.joints + 1)), *WRENCH]
    kept = kept.assign(**kept.groupby(_STATE)[loads].transform("mean"))
    grouped = kept.groupby([*_STATE, "target"])
    found = (
        grouped[[*loads, *POSITION]]
        .mean()
        .assign(repeats=grouped.size().groupby(_STATE).transform("min"))
    )
    if known.mounts:
        turned = [
            Rotation.from_rotvec(some[_TURN].to_numpy(copy=True)).mean().as_rotvec()
            for _, some in grouped
        ]
        found = found.join(pd.DataFrame(turned, found.index, _TURN))
    return found.reset_index()


def compute_residuals(
    known: AuditedCampaign, springs: np.ndarray, rows: pd.DataFrame
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measured less predicted (M, 3 or 6), m and rad, Jacobians (M, 3 or 6, C) and
    loads (M, C) where the robot has yielded."""
    arm = known.arm
    found = []
    angles = rows[[f"q{j}" for j in range(1, arm.joints + 1)]].to_numpy()
    wrenches = rows[list(WRENCH)].to_numpy()
    seen = rows[[*POSITION, *_TURN] if known.mounts else list(POSITION)].to_numpy()
    for q, wrench, measured, target in zip(
        angles, wrenches, seen, rows["target"], strict=True
    ):
        coordinates, forces = arm.loaded(springs, q, wrench, _PASSES)
        position, rotation = arm.pose(coordinates, target)
        off = [measured[:3] - position]
        if known.mounts:
            off.append(
                pin.log3(pin.exp3(measured[3:]) @ (rotation @ known.mounts[target]).T)
            )
        found.append(
            (
                np.concatenate(off),
                arm.jacobian(coordinates, target)[: len(measured)],
                forces,
            )
        )
    return tuple(np.array(each) for each in zip(*found, strict=True))  # type: ignore[return-value]


def take_least_squares_step(
    known: AuditedCampaign, step: FittedModel, training: pd.DataFrame
) -> tuple[Any, np.ndarray]:
    """One robust least-squares step (Huber) of a model from its estimates: the fit of
    all free parameters, and how far those that can move still do, in standard errors of
    the scatter."""
    seen = average_repeats(known, training)
    residual, jacobian, forces = compute_residuals(known, step.springs, seen)
    slopes = np.einsum("mrc,pcd,md->mrp", jacobian, step.units, forces, optimize=True)
    rows = np.concatenate([slopes, residual[:, :, None]], axis=2)
    of_noise = step.noise, seen, jacobian[:, :, : known.arm.joints]
    distance = np.sqrt((_whitened(*of_noise, rows)[..., -1] ** 2).mean(axis=1))
    # Where scatter is larger than the noise, distances count by that of the middle one.
    count = residual.shape[1]
    scale = max(
        float(np.median(distance) / np.sqrt(stats.chi2.median(count) / count)), 1.0
    )
    weights = HuberT(np.sqrt(stats.chi2.ppf(_HUBER, count) / count)).weights(
        distance / scale
    )
    white = _whitened(*of_noise, np.sqrt(weights)[:, None, None] * rows).reshape(
        -1, rows.shape[2]
    )
    prior, value, error = (
        step.parameters[name].to_numpy() for name in ("prior_std", "value", "std_error")
    )
    below = np.column_stack([np.eye(len(prior)), -value]) / prior[:, None]
    white = np.concatenate([white, below[np.isfinite(prior)]])
    # A taper that is as small as it may be, or as large, does not go on beyond it.
    free = ~step.parameters["held"].to_numpy(bool)
    inside = free & ~(
        np.isin(value, [0.0, _LARGEST_TAPER])
        & (step.parameters["parameter"] == "taper").to_numpy()
    )
    fit, still = (
        sm.OLS(white[:, -1], white[:, :-1][:, some]).fit(
            cov_type="fixed scale", cov_kwds={"scale": 1.0}
        )
        for some in (free, inside)
    )
    return fit, still.params / (scale * error[inside])


def _whitened(
    noise: Mapping[str, Any],
    seen: pd.DataFrame,
    jacobian: np.ndarray,
    values: np.ndarray,
) -> np.ndarray:
    """Values (M, rows, K) over the Cholesky factor of each pose's covariance.

    The sensor's part is of each measurement, that of the joints common to a state,
    another one to a pose.
    """
    rows = jacobian.shape[1]
    found = np.empty(values.shape)
    sensor = np.repeat([noise["position_m"], noise["orientation_rad"]], 3)[:rows] ** 2
    joints = np.array(noise["joint_rad"])
    load = seen["load"].to_numpy()
    repeats = seen["repeats"].to_numpy()
    pose = seen.groupby(_STATE[:2]).ngroup().to_numpy()
    for members in (pose == number for number in np.unique(pose)):
        stacked = jacobian[members].reshape(-1, len(joints))
        alike = np.kron(load[members][:, None] == load[members], np.ones((rows, rows)))
        single = np.diag(np.tile(sensor, members.sum())) + alike * (
            (stacked * joints**2) @ stacked.T
        )
        covariance = (
            single / np.repeat(repeats[members], rows)
            + noise["pose_rad"] ** 2 * stacked @ stacked.T
        )
        block = values[members].reshape(len(stacked), -1)
        found[members] = np.linalg.solve(np.linalg.cholesky(covariance), block).reshape(
            values[members].shape
        )
    return found


def check_fits(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """Estimates and standard errors of every step; correlations of the last. None where
    approaches are recorded."""
    known = read_audited_campaign(run, campaign)
    training = run.table(f"results/loop/{campaign}/training.parquet")
    if known is None or training["approach1"].notna().any():
        return
    stated = run.document(f"results/loop/{campaign}/diagnosis.json")["document"][
        "gross_errors"
    ]
    out = training["row"].isin(
        [row for entry in stated for row in entry["rows"]]
    ) | _far_off(training)
    for number, step in enumerate(known.steps):
        if step is None or step.parameters["held"].all():
            continue
        (fit, moved), words = (
            take_least_squares_step(known, step, training[~out]),
            f"of step {number} ({step.kind})",
        )
        yield compare(
            f"estimates {words} stand still, in standard errors",
            _BY,
            moved,
            0 * moved,
            absolute=SETTLED,
        )
        free = step.parameters[~step.parameters["held"]]
        yield compare(
            f"standard errors {words}",
            _BY,
            free["std_error"] / fit.bse,
            np.ones(len(free)),
            _OF_ERRORS,
        )
        if number == len(known.steps) - 1:
            expected = np.asarray(fit.cov_params()) / np.outer(fit.bse, fit.bse)
            held = step.parameters["held"].to_numpy()
            covariance = np.array(
                run.document(f"results/loop/{campaign}/diagnosis.json")["covariance"]
            )[~held][:, ~held]
            deviation = np.sqrt(np.diag(covariance))
            stored = (covariance / np.outer(deviation, deviation)).ravel()
            yield compare(
                "correlations of the estimates",
                _BY,
                stored,
                expected.ravel(),
                absolute=_OF_ERRORS,
            )


def build_mujoco_model(arm: Arm) -> mujoco.MjModel:
    """The arm by MuJoCo, its joints and springs as bodies."""
    words = ['<mujoco><compiler angle="radian"/><worldbody>']
    opened = 0
    for step in arm.steps:
        if step.kind == "point":
            places = (
                (name, offset)
                for name, (point, offset) in arm.frames.items()
                if point == step.point
            )
            words += [
                f'<site name="{name}" pos="{" ".join(map(str, offset))}"/>'
                for name, offset in places
            ]
            continue
        opened = opened + 1
        axis = ["1 0 0", "0 1 0", "0 0 1"][step.axis]
        if step.coordinate is None:
            moved = axis.replace("1", str(step.amount)) if step.kind == "T" else "0 0 0"
            words.append(
                f'<body pos="{moved}" axisangle="{axis} {step.amount if step.kind == "R" else 0}">'
            )
            continue
        words.append('<body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>')
        words.append(
            f'<joint type="{"hinge" if step.kind == "R" else "slide"}" axis="{axis}"/>'
        )
    return mujoco.MjModel.from_xml_string(
        "".join(words) + opened * "</body>" + "</worldbody></mujoco>"
    )


def iterate_equilibrium(
    arm: Arm,
    model: mujoco.MjModel,
    springs: np.ndarray,
    angles: np.ndarray,
    wrench: np.ndarray,
    target: Any,
) -> Any:
    """Position of a target (passes, 3), m, after each pass towards the equilibrium with
    springs (C, C)."""
    data = mujoco.MjData(model)
    commanded = arm.extend(angles)
    found = []
    rows = np.zeros((6, model.nv))
    coordinates = commanded
    for _ in range(_PASSES + 1):
        data.qpos[:] = arm.ordered(coordinates)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        found.append(data.site(f"target {target}").xpos.copy())
        mujoco.mj_jacSite(model, data, rows[:3], rows[3:], model.site("wrench").id)
        coordinates = commanded + springs @ arm.collected(wrench @ rows)
    return np.array(found[1:])


def check_residuals(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """Residuals of positions of sampled rows, by the declared model and with the
    effects found: measured less MuJoCo's."""
    known = read_audited_campaign(run, campaign)
    frame = run.table(file).query("not gross_error")
    if known is None:
        return
    arm, model, rows = (
        known.arm,
        build_mujoco_model(known.arm),
        frame.iloc[run.pick(file, len(frame))],
    )
    angles = rows[[f"q{j}" for j in range(1, arm.joints + 1)]].to_numpy(float)
    loads = list(
        zip(angles, rows[list(WRENCH)].to_numpy(float), rows["target"], strict=True)
    )
    declared = next(
        step for step in known.steps if step is None or step.kind == "declared"
    )
    for state, step in (("before", declared), ("after", known.steps[-1])):
        if step is None:
            continue
        stands = np.array(
            [iterate_equilibrium(arm, model, step.springs, *load) for load in loads]
        )
        # The fit may go on by thousandths of a standard error of the scatter that is
        # there.
        names = [f"{state}_{name}" for name in COMPONENTS[:3]]
        error = step.parameters["std_error"].fillna(0.0).to_numpy()
        usual = np.sqrt((frame.loc[~frame["held_out"], names].to_numpy() ** 2).mean())
        allowed = _STEP_BACK + np.abs(stands[:, -1] - stands[:, _OF_FITS - 1]).max()
        for more in (
            SETTLED
            * max(usual / step.noise["position_m"], 1.0)
            * error[:, None, None]
            * step.units
        ):
            softer = [
                iterate_equilibrium(arm, model, step.springs + more, *load)[-1]
                for load in loads
            ]
            allowed += np.abs(softer - stands[:, -1]).max()
        expected = rows[list(POSITION)].to_numpy(float) - stands[:, -1]
        yield compare(
            f"residuals {state}, {len(rows)} rows",
            "MuJoCo",
            rows[names],
            expected,
            0.0,
            allowed,
        )


CHECKS = {
    "results/loop/{campaign}/steps.parquet": check_fits,
    "reports/loop/{campaign}/residuals.parquet": check_residuals,
}
