"""Fits of a campaign, worked out again: statsmodels on pinocchio's kinematics at the estimates that a file states.

What is checked of a step is that its estimates are where iteratively reweighted least squares stand still, and that its
standard errors are those of the regressors there. A step that has effects other than joint springs and bending links, fitted
frames or targets, or declared masses is left out.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import statsmodels.api as sm
from scipy import stats
from statsmodels.robust.norms import HuberT

from elastocal_proof.audit.audited import COMPONENTS
from elastocal_proof.audit.elastic import STATE, Averages, Robot, Springs, averages, far_off, good_rows
from elastocal_proof.audit.findings import Finding, compare, require

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from elastocal_proof.audit.audited import Audited

# Effects whose formulas are written down here a second time.
_SPRINGS, _LINKS = "joint_compliance", "link_elasticity"
_BENDING, _TORSION, _TAPER = "bending_1_over_EI", "torsion_1_over_GJ", "taper"
# A fit stops at steps of a thousandth of a standard error of the scatter that is there.
SETTLED = 2e-3
# Standard errors belong to the estimates one such step before.
_OF_ERRORS = 1e-3
# A fit that is read from a file goes on from there: a thousandth of a standard error displaces by less than this (m, rad).
STEP_BACK = 2e-8
# Beyond this quantile of the distance from the prediction a measurement loses weight.
_HUBER = 0.99
# A link's taper is between none and this.
_LARGEST_TAPER = 0.6
# Of a taper; for its slope.
_DIFFERENCE = 1e-4
_BY = "statsmodels on pinocchio"


@dataclass(frozen=True)
class Step:
    """One model of a campaign: `parameters` are rows of steps.parquet, `noise` is that of diagnosis.json."""

    kind: str
    parameters: pd.DataFrame
    noise: Mapping[str, Any]
    springs: Springs

    @property
    def free(self) -> np.ndarray:
        """Which parameters were fitted."""
        return ~self.parameters["held"].to_numpy(bool)

    @property
    def inside(self) -> np.ndarray:
        """Which of these can move: a taper that is as small as it may be, or as large, does not go on beyond it."""
        ends = self.parameters["value"].isin([0.0, _LARGEST_TAPER]) & (self.parameters["parameter"] == _TAPER)
        return self.free & ~ends.to_numpy()


@dataclass(frozen=True)
class Campaign:
    """A campaign whose models can be worked out again.

    `poses`: whether orientations were measured. `steps`: in the order of the files; None where a step has what is not written
    down here. `training`: what was fitted, `seen` with the repeats averaged.
    """

    robot: Robot
    poses: bool
    steps: list[Step | None]
    training: pd.DataFrame
    seen: Averages


def campaign_of(run: Audited, name: str) -> Campaign | None:
    """A campaign's robot and models.

    Returns None where frames or targets are fitted, the approach is recorded, or the robot file declares masses or no springs.
    """
    described = run.document(f"results/loop/{name}/campaign.json")
    asked, robot = described["campaign"], described["robot"]
    targets = list(asked["targets"].values())
    known = all(target[key] != "unknown" for target in targets for key in ("offset_m", "rotation") if key in target)
    weightless = "masses" not in robot and "compliance_urad_per_Nm" in robot
    placed = asked["frame"] == "base" and known and not asked["declared"] and described.get("held_out") is None
    if not placed or not weightless or run.table(f"results/loop/{name}/training.parquet")["approach1"].notna().any():
        return None
    compliant, facts = Robot(robot, targets), run.document(f"results/loop/{name}/diagnosis.json")
    table = run.table(f"results/loop/{name}/steps.parquet")
    nominal = 1e-6 * np.array(robot["compliance_urad_per_Nm"], float)
    # Where a fixed rotation or a coupled joint parts a link, its ends are not those of a stretch of translations.
    plain = "deg)" not in robot["chain"] and len(re.findall(r"q\d+", robot["chain"])) == compliant.joints
    steps = [_step(stated, table[table["step"] == number], nominal, plain) for number, stated in enumerate(facts["steps"])]
    poses, training = asked["measured"] == "pose", good_rows(run, name, "training")
    return Campaign(compliant, poses, steps, training, averages(training, poses))


def _step(stated: Mapping[str, Any], parameters: pd.DataFrame, nominal: np.ndarray, plain: bool) -> Step | None:
    links = [key for key in stated["effects"] if key.startswith(_LINKS)]
    # One section of all links; links of their own sections are not written down here.
    if {*stated["effects"]} - {_SPRINGS, *links} or len(links) > 1 or (links and not (plain and "one section" in links[0])):
        return None
    values = dict(zip(parameters["parameter"], parameters["value"], strict=True))
    joints = np.array([values.get(f"c{j}", c) for j, c in enumerate(nominal, 1)])
    springs = Springs(joints, *(values.get(name, 0.0) for name in (_BENDING, _TORSION, _TAPER)))
    return Step(stated["kind"], parameters, stated["noise"], springs)


def fits(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Noise, estimates and standard errors of every step."""
    known = campaign_of(run, campaign)
    stated = run.document(f"results/loop/{campaign}/diagnosis.json")["document"].get("noise") or {}
    for number, step in enumerate(known.steps if known else ()):
        if step is None or known is None:
            continue
        # Most steps go by the noise of the one before.
        earlier = known.steps[number - 1] if number else None
        if earlier is None or earlier.noise != step.noise:
            yield from _noise(number, step, known, stated.get("factor", 1.0))
        if not len(step.parameters):
            continue
        error, inside = step.parameters["std_error"].to_numpy(), step.inside
        columns, residual, scale = _whiten(step, known.seen, known.robot)
        moved = _least_squares(columns[:, inside], residual).params / (scale * error[inside])
        checked = f"estimates of step {number} ({step.kind}) stand still, in standard errors"
        yield compare(checked, _BY, moved, np.zeros(len(moved)), absolute=SETTLED)
        expected = _least_squares(columns[:, step.free], residual).bse
        yield compare(
            f"standard errors of step {number} ({step.kind})", _BY, error[step.free], expected, _OF_ERRORS, scale=expected
        )


