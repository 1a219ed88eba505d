"""A study over again, and what its scores are expected to be: how far a printed figure may lie from another one.

Further studies have data sets that no other one has, and nothing of these is kept. The expectations are closed forms to second
order, without simulation. Let an unbiased estimate of a compliance be normal with mean c and standard deviation s. A Taylor
series gives the mean of its inverse (the delta method to second order [1]), E[1/c_hat] = (1 + s^2/c^2 + 3 s^4/c^4 + ...) / c,
so that the averaged stiffness is too large by delta_k = s^2 / c^2, however many data sets there are. s^2 falls as one over the
number of configurations, and with it every score of the averaged model.

[1] Casella, G. and Berger, R. L., Statistical Inference, section 5.5.4, 2nd edition, Duxbury, 2002.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln

from elastocal.io.storage import Column, TableSchema, read_blocks, read_table, write_table
from elastocal.study.columns import LENGTH, STRATEGY, real, table, whole
from elastocal.study.evaluation import SCORES, average, judge_of, metrics, score_columns
from elastocal.study.identify import covariance_columns, design
from elastocal.study.in_memory import study_of
from elastocal.study.jobs import Job, origin, robot_of, strategies_of
from elastocal.study.metrics import signed_deviation
from elastocal.study.simulation import data_sets
from elastocal.study.strategies import strategy_from_document

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from elastocal.mechanics.robot import Robot
    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.metrics import Judge
    from elastocal.study.strategies import Strategy

_LARGE_SHAPE = 1e4


def _scores(joints: int) -> list[Column]:
    """Scores of the averaged model, without errors."""
    of_joint = "as in the metrics, of joint"
    compliances = [real(f"compliance_{j}", "rad/(N m)", f"{of_joint} {j}", missing=True) for j in range(1, joints + 1)]
    return [LENGTH, *compliances, *SCORES]


def repeated(joints: int) -> TableSchema:
    """Scores of further studies of the same size; one row for each study, strategy and length."""
    other = "by the mean of the compliances where the metrics have that of the stiffnesses"
    everything = "data sets, configurations and coordinates"
    return table(
        "repeated",
        whole("study", "number of the study, from 1; that of the tables is number 0", 1),
        STRATEGY,
        *_scores(joints),
        real("k_sigma_mean_compliance", "percent", f"sum of delta_k over all joints, {other}", missing=True),
        real("k_sigma_fixed_joints_mean_compliance", "percent", f"the same of the fixed joints, {other}", missing=True),
        real("deviation_mean_compliance", "m", f"deviation {other}", missing=True),
        real("deviation_signed", "m", f"position error with its sign, mean over {everything}", missing=True),
        real("mean_square", "m^2", "mean square end-effector error of single data sets", missing=True),
    )


def expected(joints: int) -> TableSchema:
    """Expectations of the scores in closed form; one row for each length."""
    return table("expected", *_scores(joints))


def model_columns(
    compliance: np.ndarray, deviation: np.ndarray, robot: Robot, fixed_joints: Sequence[int]
) -> dict[str, np.ndarray]:
    """Columns of an averaged model and its scores, one row for each length, of compliances (lengths, n)."""
    return {
        "length": np.arange(1, len(compliance) + 1),
        **{f"compliance_{j + 1}": compliance[:, j] for j in range(compliance.shape[1])},
        **score_columns(compliance, deviation, robot.compliance, fixed_joints),
    }


def repeated_blocks(
    study: StudyInMemory, studies: Iterable[int], strategies: Sequence[Strategy]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Scores of studies of these numbers, block by block one strategy in one study."""
    robot, read, tests = study.robot, study.interpretation, np.ones((1, study.size.tests))
    for number in studies:
        judge, found = study.judge(number), study.estimates(strategies, number)
        for strategy in strategies:
            blocks = [(compliance, np.ones((1, len(compliance)))) for compliance in found[strategy.name]]
            averages = average(blocks, judge, read.average, read.deviation_of, tests)
            plain = average(blocks, judge, "compliance", "averaged_model", tests)
            fixed = strategy.fixed_joints
            others = score_columns(plain.compliance[0], plain.deviation[0], robot.compliance, fixed)
            squares = [judge.mean_square(np.moveaxis(each, 0, -1)) for each, _ in blocks]
            yield {
                **model_columns(averages.compliance[0], averages.deviation[0], robot, fixed),
                **{f"{name}_mean_compliance": values for name, values in others.items()},
                "deviation_signed": signed_deviation(judge, plain.compliance[0]),
                "mean_square": np.concatenate(squares, axis=1).mean(axis=1),
                "study": np.full(len(squares[0]), number),
                "strategy": strategy.name,
            }


