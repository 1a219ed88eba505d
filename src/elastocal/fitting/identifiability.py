"""What the data identify: least squares over that alone, all else held at its value and named."""

import numpy as np
from scipy.linalg.lapack import dpotrf

# Correlation beyond which a parameter is not identifiable because of a shape.
_BOUND_TO_SHAPE = 0.5


def solve_normal(
    gram: np.ndarray,
    along: np.ndarray,
    plausible: np.ndarray,
    frozen: bool | np.ndarray = False,
    penalty: float | np.ndarray = 0.0,
    present: float | np.ndarray = 0.0,
    nonlinear: bool | np.ndarray = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least squares over the parameters that the data identify, from the normal equations.

    A parameter whose standard error would exceed its plausible size, first beside those before it and then beside all, keeps
    its value. Nothing is regularised but what carries a prior, as in generalized ridge regression [1].

    `gram` (P, P): products of whitened sensitivities in plausible sizes with each other. `along` (P,): with the whitened
    residual. `plausible` (P,): plausible size of each parameter. `frozen` (P,) of bool: parameters not to move. `penalty` (P,):
    one over the variance of the prior about zero; 0 for none. `present` (P,): values from which the step is taken. `nonlinear`
    (P,) of bool: as in `identifiable`. Returns `step` (P,): zero where held; `covariance` (P, P); `held` (P,) of bool.

    [1] Hoerl, A. E. and Kennard, R. W., Ridge regression: biased estimation for nonorthogonal problems, Technometrics 12, 1970.
    """
    gram = gram + np.diag(np.broadcast_to(penalty, len(plausible)) * plausible**2)
    along = along - plausible * np.broadcast_to(penalty * present, len(plausible))
    held = ~identifiable(gram, *(np.broadcast_to(flags, len(plausible)) for flags in (frozen, nonlinear)))
    free = np.flatnonzero(~held)
    step, covariance = np.zeros(len(plausible)), np.zeros((len(plausible),) * 2)
    if len(free):
        inverse = np.linalg.inv(np.linalg.cholesky(gram[np.ix_(free, free)]))
        step[free] = plausible[free] * (inverse.T @ (inverse @ along[free]))
        covariance[np.ix_(free, free)] = np.outer(plausible[free], plausible[free]) * (inverse.T @ inverse)
    return step, covariance, held


def identifiable(gram: np.ndarray, frozen: np.ndarray, nonlinear: np.ndarray) -> np.ndarray:
    """Which parameters the data distinguish from zero at their plausible size: first given those before them, then given all.

    Forward selection in the order given, by the pivots of a Cholesky decomposition, then backward elimination.

    `gram` (P, P): information on the parameters, each in units of its plausible size. `frozen` (P,) of bool: left out from the
    start. `nonlinear` (P,) of bool: shapes: given up before a parameter that they are bound to, as that of their law is where
    it is nearly a straight line. Returns (P,) of bool.
    """
    kept = np.flatnonzero(~frozen).tolist()
    while (first := _first_without_information(gram[np.ix_(kept, kept)])) is not None:
        kept.pop(first)
    # Parameters that came later may have taken from what identified their predecessors.
    while kept:
        covariance = np.linalg.inv(gram[np.ix_(kept, kept)])
        deviation = np.sqrt(np.diag(covariance))
        worst = int(np.argmax(deviation))
        if deviation[worst] <= 1.0:
            break
        correlation = np.where(nonlinear[kept], np.abs(covariance[worst]) / (deviation[worst] * deviation), 0.0)
        shape = int(np.argmax(correlation))
        kept.pop(shape if correlation[shape] > _BOUND_TO_SHAPE else worst)
    mask = np.zeros(len(gram), bool)
    mask[kept] = True
    return mask


def _first_without_information(gram: np.ndarray) -> int | None:
    """The first of some parameters that those before it leave not enough information on; None where there is none."""
    if not len(gram):
        return None
    # Where a pivot is not positive, LAPACK says which (from 1), and has those before it.
    factor, number = dpotrf(gram, lower=1)
    known = number - 1 if number else len(gram)
    left_over = np.diag(factor)[:known] ** 2
    # Rounding of the squares counts as nothing, nor that of a prior which alone makes one.
    lacking = left_over <= np.maximum(1.0 + 1e-12, 1e-11 * np.diag(gram)[:known])
    if lacking.any():
        return int(np.argmax(lacking))
    return known if number else None
