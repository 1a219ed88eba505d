"""What the study's assumptions cost: geometry that is known, noise that is the same everywhere, tubes of one diameter (R11).

Unloaded poses y_u = G g + e and loaded ones y_l = G g + A c + e, with g errors of joint zeros and link lengths, c compliances
and e independent noise, are linear in both. Every estimator of them here is linear, too, so that its noise and its leak, which
is what it makes of the parameters that it leaves out, follow in closed form. Equal weights are ordinary against generalized
least squares [1].

[1] Aitken, A. C., On least squares and linear combination of observations, Proceedings of the Royal Society of Edinburgh 55,
    1935.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.planning.designs import mean_squares
from elastocal.io.storage import write_table
from elastocal.mechanics.chain import with_inserted
from elastocal.mechanics.elastostatics import with_tube
from elastocal.mechanics.kinematics import jacobians, poses
from elastocal.study.columns import SET, real, table, text
from elastocal.study.equation_11 import estimate_compliance
from elastocal.study.in_memory import ask, study_of
from elastocal.study.jobs import MICRO, MILLI, Job, below, frames, origin, rows_as_frame, tabulate, write_csvs
from elastocal.study.points import root_mean
from elastocal.study.simulation import bending, find_statistics, true_deflections
from elastocal.study.strategies import all_at_once

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.mechanics.chain import Chain
    from elastocal.mechanics.robot import Robot
    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.simulation import Experiments

GEOMETRY = table(
    "geometry",
    text("estimator", "what is identified from which poses"),
    real("noise", "m", "RMS error of the loaded position by noise"),
    real("leak", "m", "RMS error of the loaded position by what the estimator leaves out"),
    real("compliance_noise", "percent", "relative standard deviation of the compliances, RMS over joints"),
    real("compliance_leak", "percent", "relative leak of geometry into the compliances, RMS over joints"),
    real("zero_noise", "rad", "standard deviation of the joint zeros, RMS over joints"),
    real("zero_leak", "rad", "error of the joint zeros by what is left out, RMS over joints"),
)
WEIGHTING = table(
    "weighting",
    real("orientation_ratio", "rad/m", "noise of orientations over that of positions"),
    real("per_metre", "m/m", "growth of the noise of positions with the tracker's range"),
    real("equal", "m", "RMS error by equal weights"),
    real("weighted", "m", "RMS error by the weights of the noise"),
)
TUBES = table(
    "tubes",
    real("diameter", "m", "outer diameter of the tubes"),
    SET,
    real("mean", "m", "mean over the data set of the end-effector's displacement under load"),
    real("mean_square", "m^2", "mean square of the same"),
    real("maximum", "m", "largest of the same"),
    real("left", "m^2", "mean square end-effector error on test configurations, by joint springs alone"),
)
AT_ONCE, IN_TURN, DIFFERENCES = "at once", "geometry from unloaded poses, then compliances", "compliances from differences"
NO_GEOMETRY, NO_ELASTICITY = "compliances from loaded poses alone", "geometry from all poses alone"
# A leak below this share of a parameter's size is rounding.
_ROUNDING = 1e-9


def geometry_columns(chain: Chain, joint_angles: np.ndarray) -> np.ndarray:
    """Sensitivities of the end-effector's pose to joint zeros and to the lengths of the chain.

    `joint_angles` (..., n). Returns (..., 6, n + L): per rad, and per m for each fixed translation that is not zero.
    """
    lengths = {
        number + 1: [("T", transform.axis)]
        for number, transform in enumerate(chain.transforms)
        if transform.kind == "T" and transform.coordinate is None and transform.constant
    }
    longer = with_inserted(chain, lengths)
    coordinates = np.zeros((*joint_angles.shape[:-1], longer.coordinates))
    coordinates[..., : chain.coordinates] = joint_angles
    return jacobians(longer, coordinates, longer.end_effector)


def linear_estimators(geometry: np.ndarray, elasticity: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The model (sets, 2 rows, G + n) of unloaded and loaded poses, and maps (sets, G + n, 2 rows) from these to parameters.

    `geometry` (sets, rows, G). `elasticity` (sets, rows, n): of the loaded poses in the same configurations.
    """
    model = np.block([[geometry, np.zeros_like(elasticity)], [geometry, elasticity]])
    unloaded, loaded = _pseudo_inverse(geometry), _pseudo_inverse(elasticity)
    no_geometry, no_elasticity = np.zeros_like(unloaded), np.zeros_like(loaded)
    return model, {
        AT_ONCE: _pseudo_inverse(model),
        IN_TURN: np.block([[unloaded, no_geometry], [-loaded @ geometry @ unloaded, loaded]]),
        DIFFERENCES: np.block([[unloaded, no_geometry], [-loaded, loaded]]),
        NO_GEOMETRY: np.block([[no_geometry, no_geometry], [no_elasticity, loaded]]),
        NO_ELASTICITY: np.block([[unloaded / 2, unloaded / 2], [no_elasticity, no_elasticity]]),
    }


