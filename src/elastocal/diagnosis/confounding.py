"""Mechanisms that are practically not distinguishable on a campaign: one cause, one
name.

No machine follows a modelled law exactly. Two mechanisms are therefore one name with
alternatives if the displacements of one are those of the other within the tolerance of
laws, however small the noise is. The displacements are compared in the metric of the
noise, with the declared parameters eliminated: the share of the squares that the other
mechanism reproduces is the squared cosine of a principal angle [1]_.

The other mechanism reproduces them at the sizes that it reaches, and with as many
parameters as the named one has: a mechanism of many parameters can imitate any other,
and Occam's razor has decided between such two before. Its parameters are chosen by
orthogonal matching pursuit [2]_.

A mechanism may be named only if all that it explains together is significant, by the
score test of a variance component [3]_: many parameters of which each is zero within
its error may be nothing together.

References
----------
.. [1] Björck, Å. and Golub, G. H., Numerical methods for computing angles between
   linear subspaces, Mathematics of Computation 27, 1973.
.. [2] Pati, Y. C., Rezaiifar, R. and Krishnaprasad, P. S., Orthogonal matching pursuit,
   27th Asilomar Conference on Signals, Systems and Computers, 1993.
.. [3] Lin, X., Variance component testing in generalised linear models with random
   effects, Biometrika 84, 1997.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc

from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.refit import predict_reduced_chi_square
from elastocal.diagnosis.search import solve_positive_definite

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.search import ScoredModel, SearchProblem


def find_confounded_mechanisms(
    problem: SearchProblem, model: ScoredModel, mechanism: str
) -> tuple[str, ...]:
    """Find the mechanisms that reproduce what one mechanism of a model explains.

    Parameters
    ----------
    problem
        The linearised problem.
    model
        One of its models.
    mechanism
        Name of a mechanism of the model.

    Returns
    -------
    tuple of str
        Mechanisms that the model does not have, and that reproduce more of the squares
        than one minus the square of the tolerance of laws.
    """
    present = {problem.terms[index].mechanism for index in model.term_indices}
    terms_by_mechanism: dict[str, list[int]] = defaultdict(list)
    for index, term in enumerate(problem.terms):
        if term.mechanism not in {OTHER, *present}:
            terms_by_mechanism[term.mechanism].append(index)
    target = _Target.of_mechanism(problem, model, mechanism)
    return tuple(
        name
        for name, indices in terms_by_mechanism.items()
        if target.is_reproduced_by(indices)
    )


def compute_joint_p_value(
    problem: SearchProblem, model: ScoredModel, mechanism: str
) -> float:
    """Test whether everything that a mechanism of a model explains is significant.

    With G the Gram matrix of its columns given all other terms of the model, b their
    score and S the prior variances, b'(G + S^-1)^-1 b is a weighted sum of squares of
    standard normal numbers if the mechanism is absent. Its distribution is approximated
    by a scaled chi-square of the same mean and variance (Satterthwaite 1946).
    """
    is_own = _find_columns(problem, model, mechanism)
    gram, score = _scale_statistics(problem, model)
    complement = gram[np.ix_(~is_own, ~is_own)] + np.eye((~is_own).sum())
    cross = gram[np.ix_(~is_own, is_own)]
    solution = solve_positive_definite(
        complement, np.column_stack([cross, score[~is_own]])
    )
    conditional = gram[np.ix_(is_own, is_own)] - cross.T @ solution[:, :-1]
    conditional_score = score[is_own] - cross.T @ solution[:, -1]
    values, vectors = np.linalg.eigh(conditional)
    values = np.clip(values, 0.0, None)
    shares = values / (1.0 + values)
    if not shares.any():
        return 1.0
    squares = ((vectors.T @ conditional_score) ** 2 / (1.0 + values)).sum()
    squares /= max(predict_reduced_chi_square(problem, model), 1.0)
    scale = (shares**2).sum() / shares.sum()
    return float(chdtrc(shares.sum() / scale, squares / scale))


def _find_columns(
    problem: SearchProblem, model: ScoredModel, mechanism: str
) -> np.ndarray:
    """Find the columns of a model that are those of a mechanism, (D,) of bool."""
    terms = [problem.terms[index] for index in model.term_indices]
    is_own = np.array([term.mechanism == mechanism for term in terms], bool)
    return np.repeat(is_own, [len(term.columns) for term in terms])


def _scale_statistics(
    problem: SearchProblem, model: ScoredModel
) -> tuple[np.ndarray, np.ndarray]:
    """Gram matrix (D, D) and score (D,) of the columns of a model in units of their
    prior deviations."""
    columns, prior_std = problem.scaled_columns(model.term_indices, model.scales)
    index = problem.statistics.nearest(model.pose_error_rad)
    statistics = problem.statistics.at(slice(index, index + 1))
    gram = prior_std[:, None] * statistics.gram_blocks(columns)[0] * prior_std
    return gram, prior_std * statistics.score[0, columns]


@dataclass(frozen=True)
class _Target:
    """Displacements of a mechanism of a model, which another one may reproduce.

    Attributes
    ----------
    problem
        The linearised problem.
    index
        Index of the pose error of the model.
    columns, coefficients
        (d,), of the mechanism, in plausible sizes.
    companions
        Indices of the other terms of the model, which may take any plausible size.
    """

    problem: SearchProblem
    index: int
    columns: np.ndarray
    coefficients: np.ndarray
    companions: tuple[int, ...]

    @classmethod
    def of_mechanism(
        cls, problem: SearchProblem, model: ScoredModel, mechanism: str
    ) -> _Target:
        """The displacements of a mechanism at the most probable sizes of a model."""
        columns, coefficients, index = problem.find_mode(model)
        is_own = _find_columns(problem, model, mechanism)
        companions = tuple(
            number
            for number in model.term_indices
            if problem.terms[number].mechanism != mechanism
        )
        return cls(problem, index, columns[is_own], coefficients[is_own], companions)

    def is_reproduced_by(self, indices: Sequence[int]) -> bool:
        """Whether terms of one mechanism reproduce the displacements within the
        tolerance of laws."""
        system = self.build_system(self._choose_variants(indices))
        selected: list[int] = []
        for _ in self.columns:
            _, gains = system.solve(selected)
            best = int(np.argmax(gains))
            if gains[best] <= 0.0:
                return False
            selected.append(best)
            explained, _ = system.solve(selected)
            if explained >= self.least_explained:
                return True
        return False

    @cached_property
    def least_explained(self) -> float:
        """Squares that another mechanism must explain to reproduce the displacements:
        of those that the companions leave, all but the tolerance of laws."""
        alone = self.build_system([])
        unexplained = alone.total - alone.solve([])[0]
        return alone.total - self.problem.settings.law_tolerance**2 * unexplained

    def _choose_variants(self, indices: Sequence[int]) -> list[int]:
        """Of the variants at each location, choose the one that reproduces most."""
        variants: dict[object, list[int]] = defaultdict(list)
        for index in indices:
            variants[self.problem.terms[index].slot].append(index)
        contested = [
            index for group in variants.values() if len(group) > 1 for index in group
        ]
        explained = self.compute_explained_squares(contested)
        return [
            max(group, key=lambda index: explained.get(index, 0.0))
            for group in variants.values()
        ]

    def compute_explained_squares(self, indices: Sequence[int]) -> dict[int, float]:
        """Squares that the companions and each single term explain, by the index of the
        term; the companions are eliminated once for all terms."""
        system = self.build_system(indices)
        explained = {}
        first = 0
        for index in indices:
            width = len(self.problem.terms[index].columns)
            explained[index] = system.solve([*range(first, first + width)])[0]
            first += width
        return explained

    def build_system(self, indices: Sequence[int]) -> _RidgeSystem:
        """Build the equations by which the companions and further terms reproduce the
        displacements."""
        problem = self.problem
        numbers = [*self.companions, *indices]
        columns, prior_std = problem.scaled_columns(
            numbers,
            [problem.grid.root_mean_square(problem.terms[index]) for index in numbers],
        )
        count = len(self.columns)
        statistics = problem.statistics.at(slice(self.index, self.index + 1))
        gram = statistics.gram_blocks(np.concatenate([self.columns, columns]))[0]
        products = gram[:, :count] @ self.coefficients
        widths = [len(problem.terms[index].columns) for index in self.companions]
        return _RidgeSystem.eliminate(
            float(self.coefficients @ products[:count]),
            prior_std * products[count:],
            prior_std[:, None] * gram[count:, count:] * prior_std,
            sum(widths),
        )


@dataclass(frozen=True)
class _RidgeSystem:
    """Ridge regression of displacements on R columns in units of their prior
    deviations, beside F companions that every regression has and that are eliminated.

    Attributes
    ----------
    total
        Sum of squares of the displacements.
    companion_products, products
        (F,) and (R,), of the columns with the displacements.
    squares
        (R,) sums of squares of the columns.
    eliminated
        (F, R + 1) solutions of the companions for each column and the displacements.
    precision, score
        (R, R) and (R,), equations of the columns given the companions.
    """

    total: float
    companion_products: np.ndarray
    products: np.ndarray
    squares: np.ndarray
    eliminated: np.ndarray
    precision: np.ndarray
    score: np.ndarray

    @classmethod
    def eliminate(
        cls, total: float, products: np.ndarray, gram: np.ndarray, count: int
    ) -> _RidgeSystem:
        """Eliminate the first columns from the equations of all, with the products of
        the columns with the displacements and with each other."""
        cross = gram[:count, count:]
        eliminated = solve_positive_definite(
            gram[:count, :count] + np.eye(count),
            np.column_stack([cross, products[:count]]),
        )
        own_gram = gram[count:, count:]
        return cls(
            total,
            products[:count],
            products[count:],
            np.diag(own_gram),
            eliminated,
            own_gram + np.eye(len(own_gram)) - cross.T @ eliminated[:, :-1],
            products[count:] - cross.T @ eliminated[:, -1],
        )

    def solve(self, selected: Sequence[int]) -> tuple[float, np.ndarray]:
        """Regress on the companions and the selected columns.

        With coefficients c that solve (G + I) c = p, the regression explains the
        squares 2 c'p - c'G c = c'p + c'c.

        Returns
        -------
        float
            Squares that they explain.
        ndarray
            (R,) squares that each further column would explain by itself; zero for the
            selected ones.
        """
        coefficients = solve_positive_definite(
            self.precision[np.ix_(selected, selected)], self.score[selected]
        )
        companions = (
            self.eliminated[:, -1] - self.eliminated[:, selected] @ coefficients
        )
        explained = coefficients @ (self.products[selected] + coefficients)
        explained += companions @ (self.companion_products + companions)
        gradient = self.score - self.precision[:, selected] @ coefficients
        gains = gradient**2 / (1.0 + self.squares)
        gains[selected] = 0.0
        return float(explained), gains