def _noise(number: int, step: Step, known: Campaign, factor: float) -> Iterator[Finding]:
    """Noise of a measurement from the repeats about their means, where the joints have no part in it.

    Where measurements scatter more about the model than about each other, it may be larger by the factor that is stated.
    """
    noise = step.noise
    if noise["source"] != "repeats" or any(noise["joint_rad"]) or noise["pose_rad"] or noise["usual_m"]:
        return
    near = known.training[~far_off(known.training)]
    repeated = near[near.groupby([*STATE, "target"])["row"].transform("size") > 1]
    residual, groups = residuals_of(known, step, repeated), repeated.groupby([*STATE, "target"]).ngroup().to_numpy()
    off = residual - pd.DataFrame(residual).groupby(groups).transform("mean").to_numpy()
    free, squares = len(groups) - len(np.unique(groups)), (off**2).sum(axis=0)
    expected = np.sqrt(squares.reshape(-1, 3).sum(axis=1) / (3 * free))
    stated = np.array([noise["position_m"], noise["orientation_rad"]])[: len(expected)]
    if abs(stated[0] / factor - expected[0]) < abs(stated[0] - expected[0]):
        stated = stated / factor
    yield compare(f"noise of step {number}, from repeats", "pandas on pinocchio", stated, expected, 1e-4)
    yield compare(f"repeats of step {number}", "counting", noise["degrees_of_freedom"], len(squares) * free, 0.0)


