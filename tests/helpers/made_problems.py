"""Linear problems of the diagnosis that are small enough for dense matrices, and their
dense covariances."""

from dataclasses import dataclass, replace

import numpy as np

from elastocal.diagnosis.discrepancy import OWN, Discrepancy
from elastocal.diagnosis.evidence import list_pose_errors
from elastocal.diagnosis.hypotheses import OTHER, ModelTerm
from elastocal.diagnosis.search import SearchProblem
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.statistics import (
    WhitenedRows,
    compute_cross_products,
    compute_statistics,
)
from elastocal.fitting.linearization import FactoredSensitivities


@dataclass(frozen=True)
class Rows:
    """Whitened rows of a synthetic campaign.

    Attributes
    ----------
    declared : ndarray (R, P)
        Columns of the declared parameters.
    candidates : ndarray (R, K)
        Columns of the candidates.
    residual : ndarray (R,)
    jacobian : ndarray (R, n)
        Columns of the joint angles, in which the measurements of a pose share an error.
    pose : ndarray of int (R,)
    prior_std, present : ndarray (P,)
        Prior standard deviations of the declared parameters, and their present values.
    """

    declared: np.ndarray
    candidates: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    pose: np.ndarray
    prior_std: np.ndarray
    present: np.ndarray

    def white(self):
        """Return the rows as the library takes them: each is an observation of its own
        state, and each column displaces its own coordinate by one."""
        rows, columns = self.candidates.shape
        candidates = FactoredSensitivities.of(
            [{column: np.ones(rows)} for column in range(columns)],
            self.candidates[:, None],
            np.arange(rows),
            rows,
        )
        return WhitenedRows(
            self.declared[:, None],
            candidates,
            self.residual[:, None],
            self.jacobian[:, None],
            self.pose,
        )

    @property
    def products(self):
        return compute_cross_products(self.white(), self.prior_std, self.present)

    def covariance(self, tau):
        """Compute the dense covariance I + tau^2 J J' within poses."""
        same_pose = self.pose[:, None] == self.pose
        pose_error = tau**2 * self.jacobian @ self.jacobian.T * same_pose
        return np.eye(len(self.pose)) + pose_error

    def marginal_covariance(self, tau):
        """Compute the covariance with the declared parameters integrated over their
        prior."""
        return (
            self.covariance(tau) + (self.declared * self.prior_std**2) @ self.declared.T
        )

    @property
    def expected(self):
        """Mean of the residual if the declared parameters are at their prior means."""
        return -self.declared @ self.present

    def drawn(self, rng, tau=0.0):
        """Return the rows with a new residual: no effect is missing, and the declared
        parameters are at their prior means."""
        common = tau * rng.standard_normal(
            (self.pose.max() + 1, self.jacobian.shape[1])
        )
        noise = rng.standard_normal(len(self.pose)) + (
            self.jacobian * common[self.pose]
        ).sum(axis=1)
        return replace(self, residual=self.expected + noise)


def make_rows(
    seed=0, poses=8, size=(3, 9), declared=4, candidates=6, joints=2, prior=10.0
):
    """Draw rows of poses of different sizes, in random order."""
    rng = np.random.default_rng(seed)
    pose = np.repeat(
        np.arange(poses), rng.integers(size[0], size[1], poses, endpoint=True)
    )
    rng.shuffle(pose)
    count = len(pose)
    rows = Rows(
        declared=rng.standard_normal((count, declared)),
        candidates=rng.standard_normal((count, candidates)),
        residual=np.zeros(count),
        jacobian=rng.standard_normal((count, joints)),
        pose=pose,
        prior_std=prior * rng.uniform(0.5, 2.0, declared),
        present=rng.standard_normal(declared),
    )
    return rows.drawn(rng)


def make_term(
    mechanism,
    location,
    columns,
    signs=0,
    log_prior=0.0,
    candidate=None,
    shapes=(),
    smallest=0,
    law=OWN,
):
    """Make a model term of some columns, each of plausible size one."""
    columns = np.atleast_1d(columns)
    signs = np.full(len(columns), signs, int)
    discrepancy = None
    if mechanism == OTHER:
        discrepancy = Discrepancy(location, law, 1.0, (), len(columns))
    return ModelTerm(
        mechanism,
        location,
        candidate,
        shapes,
        columns,
        np.ones(len(columns)),
        signs,
        log_prior,
        discrepancy,
        smallest,
    )


def make_problem(rows, units, settings=None, tau=None):
    """Make the search problem of some rows, by default with the pose errors that the
    diagnosis tries; return it with the cross products of the rows."""
    settings = settings or Settings()
    products = rows.products
    if tau is None:
        # The unit is the standard error of a joint angle from the measurements of one
        # pose.
        information = (
            np.median(np.bincount(rows.pose, (rows.jacobian**2).sum(axis=1)))
            / rows.jacobian.shape[1]
        )
        tau = list_pose_errors(1.0 / np.sqrt(information), settings)
    tau = np.asarray(tau, float)
    return SearchProblem(
        compute_statistics(products, tau), tuple(units), settings
    ), products
