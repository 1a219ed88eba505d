"""What to measure (RQ2), and from how few configurations: kinds of measurement, and strategies with a prior.

Poses, positions of reflectors, one joint at a time, and encoders behind the gears, at equal budgets: one least-squares problem
over all joints for each kind, from the loads of the study. Fewer than ten configurations: strategies with and without a prior,
where nominal compliances are off by a known share.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import joint_torques, loaded_point
from elastocal.random_streams import draw
from elastocal.study.columns import ERROR, LENGTH, SET, STRATEGY, group, real, table, whole
from elastocal.study.equation_11 import Measurements, Prior, condition_numbers, estimate_compliance
from elastocal.study.identify import configuration_first
from elastocal.study.in_memory import ask
from elastocal.study.jobs import MICRO, rows_as_frame, tabulate
from elastocal.study.points import root_mean
from elastocal.study.simulation import Experiments, prefix_index_columns
from elastocal.study.strategies import all_at_once

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy

KINDS = table(
    "kinds",
    group("kind", "what is measured; a row group holds one"),
    whole("scalars", "scalar measurements of one configuration", 1),
    SET,
    LENGTH,
    ERROR,
)
FEW = table(
    "few",
    real("nominal_error", "", "standard deviation of the logarithm of nominal over true compliances"),
    STRATEGY,
    SET,
    LENGTH,
    ERROR,
)
POSE, ENCODERS = "pose", "joint encoders"
ONE_JOINT = ", one joint at a time"


def kind_blocks(
    study: StudyInMemory, reflectors: Mapping[str, Sequence[Sequence[float]]], encoders_rad: Sequence[float]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Mean square error of each data set at every length, by kind of measurement.

    `reflectors`: from the end-effector, in its frame (m), by names of kinds. `encoders_rad`: standard deviations of encoders
    that measure how far a joint yields behind its gear.
    """
    end, n, judge = study.robot.chain.end_effector.name, study.robot.joints, study.judge()
    read, strategy = study.interpretation, all_at_once((end,), n)
    ways = {POSE: replace(read, rows=6, reflectors_m=())}
    ways |= {name: replace(read, rows=3, reflectors_m=tuple(map(tuple, offsets))) for name, offsets in reflectors.items()}
    for sets in study.blocks():
        drawn = study.experiments(sets)
        found: dict[str, Measurements] = {}
        for suffix, experiments in (("", drawn), (ONE_JOINT, one_joint_at_a_time(drawn))):
            for name, way in ways.items():
                found[name + suffix] = replace(study, interpretation=way).measure(sets, (end,), suffix, experiments)[end]
        found |= {f"{ENCODERS}, {1e6 * std:g} µrad": simulate_encoders(study, sets, drawn, std) for std in encoders_rad}
        for kind, measured in found.items():
            compliance, triangles = estimate_compliance(strategy, {end: measured}, n)
            squares = judge.mean_square(compliance)
            squares[np.isnan(condition_numbers(strategy, {end: measured}, triangles))] = np.nan
            scalars = np.full(squares.size, measured.deflection.shape[0])
            yield {**_errors(sets, squares), "kind": kind, "scalars": scalars}


def _errors(sets: np.ndarray, squares: np.ndarray) -> dict[str, np.ndarray]:
    return {**prefix_index_columns(sets, len(squares)), "mean_square": squares.T.ravel()}


def one_joint_at_a_time(experiments: Experiments) -> Experiments:
    """The first configuration of each data set with one joint after the other turned, as in circle point analysis [1].

    The joint that is turned has the angles of the experiments; loads are theirs.

    [1] Mooring, B. W., Roth, Z. S. and Driels, M. R., Fundamentals of Manipulator Calibration, Wiley, 1991.
    """
    drawn = experiments.joint_angles
    numbers = np.arange(drawn.shape[1])
    turned = numbers % drawn.shape[2]
    angles = np.repeat(drawn[:, :1], drawn.shape[1], axis=1)
    angles[:, numbers, turned] = drawn[:, numbers, turned]
    return Experiments(angles, experiments.wrench)