def expected_compliance(noise_free: np.ndarray, variance: np.ndarray, method: str) -> np.ndarray:
    """Expected compliance (..., n) of the averaged model (equation 12).

    `noise_free` (..., n): estimates without noise, which the linearisation alone takes off the truth, rad/(N m). `variance`
    (..., n): of the estimates, mean over data sets. `method`: what is averaged (interpretation R7); the mean and the median of
    a normal estimate have no bias.
    """
    return noise_free / (1.0 + variance / noise_free**2) if method == "stiffness" else noise_free


def expected_deviation(judge: Judge, compliance: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Expected position error (L,), m, of a model whose compliances are normal, mean over the test configurations.

    The squared error is a quadratic form in normal variables; its square root has the mean that it has under the gamma
    distribution of the same mean and variance [1], [2], which is exact where one direction dominates and in the limit of no
    scatter. `compliance` (L, n): mean. `covariance` (L, n, n).

    [1] Satterthwaite, F. E., An approximate distribution of estimates of variance components, Biometrics Bulletin 2, 1946.
    [2] Box, G. E. P., Some theorems on quadratic forms applied in the study of analysis of variance problems I, Annals of
        Mathematical Statistics 25, 1954.
    """
    forms = judge.forms
    inner = forms[:, :-1, :-1]
    found = np.empty(len(compliance))
    for place, (error, spread) in enumerate(zip(compliance - judge.reference, covariance, strict=True)):
        whole = np.append(error, 1.0)
        slope = forms[:, :-1] @ whole
        scattered = inner @ spread
        mean = (forms @ whole) @ whole + np.trace(scattered, axis1=1, axis2=2)
        variance = 2 * (scattered * scattered.swapaxes(1, 2)).sum(axis=(1, 2)) + 4 * ((slope @ spread) * slope).sum(axis=1)
        found[place] = _mean_root(mean, variance).mean()
    return found


def _mean_root(mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Mean of the root of gamma variables."""
    with np.errstate(divide="ignore"):
        shape = mean**2 / variance
    # The ratio of gamma functions by its series where it is the difference of large numbers.
    large = shape > _LARGE_SHAPE
    few = np.where(large, 1.0, shape)
    ratio = np.where(large, 1.0 - 0.125 / shape, np.exp(gammaln(few + 0.5) - gammaln(few)) / np.sqrt(few))
    return np.sqrt(mean) * ratio


def expected_scores(
    design_blocks: Iterable[Mapping[str, np.ndarray]],
    noise_free: np.ndarray | None,
    noise: float,
    robot: Robot,
    judge: Judge,
    fixed_joints: Sequence[int],
    method: str,
    deviation_of: str,
) -> dict[str, np.ndarray]:
    """Expectations at every length; not a number where some data set does not determine the compliances.

    `design_blocks`: blocks of the design table. `noise_free` (lengths, n): compliances of the averaged model without noise,
    rad/(N m): what the linearisation does. None: the true ones. `noise`: standard deviation, the same number in m and rad.
    `method`, `deviation_of`: interpretations R7 and R8, see `evaluation.average`.
    """
    n, sets, total = robot.joints, 0, np.zeros(())
    for block in design_blocks:
        count = len(data_sets(block))
        covariance = np.empty((len(block["length"]) // count, n, n))
        for name, i, j in covariance_columns(n):
            covariance[:, i, j] = covariance[:, j, i] = block[name].reshape(count, -1).sum(axis=0, dtype=float)
        total, sets = total + covariance, sets + count
    covariance = noise**2 * total / sets
    start = np.broadcast_to(robot.compliance, covariance.shape[:2]) if noise_free is None else noise_free
    compliance = expected_compliance(start, np.diagonal(covariance, axis1=1, axis2=2), method)
    # The mean over so many data sets scatters by so much less.
    scatter = covariance / sets if deviation_of == "averaged_model" else covariance
    return model_columns(compliance, expected_deviation(judge, compliance, scatter), robot, fixed_joints)


def repeat_studies(job: Job) -> None:
    """Further studies of one robot under one interpretation."""
    study = study_of(job)
    blocks = repeated_blocks(study, range(1, job.params.studies + 1), strategies_of(job))
    write_table(job.output.repeated, repeated(study.robot.joints), blocks, origin(job))


def expect(job: Job) -> None:
    """Expectations of the scores of one strategy on one robot in closed form."""
    asked, robot = job.params, robot_of(job)
    n, noise_free = robot.joints, None
    if job.input.get("noise_free"):
        averaged = [f"compliance_{j + 1}" for j in range(n)]
        columns = read_table(job.input.noise_free, metrics(n), averaged)
        noise_free = np.column_stack([columns[name] for name in averaged])
    scores = expected_scores(
        read_blocks(job.input.design, design(n)),
        noise_free,
        1e-6 * float(job.wildcards.noise),
        robot,
        judge_of(job, robot),
        strategy_from_document(asked.strategy).fixed_joints,
        asked.average,
        asked.deviation_of,
    )
    write_table(job.output.expected, expected(n), [scores], origin(job))