def _pseudo_inverse(matrices: np.ndarray) -> np.ndarray:
    """(X'X)^-1 X' by QR, of columns in the size of their norms."""
    scale = np.linalg.norm(matrices, axis=1, keepdims=True)
    basis, triangle = np.linalg.qr(matrices / scale)
    return np.linalg.solve(triangle, basis.swapaxes(1, 2)) / scale.swapaxes(1, 2)


def noise_and_leak(estimator: np.ndarray, model: np.ndarray, noise: float, truth: np.ndarray, random: int) -> list[np.ndarray]:
    """Second moments (G + n, G + n), mean over data sets, of what noise does to the parameters, and of what is wrong without.

    `truth`: sizes of the parameters; the first `random` of them are standard deviations of errors of mean zero, the others the
    same each time.
    """
    spread = noise**2 * estimator @ estimator.swapaxes(1, 2)
    wrong = (estimator @ model - np.eye(len(truth))) * truth
    wrong[np.abs(wrong) < _ROUNDING * truth[:, None]] = 0.0
    drawn, fixed = wrong[..., :random], wrong[..., random:].sum(axis=2)
    missed = drawn @ drawn.swapaxes(1, 2) + fixed[:, :, None] * fixed[:, None, :]
    return [spread.mean(axis=0), missed.mean(axis=0)]


def geometry_rows(study: StudyInMemory, zero_rad: float, length_m: float) -> dict[str, np.ndarray]:
    """Geometry and compliances from as many unloaded as loaded poses of the end-effector, by each estimator.

    `zero_rad`, `length_m`: standard deviations of the errors of joint zeros and link lengths.
    """
    robot, drawn, tests = study.robot, study.experiments(range(study.size.data_sets)), study.tests()
    n, sets = robot.joints, study.size.data_sets
    geometry = geometry_columns(robot.chain, drawn.joint_angles)
    size = geometry.shape[-1]
    there = np.concatenate([geometry_columns(robot.chain, tests.joint_angles), study.regressor(tests)], axis=-1)[0, :, :3]
    moment = mean_squares(there)
    truth = np.concatenate([np.full(n, zero_rad), np.full(size - n, length_m), robot.compliance])
    model, estimators = linear_estimators(geometry.reshape(sets, -1, size), study.regressor(drawn).reshape(sets, -1, n))
    rows = []
    for name, estimator in estimators.items():
        moments = noise_and_leak(estimator, model, study.size.noise, truth, size)
        accuracy = [np.sqrt((moment * each).sum()) for each in moments]
        squares = [np.diagonal(each) for each in moments]
        compliance = [100 * np.sqrt((each[size:] / robot.compliance**2).mean()) for each in squares]
        rows.append((name, *accuracy, *compliance, *(np.sqrt(each[:n].mean()) for each in squares)))
    names = [column.name for column in GEOMETRY.columns]
    columns = dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))
    return columns | {"estimator": columns["estimator"].astype(object)}


def expected_errors(regressor: np.ndarray, deviation: np.ndarray, moment: np.ndarray) -> tuple[float, float]:
    """RMS error (m) by equal weights and by those of the noise, of which the latter is the Cramér-Rao bound.

    `regressor` (sets, rows, n). `deviation` (sets, rows): standard deviation of each measurement, m or rad. `moment` (n, n):
    mean of A^T A where the robot shall be accurate.
    """
    across = regressor.swapaxes(1, 2)
    inverse = np.linalg.inv(across @ regressor)
    scattered = regressor * deviation[..., None]
    sandwich = inverse @ (scattered.swapaxes(1, 2) @ scattered) @ inverse
    white = regressor / deviation[..., None]
    weighted = np.linalg.inv(white.swapaxes(1, 2) @ white)
    equal, best = (float(np.sqrt((moment * covariance.mean(axis=0)).sum())) for covariance in (sandwich, weighted))
    return equal, best


def weighting_rows(
    study: StudyInMemory, orientation_ratios: Sequence[float], tracker_m: Sequence[float], per_metre: Sequence[float]
) -> dict[str, np.ndarray]:
    """Equal weights against those of the noise, measured at the end-effector.

    The noise of the study's size is that of positions. `orientation_ratios`: noise of orientations over that of positions, rad
    per m. `tracker_m`: where the tracker stands. `per_metre`: by which the noise of positions grows with the range, m per m, as
    the root of the sum of squares.
    """
    noise, drawn = study.size.noise, study.experiments(range(study.size.data_sets))
    columns = study.regressor(drawn).reshape(study.size.data_sets, -1, study.robot.joints)
    moment = mean_squares(study.regressor(study.tests())[0, :, :3])
    position = poses(study.robot.chain, drawn.joint_angles, study.robot.chain.end_effector)[0]
    away = np.linalg.norm(position - np.array(tracker_m), axis=-1)
    cases = [(ratio, 0.0) for ratio in orientation_ratios] + [(1.0, grown) for grown in per_metre]
    errors = []
    for ratio, grown in cases:
        deviation = np.full((*away.shape, 6), ratio * noise)
        deviation[..., :3] = np.hypot(noise, grown * away)[..., None]
        errors.append(expected_errors(columns, deviation.reshape(len(away), -1), moment))
    ratios, growths = np.array(cases).T
    equal, weighted = np.array(errors).T
    return {"orientation_ratio": ratios, "per_metre": growths, "equal": equal, "weighted": weighted}