def simulate_encoders(study: StudyInMemory, sets: np.ndarray, drawn: Experiments, std: float) -> Measurements:
    """How far each joint yields, read behind its gear: theta of equation 7 and normal noise of a standard deviation in rad."""
    chain = study.robot.chain
    at = loaded_point(chain, chain.end_effector, study.interpretation.wrench_at)
    torques = joint_torques(chain, drawn.joint_angles, drawn.wrench, at)
    noise = draw(study.seed, study.key, "noise/joint encoders", sets, lambda stream: stream.standard_normal(torques.shape[1:]))
    theta = np.moveaxis(configuration_first(torques * study.robot.compliance + std * noise), -1, 0)
    across = np.moveaxis(configuration_first(torques), -1, 0)
    return Measurements(across[:, None] * np.eye(len(across))[..., None, None], theta)


def few_blocks(
    study: StudyInMemory, strategies: Sequence[Strategy], nominal_errors: Sequence[float]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Mean square error of each data set at every length, by each strategy, of few configurations.

    `nominal_errors`: standard deviations of the logarithm of the nominal compliances over the true ones, which each data set
    has its own of. A strategy without a prior does not look at them; those of points or joints that the robot lacks are left
    out.
    """
    robot, n, judge = study.robot, study.robot.joints, study.judge()
    there = {point.name for point in robot.chain.points}
    strategies = [
        strategy
        for strategy in strategies
        if there.issuperset(strategy.points) and {j for stage in strategy.stages for j in stage.identified} == {*range(n)}
    ]
    points = tuple(dict.fromkeys(name for strategy in strategies for name in strategy.points))
    for sets in study.blocks():
        measurements = study.measure(sets, points)
        normal = draw(study.seed, study.key, "nominal compliances", sets, lambda stream: stream.standard_normal(n)).T
        for error in nominal_errors:
            nominal = robot.compliance[:, None] * np.exp(error * normal)
            for strategy in strategies:
                if strategy.prior_std is None:
                    compliance = study.estimate(strategy, measurements)
                else:
                    prior = Prior(nominal, strategy.prior_std * nominal / study.size.noise)
                    compliance = estimate_compliance(strategy, measurements, n, prior)[0]
                squares = judge.mean_square(compliance)
                yield {**_errors(sets, squares), "nominal_error": np.full(squares.size, error), "strategy": strategy.name}


def kinds_table(found: Mapping[str, pd.DataFrame], length: int) -> pd.DataFrame:
    """Error of one data set by what is measured: in as many configurations, and with as many scalar measurements.

    `length`: configurations; the scalars are those of poses in so many.
    """
    rows = []
    for robot, frame in found.items():
        for (kind, scalars), cell in frame.groupby(["kind", "scalars"], sort=False):
            for configurations in sorted({length, 6 * length // int(str(scalars))}):
                squares = cell.mean_square[cell.length == configurations].to_numpy()
                if len(squares):
                    rms, error = root_mean(squares)
                    head = (robot, kind, scalars, configurations, configurations * int(str(scalars)))
                    rows.append((*head, MICRO * rms, MICRO * error))
    columns = ("robot", "kind", "scalars_per_configuration", "configurations", "scalars")
    return rows_as_frame(rows, (*columns, "rms_um", "rms_um_std_error"))


def few_table(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Error of one data set of few configurations; empty where the configurations do not determine the compliances."""
    rows = []
    for robot, frame in found.items():
        for (error, strategy, length), cell in frame.groupby(["nominal_error", "strategy", "length"], sort=False):
            rms, spread = root_mean(cell.mean_square.to_numpy())
            median = np.sqrt(cell.mean_square.median(skipna=False))
            rows.append((robot, 100 * float(str(error)), strategy, length, MICRO * rms, MICRO * spread, MICRO * median))
    columns = ("robot", "nominal_error_percent", "strategy", "configurations")
    return rows_as_frame(rows, (*columns, "rms_um", "rms_um_std_error", "median_um"))


compare_kinds, compare_few = ask(KINDS, kind_blocks), ask(FEW, few_blocks)
tabulate_kinds, tabulate_few = tabulate(KINDS, kinds_table), tabulate(FEW, few_table)