def correlations(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Correlations of the estimates of the last step."""
    known = campaign_of(run, campaign)
    step = known.steps[-1] if known else None
    if known is None or step is None or not step.free.any():
        return
    table, names = run.table(file), (step.parameters["owner"] + " " + step.parameters["parameter"]).to_numpy()[step.free]
    columns, residual, _ = _whiten(step, known.seen, known.robot)
    covariance = np.asarray(_least_squares(columns[:, step.free], residual).cov_params())
    deviation, place = np.sqrt(np.diag(covariance)), {name: number for number, name in enumerate(names)}
    one, other = (np.array([place[name] for name in table[end]], int) for end in ("one", "other"))
    every = len({*map(frozenset, zip(one, other, strict=True))}) == len(names) * (len(names) - 1) // 2 == len(table)
    note = f"{len(table)} of {len(names)} parameters"
    yield require("every pair of parameters once", "counting", every, note, len(table))
    expected = (covariance / np.outer(deviation, deviation))[one, other]
    yield compare("correlations of the estimates", _BY, table["correlation"], expected, absolute=_OF_ERRORS)


def predictions(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Residuals of all measurements, fitted and held out, by the declared and by the final model."""
    known = campaign_of(run, campaign)
    if known is None:
        return
    table, names = run.table(file), COMPONENTS if known.poses else COMPONENTS[:3]
    declared = next(step for step in known.steps if step is None or step.kind == "declared")
    for state, step in (("before", declared), ("after", known.steps[-1])):
        if step is None:
            continue
        stored, expected = [], []
        for part in ("training", "held_out"):
            mine = table[table["held_out"] == (part == "held_out")].sort_values("row")
            stored.append(mine[[f"{state}_{name}" for name in names]].to_numpy())
            measured = run.table(f"results/loop/{campaign}/{part}.parquet").sort_values("row")
            expected.append(residuals_of(known, step, measured))
        pair = np.concatenate(stored), np.concatenate(expected)
        checked = f"residuals {state}, fitted and held out, all rows"
        yield compare(checked, "pinocchio", *pair, 0.0, unsettled(step, known))


def _least_squares(columns: np.ndarray, residual: np.ndarray) -> Any:
    """Ordinary least squares of whitened rows, whose variance is one."""
    return sm.OLS(residual, columns).fit(cov_type="fixed scale", cov_kwds={"scale": 1.0})


def _whiten(step: Step, seen: Averages, robot: Robot) -> tuple[np.ndarray, np.ndarray, float]:
    """Weighted, whitened regressors and residual with rows for the priors below them, and the scale of the scatter."""
    loaded = robot.all_loaded(step.springs, seen)
    residual, jacobian = robot.residuals(loaded, seen), robot.jacobians(loaded, seen)
    units = _units(step, robot)
    moved = np.stack([units @ forces for _, forces in loaded])
    rows = np.concatenate([jacobian @ moved[seen.state].transpose(0, 2, 1), residual[:, :, None]], axis=2)
    blocks = _whitener(step.noise, seen, jacobian[:, :, : robot.joints])
    distance = np.sqrt((_apply(blocks, rows[..., -1:]) ** 2).mean(axis=(1, 2)))
    # Where scatter is larger than the noise, distances count by that of the middle one.
    count = residual.shape[1]
    scale = max(float(np.median(distance) / np.sqrt(stats.chi2.median(count) / count)), 1.0)
    weights = HuberT(np.sqrt(stats.chi2.ppf(_HUBER, count) / count)).weights(distance / scale)
    white = _apply(blocks, np.sqrt(weights)[:, None, None] * rows).reshape(-1, rows.shape[2])
    prior = step.parameters["prior_std"].to_numpy()
    known = np.isfinite(prior)
    below = (np.eye(len(prior)) / np.where(known, prior, 1.0)[:, None])[known]
    value = (step.parameters["value"].to_numpy() / prior)[known]
    return np.vstack([white[:, :-1], below]), np.concatenate([white[:, -1], -value]), scale


def unsettled(step: Step, known: Campaign) -> float:
    """By how much (m, rad) a prediction moves, at most, where a fit goes on from its estimates to where it stands still."""
    inside, robot, seen = step.inside, known.robot, known.seen
    if not inside.any():
        return STEP_BACK
    columns, residual, _ = _whiten(step, seen, robot)
    left = np.abs(_least_squares(columns[:, inside], residual).params)
    loaded = robot.all_loaded(step.springs, seen)
    moved = np.stack([_units(step, robot)[inside] @ forces for _, forces in loaded])
    return STEP_BACK + float((np.abs(robot.jacobians(loaded, seen) @ moved[seen.state].transpose(0, 2, 1)) @ left).max())


def _units(step: Step, robot: Robot) -> np.ndarray:
    """What a unit of each parameter makes of the loads on the coordinates, (P, C, C)."""
    springs, still, found = step.springs, np.zeros(robot.joints), []
    for name in step.parameters["parameter"]:
        if name == _TAPER:
            ends = (springs.taper + _DIFFERENCE, springs.taper - _DIFFERENCE)
            more, less = (robot.compliance(Springs(still, springs.bending, springs.torsion, taper)) for taper in ends)
            found.append((more - less) / (2 * _DIFFERENCE))
        elif name in (_BENDING, _TORSION):
            found.append(robot.compliance(Springs(still, float(name == _BENDING), float(name == _TORSION), springs.taper)))
        else:
            found.append(robot.compliance(Springs(np.eye(robot.joints)[int(name[1:]) - 1])))
    return np.array(found)


def _whitener(noise: Mapping[str, Any], seen: Averages, jacobian: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each pose its measurements and the inverse Cholesky factor of their covariance.

    The sensor's part is of each measurement, that of the joints common to a state, another one to a pose.
    """
    rows, joints = jacobian.shape[1], np.array(noise["joint_rad"])
    sensor = np.repeat([noise["position_m"], noise["orientation_rad"]], 3)[:rows] ** 2
    poses, repeats, found = seen.pose, seen.repeats, []
    for pose in np.unique(poses):
        members = np.flatnonzero(poses == pose)
        stacked = jacobian[members].reshape(len(members) * rows, -1)
        alike = np.kron(seen.state[members][:, None] == seen.state[members], np.ones((rows, rows)))
        single = np.diag(np.tile(sensor, len(members))) + alike * ((stacked * joints**2) @ stacked.T)
        covariance = single / np.repeat(repeats[members], rows) + noise["pose_rad"] ** 2 * stacked @ stacked.T
        found.append((members, np.linalg.inv(np.linalg.cholesky(covariance))))
    return found


def _apply(blocks: Sequence[tuple[np.ndarray, np.ndarray]], values: np.ndarray) -> np.ndarray:
    """Whitened rows (M, rows, K)."""
    found = np.empty(values.shape)
    for members, factor in blocks:
        some = values[members]
        found[members] = (factor @ some.reshape(len(factor), -1)).reshape(some.shape)
    return found


def residuals_of(known: Campaign, step: Step, measured: pd.DataFrame) -> np.ndarray:
    """Residual (N, 3 or 6) of every single measurement, in the order of the rows of a table."""
    approach = [*STATE, "repeat"]
    order = measured.reset_index(drop=True).sort_values([*approach, "target"])
    seen = averages(order.assign(load=order.groupby(approach).ngroup()), known.poses)
    found = np.empty((len(measured), 6 if known.poses else 3))
    found[order.index] = known.robot.residuals(known.robot.all_loaded(step.springs, seen), seen)
    return found


CHECKS = {
    "results/loop/{campaign}/steps.parquet": fits,
    "results/loop/{campaign}/correlations.parquet": correlations,
    "reports/loop/{campaign}/residuals.parquet": predictions,
}
