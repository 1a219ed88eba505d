"""Linear problems of the diagnosing engine, small enough to be worked out densely, and
what that gives."""

from dataclasses import dataclass, replace

import numpy as np

from elastocal.diagnosis.discrepancy import OWN, Discrepancy
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
    """Whitened rows of a made campaign; `white` has them as `products_of` takes them.

    `declared`, `candidates` (R, P), (R, K), `residual` (R,), `jacobian` (R, n), `pose`
    (R,) of int, `prior_std`, `present` (P,).
    """

    declared: np.ndarray
    candidates: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    pose: np.ndarray
    prior_std: np.ndarray
    present: np.ndarray

    def white(self):
        """Observations of one row and one state each: every column displaces a
        coordinate of its own, by one."""
        rows, columns = self.candidates.shape
        declared, jacobian, candidates = (
            part[:, None] for part in (self.declared, self.jacobian, self.candidates)
        )
        made = FactoredSensitivities.of(
            [{column: np.ones(rows)} for column in range(columns)],
            candidates,
            np.arange(rows),
            rows,
        )
        return WhitenedRows(declared, made, self.residual[:, None], jacobian, self.pose)

    @property
    def products(self):
        return compute_cross_products(self.white(), self.prior_std, self.present)

    def covariance(self, tau):
        """Sigma = I + tau^2 J J', dense."""
        together = self.pose[:, None] == self.pose
        return (
            np.eye(len(self.pose)) + tau**2 * self.jacobian @ self.jacobian.T * together
        )

    def marginal_covariance(self, tau):
        """The same with the declared parameters integrated over their prior."""
        return (
            self.covariance(tau) + (self.declared * self.prior_std**2) @ self.declared.T
        )

    @property
    def expected(self):
        """Mean of the residual, from the prior means of the declared parameters."""
        return -self.declared @ self.present

    def drawn(self, rng, tau=0.0):
        """The same with a residual drawn anew: nothing is missing, and declared
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
    """Rows of poses of unequal sizes, in no order."""
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
    """A unit of some columns, each of plausible size one."""
    columns = np.atleast_1d(columns)
    signs = np.full(len(columns), signs, int)
    other = (
        Discrepancy(location, law, 1.0, (), len(columns))
        if mechanism == OTHER
        else None
    )
    return ModelTerm(
        mechanism,
        location,
        candidate,
        shapes,
        columns,
        np.ones(len(columns)),
        signs,
        log_prior,
        other,
        smallest,
    )


def make_problem(rows, units, settings=None, tau=None):
    """The problem of some rows, at the engine's own sizes of the pose error by default,
    and its products."""
    settings = settings or Settings()
    products = rows.products
    if tau is None:
        # In standard errors with which the measurements of one pose determine a joint
        # angle.
        information = (
            np.median(np.bincount(rows.pose, (rows.jacobian**2).sum(axis=1)))
            / rows.jacobian.shape[1]
        )
        tau = np.array(settings.pose_steps) / np.sqrt(information)
    tau = np.asarray(tau, float)
    return SearchProblem(
        compute_statistics(products, tau), tuple(units), settings
    ), products
