"""Forward selection of missing effects: test, take the best, look again, until nothing that is left stands out."""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import chi2

from elastocal.fitting import Fit, fit
from elastocal.screening import Directions, Scores, absorbed, cross_validated_gains, directions, score

# With the test of lack of fit, the other way to an alarm, this is meant to leave the whole below 5 %; less would cost power.
FAMILY_WISE_LEVEL = 0.03
FOLDS = 10
# A first effect must stand out beyond chance. A further one must be worth its parameters as well, by the extended Bayesian
# criterion: no law fits so well that nothing of the first is left behind it.
_LEAST_FURTHER_GAIN = 0.0
# By the same criterion, one that need not predict poses that were left out.
SURE_GAIN = 10.0
# Decimals to which the gains of candidates that make the same agree.
_SAME_GAIN = 6
# Exact refits; each finds what the linear look before it could not see.
_ROUNDS = 4
# Up to so many chosen effects are weighed against each single one that could stand for all of them.
_FEW = 4
# An effect that the exact fit no longer needs is dropped again.
_DROPPED_LEVEL = 0.01


@dataclass(frozen=True)
class Look:
    """One look at all candidates.

    Attributes
    ----------
    directions : Directions
    scores : Scores
    chosen : int or None
        Index of the candidate taken, if any.
    gain, gain_std_error : float
        Cross-validated fall of the squared whitened error with it.
    refused : tuple of str
        Candidates that stood out and did not predict.
    """

    directions: Directions
    scores: Scores
    chosen: int | None
    gain: float = 0.0
    gain_std_error: float = 0.0
    refused: tuple = ()


@dataclass(frozen=True)
class Search:
    """What a forward selection found.

    Attributes
    ----------
    looks : tuple of Look
    declared, final : Fit
        Of the declared model, and with the effects found.
    effects : tuple of Candidate
        Effects found, the strongest first.
    """

    looks: tuple
    declared: Fit
    final: Fit
    effects: tuple = field(default=())

    @property
    def chosen(self):
        """Family-wise p-value, cross-validated gain and its standard error of each effect found, by its key.

        What stands for several effects at once was not itself chosen in a look: the least of theirs is its own.
        """
        chosen = {
            look.directions.candidates[look.chosen][0].key: (look.scores.p_family[look.chosen], look.gain, look.gain_std_error)
            for look in self.looks
            if look.chosen is not None
        }
        least = min(chosen.values(), default=None)
        return {candidate.key: chosen.get(candidate.key, least) for candidate in self.effects}


def search(declared, observations, candidates, replicates, stream, progress=None):
    """Find what a fitted model lacks.

    Parameters
    ----------
    declared : Fit
    observations : Observations
    candidates : sequence of Candidate
    replicates : int
        Of the bootstrap behind each look.
    stream : numpy.random.Generator
    progress : callable, optional
        Told a line after each look.

    Returns
    -------
    Search
    """
    current, found, looks, needless = declared, [], [], set()
    for _ in range(_ROUNDS):
        taken = {candidate.key for candidate in found} | needless
        seen = directions(current, observations, [c for c in candidates if c.key not in taken])
        new = []
        while True:
            look = _look(seen, replicates, stream, _LEAST_FURTHER_GAIN if found or new else -np.inf)
            looks.append(look)
            if progress:
                progress(_told(look))
            if look.chosen is None:
                break
            new.append(seen.candidates[look.chosen])
            seen = absorbed(seen, look.chosen)
        if not new:
            break
        found += [candidate for candidate, _ in new]
        current = _refitted(current, observations, new)
        simpler = _simpler(declared, current, observations, found, candidates)
        if simpler:
            kept = [candidate for candidate, _ in simpler]
            needless |= {candidate.key for candidate in found if candidate not in kept}
            found = kept
            current = _refitted(_with_noise_of(declared, current), observations, simpler)
        needed = [candidate for candidate in found if _wald(current, candidate) < _DROPPED_LEVEL]
        if len(needed) < len(found):
            found = needed
            current = _refitted(declared, observations, [(c, current.values_of(c.key)[1]) for c in found])
            break
    strongest = sorted(found, key=lambda candidate: _wald_statistic(current, candidate), reverse=True)
    return Search(tuple(looks), declared, current, tuple(strongest))


def parameter_slice(fitted, key):
    """Where the parameters of one effect stand among all of a fit, ndarray of int."""
    return np.flatnonzero([owner == key for owner, _ in fitted.parameters])


