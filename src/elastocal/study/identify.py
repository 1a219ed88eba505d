"""Step 3: one strategy on measured data sets, every prefix length."""

from dataclasses import replace

import numpy as np

from elastocal.elastostatics import joint_torques, loaded_point, regressor
from elastocal.gauss_newton import identify_exactly
from elastocal.identification import Readings, first_solvable_length, identify
from elastocal.kinematics import poses_and_jacobians
from elastocal.study.columns import to_deflections, to_experiments
from elastocal.table_schemas import covariance_columns


def paired_blocks(experiments, deflections):
    """Blocks of the experiments with those of the deflections of the same data sets.

    Parameters
    ----------
    experiments : iterable of dict
    deflections : dict of str to iterable of dict
        For each measuring point.

    Yields
    ------
    experiments : dict
    deflections : dict of str to dict
    """
    for block, *measured in zip(experiments, *deflections.values(), strict=True):
        yield block, dict(zip(deflections, measured, strict=True))


def identified_blocks(blocks, chain, strategy, rows, wrench_at, start=None):
    """Compliances, covariances and condition numbers, in blocks.

    Parameters
    ----------
    blocks : iterable of (dict, dict of str to dict)
        Blocks of the experiments table and, for each measuring point, of the deflections table.
    chain : Chain
    strategy : Strategy
    rows : int
        6 where poses are measured, 3 where positions are.
    wrench_at : {"end_effector", "measuring_point"}
        Reading R6.
    start : float, optional
        Given, compliances come from Gauss-Newton on the exact kinematics, started there (rad/(N m)); else from equation 11.

    Yields
    ------
    dict
        Columns of one block of the identified table.
    """
    for experiments, deflections in blocks:
        sets = np.unique(experiments["data_set"])
        situation = Situation(experiments, deflections, chain, strategy, rows, wrench_at)
        estimates = identify(strategy, situation.readings, chain.coordinates)
        if start is not None:
            lengths = range(first_solvable_length(strategy, rows), len(estimates.compliance) + 1)
            exact = np.full_like(estimates.compliance, np.nan)
            exact[lengths[0] - 1 :] = situation.solved_exactly(start, lengths)
            estimates = replace(estimates, compliance=exact)
        yield _columns(sets, estimates)


class Situation:
    """Readings of one block, configuration before data set, ready for either solver.

    Parameters
    ----------
    experiments : dict
    deflections : dict of str to dict
    chain, strategy, rows, wrench_at
        As in `identified_blocks`.

    Attributes
    ----------
    readings : dict of str to Readings
        For equation 11.
    """

    def __init__(self, experiments, deflections, chain, strategy, rows, wrench_at):
        loaded = to_experiments(experiments)
        self.chain, self.strategy = chain, strategy
        self.joint_angles = _configuration_first(loaded.joint_angles)
        wrench = _configuration_first(loaded.wrench)
        self.torques, self.measured, self.readings = {}, {}, {}
        for name in strategy.points:
            point = chain.point(name)
            at = loaded_point(chain, point, wrench_at)
            self.torques[name] = joint_torques(chain, self.joint_angles, wrench, at)
            jacobian = poses_and_jacobians(chain, self.joint_angles, point)[2]
            matrix = np.moveaxis(regressor(jacobian, self.torques[name]), (-2, -1), (0, 1))[:rows]
            self.measured[name] = _configuration_first(to_deflections(deflections[name]))[..., :rows]
            self.readings[name] = Readings(matrix, np.moveaxis(self.measured[name], -1, 0))

    def solved_exactly(self, start, lengths):
        """Compliances by Gauss-Newton from `start`, (lengths, n, sets); see `gauss_newton.identify_exactly`."""
        start = np.full(self.chain.coordinates, start)
        return identify_exactly(self.strategy, self.chain, self.joint_angles, self.torques, self.measured, start, lengths)


def _configuration_first(array):
    """(sets, configurations, k) to (configurations, sets, k) with memory in the order k, configurations, sets."""
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(array, (2, 1, 0), (0, 1, 2))), 0, -1)


def _columns(sets, estimates):
    configurations, joints, _ = estimates.compliance.shape
    columns = {
        "data_set": np.repeat(sets, configurations),
        "length": np.tile(np.arange(1, configurations + 1), len(sets)),
    }
    for j in range(joints):
        columns[f"c{j + 1}"] = estimates.compliance[:, j].T.ravel()
    for name, i, j in covariance_columns(joints):
        columns[name] = estimates.covariance[..., i, j].T.ravel()
    columns["condition"] = estimates.condition.T.ravel()
    return columns
