"""Score tests: does the residual of a fitted model hold what a candidate would make?

Each candidate's sensitivities are projected off everything that the model fits already. What is left, W, tells the candidate;
the statistic is the part of the residual that lies in it. Its distribution without any missing effect comes from a bootstrap
that turns the signs of the residuals of whole poses, so that nothing is assumed of what readings of one pose have in common;
the smallest p-value of all candidates in each replicate gives the probability of one false alarm among them all.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve
from scipy.sparse import csr_matrix
from scipy.stats import f as f_distribution

from elastocal.effects.protocol import offered
from elastocal.model import effect_columns, linearize

# A candidate whose sensitivities keep less than this share off the model's own cannot be told.
LEAST_RETAINED = 0.01
# Nor one whose non-centrality at its plausible size stays below this.
LEAST_NONCENTRALITY = 10.0
# Directions of a candidate that keep less than this share (squared) are rounding.
_ROUNDING = 1e-10
_SHAPES_TRIED = 3
# Candidates less likely than this by chance, up to so many, are taken out of the residual that stands for noise.
_OBVIOUS, _MOST_OBVIOUS = 3e-4, 6


@dataclass(frozen=True)
class Directions:
    """What is left of candidates off a model, and the residual there.

    Attributes
    ----------
    residual : ndarray (R,)
        Whitened residual, off the model.
    model : ndarray (R, P)
        Orthonormal basis of what the model fits.
    candidates : tuple of (Candidate, ndarray)
        Tested candidates, each with the values of its shape parameters.
    columns : tuple of ndarray (R, d)
        Orthonormal basis of what each candidate makes off the model.
    retained : ndarray (K,)
        Share of each candidate's sensitivities that is off the model.
    noncentrality : ndarray (K,)
        Largest that a parameter of plausible size would make.
    cluster : ndarray (R,)
        Pose of each row, 0 .. C-1.
    untestable : dict of str to str
        Why a candidate is not tested.
    """

    residual: np.ndarray
    model: np.ndarray
    candidates: tuple
    columns: tuple
    retained: np.ndarray
    noncentrality: np.ndarray
    cluster: np.ndarray
    untestable: dict

    @property
    def residual_freedom(self):
        """Rows less what the model fits."""
        return len(self.residual) - self.model.shape[1]


@dataclass(frozen=True)
class Scores:
    """Score tests of K candidates.

    Attributes
    ----------
    statistic : ndarray (K,)
        Squared length of the residual in the candidate's directions.
    parameters : ndarray (K,)
    p_value, p_family : ndarray (K,)
        By the F distribution for one test; by the bootstrap for the smallest of all.
    bic_gain : ndarray (K,)
        By how much the extended Bayesian criterion falls with the candidate.
    """

    statistic: np.ndarray
    parameters: np.ndarray
    p_value: np.ndarray
    p_family: np.ndarray
    bic_gain: np.ndarray


def directions(fitted, observations, candidates, least_retained=LEAST_RETAINED, least_noncentrality=LEAST_NONCENTRALITY):
    """What each candidate would make of the residual of a fit.

    Parameters
    ----------
    fitted : Fit
    observations : Observations
        Those fitted.
    candidates : iterable of Candidate
    least_retained, least_noncentrality : float
        Candidates with less are not tested.

    Returns
    -------
    Directions
    """
    line = linearize(fitted.model, fitted.estimate, observations, fitted.circumstances)
    rows = fitted.residual.size
    scale = np.array([parameter.plausible for _, parameter in fitted.parameters])
    known = fitted.whitened(line.sensitivities[..., ~fitted.held] * scale[~fitted.held]).reshape(rows, -1)
    basis = np.linalg.qr(known)[0]
    residual = fitted.whitened(line.residual).reshape(-1)
    residual = residual - basis @ (basis.T @ residual)
    lacking = {candidate.key: _lacks(candidate, fitted.model.sites, observations.states) for candidate in candidates}
    tested, columns, retained, strength = [], [], [], []
    untestable = {key: reason for key, reason in lacking.items() if reason}
    for candidate in candidates:
        if lacking[candidate.key]:
            continue
        plausible = np.array([parameter.plausible for parameter in candidate.parameters])
        for shapes in _shapes_tried(candidate):
            made = effect_columns([(candidate, shapes)], fitted.circumstances, line.coordinate_jacobian, observations.state)
            made = fitted.whitened(made * plausible).reshape(rows, -1)
            off = made - basis @ (basis.T @ made)
            # Twice is enough: the second pass removes the rounding of the first.
            off -= basis @ (basis.T @ off)
            values, vectors = np.linalg.eigh(off.T @ off)
            whole = (made**2).sum()
            share, largest = np.sqrt(values.sum() / whole) if whole else 0.0, values[-1]
            if share < least_retained or largest < least_noncentrality:
                reason = "what it makes is fitted by the model already" if share < least_retained else "too small to be seen"
                untestable[candidate.key] = reason
                continue
            good = values > max(_ROUNDING * whole, 1e-6 * largest)
            tested.append((candidate, shapes))
            columns.append(off @ (vectors[:, good] / np.sqrt(values[good])))
            retained.append(share)
            strength.append(largest)
    cluster = np.repeat(observations.cluster, fitted.model.rows)
    return Directions(
        residual, basis, tuple(tested), tuple(columns), np.array(retained), np.array(strength), cluster, untestable
    )


def score(found, replicates, stream):
    """Test every candidate.

    Parameters
    ----------
    found : Directions
    replicates : int
        Of the bootstrap.
    stream : numpy.random.Generator

    Returns
    -------
    Scores
    """
    if not found.columns:
        nothing = np.zeros(0)
        return Scores(nothing, nothing, nothing, nothing, nothing)
    statistic, rest, sizes = _statistics(found)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    adjusted = leverage_adjusted(_without_the_obvious(found))
    poses = csr_matrix((np.ones(len(found.cluster)), (found.cluster, np.arange(len(found.cluster)))))
    contributions = np.concatenate([poses @ (columns * adjusted[:, None]) for columns in found.columns], axis=1)
    model_part = poses @ (found.model * adjusted[:, None])
    p_value = _tail(statistic, rest, sizes, found.residual_freedom)
    signs = stream.choice([-1.0, 1.0], size=(replicates, poses.shape[0]))
    statistics = np.add.reduceat((signs @ contributions) ** 2, starts, axis=1)
    rests = adjusted @ adjusted - ((signs @ model_part) ** 2).sum(axis=1)
    smallest = _tail(statistics, rests[:, None], sizes, found.residual_freedom).min(axis=1)
    p_family = (1 + (smallest[:, None] <= p_value).sum(axis=0)) / (1 + replicates)
    return Scores(statistic, sizes, p_value, p_family, _bic_gain(statistic, rest, sizes, len(found.residual)))


def by_chance(found):
    """Probability that each candidate alone stands out as much by chance, by the F distribution.

    Parameters
    ----------
    found : Directions

    Returns
    -------
    ndarray (K,)
    """
    return _tail(*_statistics(found), found.residual_freedom) if found.columns else np.zeros(0)


def absorbed(found, winner):
    """The same directions once the model has a candidate as well.

    Parameters
    ----------
    found : Directions
    winner : int
        Index of the candidate.

    Returns
    -------
    Directions
        Without the candidates of which the winner, and those before it, leave too little.
    """
    basis = found.columns[winner]
    residual = found.residual - basis @ (basis.T @ found.residual)
    kept, columns, retained = [], [], []
    for index, old in enumerate(found.columns):
        if found.candidates[index][0].key == found.candidates[winner][0].key:
            continue
        off = old - basis @ (basis.T @ old)
        values, vectors = np.linalg.eigh(off.T @ off)
        left = found.retained[index] * np.sqrt(np.clip(values, 0.0, 1.0))
        good = left > LEAST_RETAINED
        if good.any():
            kept.append(index)
            retained.append(left[good].max())
            columns.append(off @ (vectors[:, good] / np.sqrt(values[good])))
    return replace(
        found,
        residual=residual,
        model=np.concatenate([found.model, basis], axis=1),
        candidates=tuple(found.candidates[index] for index in kept),
        columns=tuple(columns),
        retained=np.array(retained),
        noncentrality=found.noncentrality[kept],
    )


def leverage_adjusted(found):
    """Residuals of each pose, given back what fitting took from their variance: (I - H_pp)^(-1/2) r_p.

    Parameters
    ----------
    found : Directions

    Returns
    -------
    ndarray (R,)
    """
    adjusted = np.empty_like(found.residual)
    order = np.argsort(found.cluster, kind="stable")
    sizes = np.bincount(found.cluster)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    for size in np.unique(sizes):
        rows = order[starts[sizes == size][:, None] + np.arange(size)]
        basis = found.model[rows]
        leverage, vectors = np.linalg.eigh(basis @ basis.transpose(0, 2, 1))
        spread = 1.0 / np.sqrt(np.clip(1.0 - leverage, 0.05, 1.0))
        turned = (vectors.transpose(0, 2, 1) @ found.residual[rows][..., None])[..., 0]
        adjusted[rows] = (vectors @ (spread * turned)[..., None])[..., 0]
    return adjusted


def cross_validated_gains(found, candidates, folds):
    """How much better candidates, each alone, predict poses that were left out.

    Parameters
    ----------
    found : Directions
    candidates : sequence of int
        Which of the candidates.
    folds : int

    Returns
    -------
    gains, std_errors : ndarray (K,)
        Fall of the squared whitened error, summed over all poses, and its standard error over poses.
    """
    model, residual = found.model, found.residual
    columns = [found.columns[index] for index in candidates]
    ends = np.cumsum([part.shape[1] for part in columns])
    together = np.concatenate(columns, axis=1)
    along = together.T @ residual
    # Neighbouring numbers often mean neighbouring poses: deal them out in turn.
    fold = found.cluster % folds
    gains = np.zeros((len(columns), len(residual)))
    for number in range(folds):
        out = np.flatnonzero(fold == number)
        known, made, seen = model[out], together[out], residual[out]
        # The columns are orthonormal over all poses: what is left of them without a fold is the identity less its share.
        factor = _inflated_factor(np.eye(model.shape[1]) - known.T @ known)
        error = seen + known @ cho_solve(factor, known.T @ seen)
        beyond = made + known @ cho_solve(factor, known.T @ made)
        right = along - made.T @ error
        for candidate, (end, part) in enumerate(zip(ends, columns, strict=True)):
            mine = slice(end - part.shape[1], end)
            solved = cho_solve(_inflated_factor(np.eye(part.shape[1]) - made[:, mine].T @ beyond[:, mine]), right[mine])
            gains[candidate, out] = error**2 - (error - beyond[:, mine] @ solved) ** 2
    per_pose = np.array([np.bincount(found.cluster, gain) for gain in gains])
    return per_pose.sum(axis=1), np.sqrt(per_pose.shape[1]) * per_pose.std(axis=1, ddof=1)


def _without_the_obvious(found):
    """The same directions once the model has every candidate that stands out whatever the bootstrap says.

    An effect that is there would otherwise be taken for noise: where few poses hold most of it, turning their signs makes
    residuals as large as its own.
    """
    for _ in range(_MOST_OBVIOUS):
        if not found.columns:
            break
        p_value = by_chance(found)
        if p_value.min() >= _OBVIOUS:
            break
        found = absorbed(found, int(np.argmin(p_value)))
    return found


def _statistics(found):
    statistic = np.array([((columns.T @ found.residual) ** 2).sum() for columns in found.columns])
    return statistic, found.residual @ found.residual, np.array([columns.shape[1] for columns in found.columns])


def _inflated_factor(matrix):
    """Cholesky factor of a matrix that rounding may have made singular."""
    inflated = matrix + _ROUNDING * np.eye(len(matrix))
    return np.linalg.cholesky(inflated), True


def _bic_gain(statistic, rest, parameters, rows):
    explained = np.clip(statistic / rest, 0.0, 1.0 - 1e-12)
    return -rows * np.log1p(-explained) - parameters * np.log(rows) - 2 * np.log(len(statistic))


def _tail(statistic, rest, parameters, freedom):
    """Probability of a larger statistic by the F distribution."""
    ratio = (statistic / parameters) / np.maximum((rest - statistic) / (freedom - parameters), 1e-300)
    return f_distribution.sf(ratio, parameters, freedom - parameters)


def _lacks(candidate, sites, states):
    """Why the data cannot tell a candidate at all; empty where they might."""
    missing = sorted(candidate.needs - offered(sites, states))
    if missing:
        return f"no {' and no '.join(missing)} in the data"
    for joint in candidate.joints if candidate.distinct_angles else ():
        angles = len(np.unique(np.round(np.mod(states.joint_angles[:, joint - 1], 2 * np.pi), 3)))
        if angles < candidate.distinct_angles:
            return f"{angles} angles of joint {joint} where {candidate.distinct_angles} are needed"
    return ""


def _shapes_tried(candidate):
    if not candidate.shapes:
        return [np.zeros(0)]
    (shape,) = candidate.shapes
    return [np.array([value]) for value in shape.values(_SHAPES_TRIED)]