def without(fitted, keys, observations):
    """The same fit without some of its effects, at the same noise.

    Parameters
    ----------
    fitted : Fit
    keys : collection of str
    observations : Observations

    Returns
    -------
    Fit
    """
    kept = [number for number, effect in enumerate(fitted.model.effects) if effect.key not in keys]
    model = replace(fitted.model, effects=tuple(fitted.model.effects[number] for number in kept))
    estimate = replace(
        fitted.estimate,
        coefficients=tuple(fitted.estimate.coefficients[number] for number in kept),
        shapes=tuple(fitted.estimate.shapes[number] for number in kept),
    )
    return fit(model, observations, fitted.noise, estimate, fitted.discrepancy_m)


def _look(seen, replicates, stream, least_gain):
    scores = score(seen, replicates, stream)
    refused = []
    for index in _best_first(seen.candidates, scores.bic_gain):
        if scores.p_family[index] >= FAMILY_WISE_LEVEL or scores.bic_gain[index] < least_gain:
            continue
        # What is chosen must predict poses that were left out better, if by little: an effect may live in few poses. One that
        # lives in a single pose cannot, and is taken where it stands out whatever the other poses say.
        (gain,), (std_error,) = cross_validated_gains(seen, [index], FOLDS)
        if gain > 0 or scores.bic_gain[index] >= SURE_GAIN:
            return Look(seen, scores, int(index), float(gain), float(std_error), tuple(refused))
        refused.append(seen.candidates[index][0].key)
    return Look(seen, scores, None, refused=tuple(refused))


def _best_first(candidates, gains):
    """Order of candidates by gain. Of those that make the same, that of the effect which fewer places can have is meant."""
    effects = [candidate.effect for candidate, _ in candidates]
    return np.lexsort(([effects.count(effect) for effect in effects], -np.round(gains, _SAME_GAIN)))


def _told(look):
    if look.chosen is None:
        return f"{len(look.scores.p_value)} candidates tested, none stands out"
    key, p_value = look.directions.candidates[look.chosen][0].key, look.scores.p_family[look.chosen]
    return f"{len(look.scores.p_value)} candidates tested: {key} (family-wise p {p_value:.4f})"


def _refitted(fitted, observations, added):
    effects = [candidate for candidate, _ in added]
    model, start = fitted.model.with_effects(effects), fitted.estimate.with_effects(effects)
    shapes = (*fitted.estimate.shapes, *(np.array(values, float) for _, values in added))
    return fit(model, observations, fitted.noise, replace(start, shapes=shapes), None, fitted.discrepancy_m)


def _with_noise_of(fitted, other):
    return replace(fitted, discrepancy_m=other.discrepancy_m)


def _simpler(declared, current, observations, found, candidates):
    """A single candidate that explains the readings better than all those found, by the Bayesian criterion, if there is one."""
    if not 1 < len(found) <= _FEW:
        return []
    bare = without(current, {candidate.key for candidate in found}, observations)
    seen = directions(bare, observations, candidates)
    rows = len(seen.residual)
    chosen = [number for number, (candidate, _) in enumerate(seen.candidates) if candidate in found]
    together = np.linalg.qr(np.concatenate([seen.columns[number] for number in chosen], axis=1))[0] if chosen else None
    if together is None:
        return []

    def criterion(columns):
        rest = seen.residual @ seen.residual - ((columns.T @ seen.residual) ** 2).sum()
        return rows * np.log(rest) + columns.shape[1] * np.log(rows)

    singles = np.array([criterion(columns) for columns in seen.columns])
    number = int(np.argmin(singles))
    extended = 2 * np.log(len(seen.columns)) * (len(found) - 1)
    return [seen.candidates[number]] if singles[number] < criterion(together) + extended else []


def _wald_statistic(fitted, candidate):
    """Of the linear parameters, given the shapes: without its law a shape means nothing."""
    mine = parameter_slice(fitted, candidate.key)
    linear, shapes = np.split(mine, [len(candidate.parameters)])
    free = np.flatnonzero(~fitted.held)
    tested, kept = np.isin(free, linear), ~np.isin(free, shapes)
    if not tested.any():
        return 0.0
    values = fitted.values_of(candidate.key)[0][np.isin(linear, free)]
    information = np.linalg.inv(fitted.covariance[np.ix_(free, free)])
    covariance = np.linalg.inv(information[np.ix_(kept, kept)])[np.ix_(tested[kept], tested[kept])]
    return float(values @ np.linalg.solve(covariance, values))


def _wald(fitted, candidate):
    return chi2.sf(_wald_statistic(fitted, candidate), len(candidate.parameters))
