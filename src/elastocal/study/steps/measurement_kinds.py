"""What to measure (RQ2): poses, positions of reflectors, one joint at a time, and encoders behind the gears, at equal budgets.

One least-squares problem over all joints for each kind, from the loads of the study.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import joint_torques, loaded_point
from elastocal.random_streams import draw
from elastocal.study.experiments import Experiments
from elastocal.study.identification import Measurements, condition_numbers, estimate_compliance
from elastocal.study.metrics import mean_form, mean_square_errors
from elastocal.study.steps.columns import prefix_index_columns
from elastocal.study.steps.design import configuration_first
from elastocal.study.strategies import all_at_once

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from elastocal.study.steps.in_memory import StudyInMemory

POSE, ENCODERS = "pose", "joint encoders"
ONE_JOINT = ", one joint at a time"


def kind_blocks(
    study: StudyInMemory, reflectors: Mapping[str, Sequence[Sequence[float]]], encoders_rad: Sequence[float]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Mean square error of each data set at every length, by kind of measurement.

    `reflectors`: from the end-effector, in its frame (m), by names of kinds. `encoders_rad`: standard deviations of encoders
    that measure how far a joint yields behind its gear. Yields columns of one block of the kinds table: one kind in one block
    of data sets; `scalars`: scalar measurements of one configuration.
    """
    end, n, form = study.robot.chain.end_effector.name, study.robot.joints, mean_form(study.judge())
    read = study.interpretation
    ways = {POSE: replace(read, rows=6, reflectors_m=())}
    ways |= {name: replace(read, rows=3, reflectors_m=tuple(map(tuple, offsets))) for name, offsets in reflectors.items()}
    for sets in study.blocks():
        drawn = study.experiments(sets)
        found: dict[str, Measurements] = {}
        for suffix, experiments in (("", drawn), (ONE_JOINT, one_joint_at_a_time(drawn))):
            for name, way in ways.items():
                found[name + suffix] = replace(study, interpretation=way).measure(sets, (end,), suffix, experiments)[end]
        found |= {f"{ENCODERS}, {1e6 * std:g} µrad": simulate_encoders(study, sets, drawn, std) for std in encoders_rad}
        strategy = all_at_once((end,), n)
        for kind, measured in found.items():
            measurements = {end: measured}
            compliance, triangles = estimate_compliance(strategy, measurements, n)
            squares = mean_square_errors(form, compliance - study.robot.compliance[:, None])
            squares[np.isnan(condition_numbers(strategy, measurements, triangles))] = np.nan
            yield {
                **prefix_index_columns(sets, len(squares)),
                "kind": kind,
                "scalars": np.full(squares.size, measured.deflection.shape[0]),
                "mean_square": squares.T.ravel(),
            }


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