def tube_blocks(study: StudyInMemory, factors: Sequence[float], length: int) -> Iterator[dict[str, np.ndarray]]:
    """Deflection before calibration and what joints alone leave, for each diameter of the tubes.

    `study`: of a robot with links, all of one tube. `factors`: by which the diameter is another one. `length`: configurations
    from which the compliances of the joints are identified.
    """
    tube, point = study.robot.links[0].tube, study.robot.chain.end_effector.name
    n, sets = study.robot.joints, np.arange(study.size.data_sets)
    drawn, strategy = study.experiments(sets), all_at_once((point,), n)
    for factor in factors:
        diameter = factor * tube.outer_diameter_m
        other = replace(study, robot=with_tube(study.robot, replace(tube, outer_diameter_m=diameter)))
        short = replace(other, size=replace(study.size, configurations=length))
        compliance = estimate_compliance(strategy, short.measure(sets, (point,)), n)[0][-1]
        yield {
            "diameter": np.full(len(sets), diameter),
            "data_set": sets,
            **bending(other.deflections(drawn)),
            "left": other.judge().mean_square(compliance),
        }


def diameter_for_mean_deflection(
    robot: Robot, experiments: Experiments, target_m: float, between_m: tuple[float, float] = (0.1, 0.8)
) -> float:
    """Outer diameter (m) of the tubes, at their wall, for which the mean end-effector deflection comes out, by Brent's method.

    One figure of the paper fixes this one free size of the extended robot (interpretation R11). `robot`: with links, all of one
    tube. `target_m`: mean over the experiments of the norm of the displacement. `between_m`: diameters to search.
    """
    from scipy.optimize import brentq

    def excess(diameter: float) -> float:
        candidate = with_tube(robot, replace(robot.links[0].tube, outer_diameter_m=diameter))
        deflections = true_deflections(candidate, experiments, robot.chain.end_effector, "end_effector")
        return np.linalg.norm(deflections[..., :3], axis=-1).mean() - target_m

    return brentq(excess, *between_m, xtol=1e-6)


def geometry_table(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Geometry and compliances together, one after the other, or alone; rms_um has the parts noise_um and leak_um."""
    frame = below(found)
    part = frame[["robot", "estimator"]].assign(rms_um=MICRO * np.hypot(frame.noise, frame.leak))
    part = part.join((MICRO * frame[["noise", "leak"]]).add_suffix("_um"))
    part = part.join(frame[["compliance_noise", "compliance_leak"]].add_suffix("_percent"))
    return part.join((MICRO * frame[["zero_noise", "zero_leak"]]).add_suffix("_urad"))


def weighting_table(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """What equal weights cost; ratio: of the errors by equal weights and by those of the noise."""
    frame = below(found)
    part = frame[["robot", "orientation_ratio"]].join((MICRO * frame[["per_metre", "equal", "weighted"]]).add_suffix("_um"))
    return part.assign(ratio=frame.equal / frame.weighted)


def tubes_table(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Deflections before calibration in single data sets, and what joint springs alone leave, by the diameter of the tubes.

    The deflections have their standard deviations between data sets beside them (mean_mm_between ...).
    """
    rows = []
    for robot, frame in found.items():
        for diameter, cell in frame.groupby("diameter", sort=False):
            bends = [each for values in find_statistics(cell).values() for each in (values.mean(), values.std(ddof=1))]
            left, error = root_mean(cell.left.to_numpy())
            rows.append((robot, MILLI * float(str(diameter)), *(MILLI * each for each in bends), MICRO * left, MICRO * error))
    names = ["robot", "diameter_mm", *(f"{name}_mm{more}" for name in ("mean", "std", "max") for more in ("", "_between"))]
    return rows_as_frame(rows, [*names, "left_um", "left_um_std_error"])


def vary_assumptions(job: Job) -> None:
    """Geometry and weights on one robot."""
    study = study_of(job)
    write_table(job.output.geometry, GEOMETRY, [geometry_rows(study, **job.params.geometry)], origin(job))
    write_table(job.output.weighting, WEIGHTING, [weighting_rows(study, **job.params.weighting)], origin(job))


def tabulate_assumptions(job: Job) -> None:
    """Of all robots."""
    write_csvs(
        job,
        geometry=geometry_table(frames(job, job.input.geometries, GEOMETRY)),
        weighting=weighting_table(frames(job, job.input.weightings, WEIGHTING)),
    )


vary_tubes = ask(TUBES, tube_blocks)
tabulate_tubes = tabulate(TUBES, tubes_table)
