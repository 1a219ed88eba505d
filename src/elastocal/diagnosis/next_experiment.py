"""The next experiment: poses and loads after which the readings, most probably, say which hypothesis holds.

Models of the posterior are linear in their coefficients, so that what an experiment tells is one matrix, its information G on
declared parameters and units together. A model j that present readings leave with coefficients N(m_j, P_j^-1) expects readings
with mean A_j m_j and covariance I + A_j P_j^-1 A_j', A'A = G. If readings come from coefficients t instead, then on average

    -2 ln p_j = u'G u - u'G_j (P_j + G_jj)^-1 G_j'u + tr((P_j + G_jj)^-1 P_j) + ln |P_j + G_jj| - ln |P_j| - d_j + const,

with u = t - m_j and d_j coefficients, and the difference between two models, drawn over the posterior of t, is twice the
divergence of Box and Hill [1]_, the *separation*. Where coefficients are known, odds of 19:1 are reached with 50, 90 and 95 %
if it is 6, 16 and 21; where they may turn out small, the separation that is stated is the one for which this holds. The sum of
all divergences never has enough of two models that are far apart already; the expected fall of the entropy does, and is bounded
from below by the same pairwise quantities through exp(-separation / 8) [2]_. That is maximised: greedily, then by exchange
[3]_, then by ascent in the angles.

What is promised is simulated: coefficients from the posterior, readings of the whole experiment, posterior of the hypotheses.

References
----------
.. [1] Box, G. E. P. and Hill, W. J. (1967). Discrimination among mechanistic models. Technometrics 9, 57-71.
.. [2] Kolchinsky, A. and Tracey, B. D. (2017). Estimating mixture entropy with pairwise distances. Entropy 19, 361.
.. [3] Fedorov, V. V. (1972). Theory of optimal experiments. Academic Press.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.stats import norm

from elastocal.diagnosis import new_states
from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.refit import mean_square_left
from elastocal.diagnosis.statistics import normal_equations
from elastocal.diagnosis.verdict import ADEQUATE, NAMED, NOT_TESTABLE
from elastocal.robot import STANDARD_GRAVITY
from elastocal.study.columns import WRENCH_NAMES

# Said where nothing within reach helps.
NOT_DISTINGUISHABLE = "not distinguishable with this robot and tracker"
NOTHING_MISSING, NOTHING_AMBIGUOUS = "nothing is missing", "nothing is ambiguous"
DATA_AT_FAULT, NOTHING_TESTABLE = "the data are at fault", "the measurements can test no mechanism"
# Separations with which odds of 19:1 are reached in half of all experiments: ln 19 = lambda / 2 - z sqrt(lambda).
HALF_RESOLVED = 2 * np.log(19.0)
# Poses after which nobody goes on: some two days with a tracker. Fewer are said to be needed, or none.
MOST_POSES = 100
WANTED_PROBABILITY = 0.9
# States that are looked at, and entries among them that greedy search and exchange choose from: as many by what they tell alone
# as at random, for some tell only together with others.
_STATES, _SHORT_LIST = 10_000, 300
# Multiplications that the search may take: fewer entries are looked at where models have hundreds of unknowns. And numbers in
# memory at once.
_WORK, _MEMORY = 4e9, 2e7
# Models that stand for the hypotheses; the others hold a few per cent.
_MODELS, _HYPOTHESES = 12, 8
# Draws of each model's coefficients: for the search, and of each hypothesis for what is promised (standard error 2 %).
_DRAWS, _PROMISE_DRAWS = 4, 600
# Standard deviations of the steps in the joint angles, and neighbours tried with each.
_RADII, _NEIGHBOURS = (0.5, 0.2, 0.08), 24
_EXCHANGES = 2
# Targets on further points are not asked for where they bring less than this share of the fall of the entropy.
_WORTH_A_TARGET = 0.05


@dataclass(frozen=True)
class Proposal:
    """Poses to measure next, in the order of their worth, and what they promise; arrays of E, empty where nothing helps.

    Attributes
    ----------
    joint_angles : ndarray (E, n)
        rad.
    wrench : ndarray (E, 6)
        N, N m, at the last measuring point, base axes, at the share 1 of `shares`.
    approach : ndarray (E, n) or None
        Sense in which to approach each joint; None where the campaign does not note it, or where a ladder is given: then any.
    reference_weight : ndarray of bool (E,)
        Whether the load is a weight hung at the last measuring point, known by weighing and not by the load cell.
    shares : tuple of float
        Shares of its load at which each pose is read; a weight hangs at their absolute values.
    points : tuple of str
        Measuring points at which targets are read in every pose.
    separation : ndarray (E,)
        From the nearest alternative, by readings of this pose and all before it: at most twice the log Bayes factor that they
        bring for the truth on average; 16 gives it odds of 19:1 from even ones with 90 %.
    resolved : ndarray (E,)
        Probability that after this pose the right hypothesis has 95 %, those in `indistinguishable` aside.
    present : float
        Separation from the nearest alternative that the present readings give to an effect as large as the one found.
    poses_needed : int or None
        For `resolved` of 90 %, if further poses tell as much as these; None where a hundred are not enough.
    best : tuple of str
        Mechanisms of the best hypothesis.
    nearest : tuple of str
        Of the alternative with the smallest separation.
    indistinguishable : tuple of tuple of str
        Alternatives that no experiment within reach tells from the best; they do not count in the promise.
    reason : str
        Why there is nothing to measure; empty where there is.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray
    approach: np.ndarray | None
    reference_weight: np.ndarray
    shares: tuple
    points: tuple
    separation: np.ndarray
    resolved: np.ndarray
    present: float
    poses_needed: int | None
    best: tuple
    nearest: tuple
    indistinguishable: tuple
    reason: str

    def __len__(self):
        return len(self.separation)


def propose(diagnosis, joint_limits, settings, stream, poses=10, ladder=None):
    """Choose the poses and loads that most probably resolve what a diagnosis leaves ambiguous.

    Parameters
    ----------
    diagnosis : Diagnosis
    joint_limits : ndarray (n, 2)
        rad.
    settings : Settings
    stream : numpy.random.Generator
    poses : int
    ladder : tuple of float, optional
        Shares of its load at which each pose is read, at the targets of the campaign and with any approach. Without, each is
        read without its load, under it and, where the campaign has such, under the opposite one; sizes and levers of the load,
        a reference weight, targets on further points and the side of the approach are chosen.

    Returns
    -------
    Proposal
    """
    joints, case, evidence = len(joint_limits), diagnosis.case, diagnosis.evidence
    kept, reason = _ambiguous(evidence, settings)
    best = evidence.conclusion.best.mechanisms if evidence else ()
    if reason:
        return _nothing(joints, best, (), reason)
    problem = evidence.linearized.problem
    numbers = sorted({n for models in kept.values() for model in models for n in model.units})
    units = [problem.units[n] for n in numbers]
    states = case.observations.states
    of_load_cell = any(unit.candidate is not None and unit.candidate.family == "load" for unit in units)
    reach = new_states.reach_of(states, case.campaign.robot, joint_limits, ladder, of_load_cell)
    lead = kept[best][0]
    factor = float(np.sqrt(max(mean_square_left(problem, lead), 1.0)))
    noise = replace(evidence.linearized.about.noise.scaled(factor), pose_rad=factor * lead.pose_error_rad)
    instrument = new_states.instrument_of(evidence.linearized, diagnosis.final, numbers, noise, states, reach, ladder is None)
    members = _members(evidence, kept, instrument, lead, factor)
    entries, information, targets = _searched(members, instrument, poses, stream)
    if not reach.free:
        # Nobody is asked to approach from the sides with which the search was lucky.
        entries = replace(entries, approach=new_states.approaches(reach, poses, stream))
        information = instrument.information(entries, targets)
    promise = _Promise(members, stream)
    far = information.sum(axis=0) * (MOST_POSES / poses)
    apart = promise.separations(promise.log_factors(far))
    lost = [h for h in range(1, len(members.names)) if apart[h] < HALF_RESOLVED]
    unreachable = tuple(members.names[h] for h in lost)
    members = members.without(lost)
    promise = _Promise(members, stream)
    # What can be told from the best holds no more probability than is left open where nothing is ambiguous.
    if np.exp(promise.log_prior[0]) >= settings.credible:
        return _nothing(joints, best, unreachable, NOT_DISTINGUISHABLE)
    order = _by_worth(members, information, stream)
    entries, information = entries.at(order), information[order]
    totals = np.cumsum(information, axis=0)
    factors = [promise.log_factors(total) for total in totals]
    apart = np.array([promise.separations(logs)[1:] for logs in factors])
    resolved = np.array([promise.resolved(logs) for logs in factors])
    nearest = int(np.argmin(apart[-1]))
    return Proposal(
        entries.joint_angles,
        entries.wrench,
        entries.approach[:, 0] if reach.free and reach.approach_noted else None,
        entries.weighed,
        reach.shares,
        tuple(dict.fromkeys(instrument.model.targets[target].point for target in targets)),
        apart.min(axis=1),
        resolved,
        _present_separation(evidence.linearized, lead, kept[members.names[nearest + 1]][0], factor),
        _poses_needed(promise, totals[-1], resolved),
        best,
        members.names[nearest + 1],
        unreachable,
        "",
    )


def table_of(proposal, robot):
    """The proposal as whoever drives the robot wants it.

    Parameters
    ----------
    proposal : Proposal
    robot : Robot

    Returns
    -------
    pandas.DataFrame
        One row for each pose; joint angles as the controller reports them (rad), ``load`` 1 where it is loaded,
        ``separation`` and ``resolved`` after it and all before, ``separation_without`` from the present readings, and what the
        promise leaves aside as ``indistinguishable``; ``approach1..n`` where the campaign has them and ``reference_weight_kg``
        where a weight is asked for.
    """
    joints, count = robot.joints, len(proposal)
    columns = {
        "effect": [f"{words(proposal.best)} or {words(proposal.nearest)}"] * count,
        "pose": np.arange(count),
        "load": proposal.wrench.any(axis=1).astype(int),
        "point": [" ".join(proposal.points)] * count,
    }
    reported = robot.reported_angles(proposal.joint_angles) if count else np.zeros((0, joints))
    columns |= {f"q{joint + 1}": reported[:, joint] for joint in range(joints)}
    columns |= dict(zip(WRENCH_NAMES, proposal.wrench.T, strict=True))
    columns |= {"separation": proposal.separation, "separation_without": np.full(count, proposal.present)}
    columns |= {
        "resolved": proposal.resolved,
        "indistinguishable": ["; ".join(words(name) for name in proposal.indistinguishable)] * count,
    }
    if proposal.approach is not None:
        columns |= {f"approach{joint + 1}": proposal.approach[:, joint] for joint in range(joints)}
    if proposal.reference_weight.any():
        mass = np.linalg.norm(proposal.wrench[:, :3], axis=1) / STANDARD_GRAVITY
        columns["reference_weight_kg"] = np.where(proposal.reference_weight, mass, 0.0)
    return pd.DataFrame(columns)


def facts_of(proposal):
    """What verdict.json says of the next experiment.

    Parameters
    ----------
    proposal : Proposal

    Returns
    -------
    dict
    """
    return {
        "poses": len(proposal),
        "reason": proposal.reason,
        "best": list(proposal.best),
        "nearest": list(proposal.nearest),
        "separation": float(proposal.separation[-1]) if len(proposal) else None,
        "resolved": float(proposal.resolved[-1]) if len(proposal) else None,
        "poses_needed": proposal.poses_needed,
        "indistinguishable": [list(name) for name in proposal.indistinguishable],
        "sentence": sentence_of(proposal),
    }


def sentence_of(proposal):
    """What the report says of the next experiment.

    Parameters
    ----------
    proposal : Proposal

    Returns
    -------
    str
    """
    aside = "".join(f" {sentence}" for sentence in _left_aside(proposal))
    if proposal.reason == NOT_DISTINGUISHABLE:
        return f"No further measurement is proposed.{aside}"
    if proposal.reason:
        return f"No further measurement is proposed: {proposal.reason}."
    needed = f"{proposal.poses_needed} poses" if proposal.poses_needed else f"more than {MOST_POSES} poses"
    shares = ", ".join(f"{share:g}" for share in proposal.shares)
    return (
        f"{len(proposal)} further poses, each read at {shares} times its load, separate "
        f"{words(proposal.best)} from {words(proposal.nearest)} by "
        f"{proposal.separation[-1]:.1f} and resolve the verdict at 19:1 with a probability of {proposal.resolved[-1]:.0%}; "
        f"{WANTED_PROBABILITY:.0%} needs {needed}.{aside}"
    )


def words(mechanisms):
    """A hypothesis in words: joint_tilt, payload and link_weight, joint_tilt or a related mechanism."""
    named = [name for name in mechanisms if name != OTHER]
    if not named:
        return "a mechanism that the catalogue lacks"
    return " and ".join(named) + (" with a related mechanism" if OTHER in mechanisms else "")


def _left_aside(proposal):
    """Sentences on the alternatives that nothing within reach tells from the best: instead of it, or beside it."""
    best = set(proposal.best)
    instead = [words(name) for name in proposal.indistinguishable if not set(name) > best or OTHER in set(name) - best]
    beside = dict.fromkeys(
        mechanism
        for name in proposal.indistinguishable
        if set(name) > best
        for mechanism in name
        if mechanism not in best and mechanism != OTHER
    )
    if instead:
        yield f"{words(proposal.best)} and {', '.join(instead)} are {NOT_DISTINGUISHABLE}."
    if beside:
        yield f"Whether {' or '.join(beside)} acts beside {words(proposal.best)} is {NOT_DISTINGUISHABLE}."


def separation_resolved(probability):
    """Separation of two fixed hypotheses with which one gets odds of 19:1 so often: ln 19 = lambda / 2 - z sqrt(lambda).

    Parameters
    ----------
    probability : float

    Returns
    -------
    float
    """
    z = norm.ppf(probability)
    return float((z + np.sqrt(z**2 + 2 * np.log(19.0))) ** 2) if probability > 0 else 0.0


def _nothing(joints, best, indistinguishable, reason):
    none = np.zeros(0)
    return Proposal(
        np.zeros((0, joints)),
        np.zeros((0, 6)),
        None,
        np.zeros(0, bool),
        (),
        (),
        none,
        none,
        0.0,
        None,
        best,
        (),
        indistinguishable,
        reason,
    )


def _ambiguous(evidence, settings):
    """Models of each credible hypothesis, the best first, each by falling probability; or why there is nothing to resolve."""
    if evidence is None:
        return {}, DATA_AT_FAULT
    conclusion, found = evidence.conclusion, evidence.posterior
    if conclusion.verdict in (ADEQUATE, NOT_TESTABLE):
        return {}, NOTHING_MISSING if conclusion.verdict == ADEQUATE else NOTHING_TESTABLE
    there = [h for h in conclusion.hypotheses if h.mechanisms and h.model >= 0]
    reached = np.cumsum([h.probability for h in there])
    credible = there[: int(np.searchsorted(reached, settings.credible * reached[-1])) + 1]
    names = [conclusion.best.mechanisms, *(h.mechanisms for h in credible if h != conclusion.best)][:_HYPOTHESES]
    # Where the verdict names one mechanism, whatever else is beside it does not make the name ambiguous.
    instead = [name for name in names[1:] if not set(name) >= set(names[0])]
    if len(names) < 2 or (conclusion.verdict == NAMED and not instead):
        return {}, NOTHING_AMBIGUOUS
    units = evidence.linearized.problem.units
    models = {name: [] for name in names}
    for model in found.models:
        name = tuple(sorted({units[n].mechanism for n in model.units}))
        if name in models:
            models[name].append(model)
    room = _MODELS - len(names)
    extra = sorted((m for each in models.values() for m in each[1:]), key=lambda model: -model.log_odds)[:room]
    return {name: [m for m in each if m is each[0] or any(m is other for other in extra)] for name, each in models.items()}, ""


@dataclass(frozen=True)
class _Members:
    """Models as they are after the present readings; M of them.

    Attributes
    ----------
    names : tuple of tuple of str
        Of the hypotheses, the best first.
    hypothesis : ndarray of int (M,)
    log_weights : ndarray (M,)
        Of their probabilities, which sum to one.
    columns : tuple of ndarray of int
        Of the unknowns that each has.
    means : ndarray (M, U)
        Of the unknowns; zero for those that a model does not have.
    precisions : tuple of ndarray (d, d)
    roots : tuple of ndarray (d, d)
        Times white noise, deviations of its coefficients.
    """

    names: tuple
    hypothesis: np.ndarray
    log_weights: np.ndarray
    columns: tuple
    means: np.ndarray
    precisions: tuple
    roots: tuple

    def without(self, hypotheses):
        """These models without those of some hypotheses."""
        kept = np.flatnonzero(~np.isin(self.hypothesis, hypotheses))
        numbers = [h for h in range(len(self.names)) if h not in hypotheses]
        return _Members(
            tuple(self.names[h] for h in numbers),
            np.searchsorted(numbers, self.hypothesis[kept]),
            self.log_weights[kept] - log_sum_exp(self.log_weights[kept]),
            *(tuple(values[m] for m in kept) for values in (self.columns,)),
            self.means[kept],
            *(tuple(values[m] for m in kept) for values in (self.precisions, self.roots)),
        )

    def drawn(self, model, count, stream):
        """Coefficients from the posterior of one model, ndarray (count, U)."""
        found = np.repeat(self.means[model][None], count, axis=0)
        white = stream.standard_normal((count, len(self.columns[model])))
        found[:, self.columns[model]] += white @ self.roots[model].T
        return found


def _members(evidence, kept, instrument, lead, factor):
    """Posterior of the coefficients of each model, in units of the noise that the leading model leaves.

    All models are taken at the pose error of the leading one; half-normal priors count as normal ones.
    """
    problem, products = evidence.linearized.problem, evidence.linearized.products
    total, _ = normal_equations(products, lead.pose_error_rad)
    total = total / factor**2
    declared, added = products.declared, int(instrument.added.sum())
    place = np.zeros(products.gram.shape[0], int)
    place[declared + instrument.columns] = declared + np.arange(len(instrument.columns))
    unknown_places = np.arange(instrument.unknowns - added, instrument.unknowns)
    hypothesis, odds, columns, means, precisions, roots = [], [], [], [], [], []
    for number, (_, models) in enumerate(kept.items()):
        for model in models:
            mine = np.concatenate([np.zeros(0, int), *(problem.units[n].columns for n in model.units)])
            deviations = np.repeat(model.scales, [len(problem.units[n].columns) for n in model.units])
            chosen = np.concatenate([np.arange(declared), declared + mine])
            precision = total[np.ix_(chosen, chosen)] + np.diag(np.append(np.zeros(declared), (factor * deviations) ** -2))
            mean = np.zeros(instrument.unknowns)
            at = np.concatenate([np.arange(declared), place[declared + mine]])
            mean[at] = np.linalg.solve(precision, total[chosen, -1])
            # Places of further targets: a prior of a metre and a radian decides nothing.
            size = len(chosen) + added
            whole = np.eye(size)
            whole[: len(chosen), : len(chosen)] = precision
            hypothesis.append(number)
            odds.append(model.log_odds)
            columns.append(np.concatenate([at, unknown_places]))
            means.append(mean)
            precisions.append(whole)
            roots.append(np.linalg.inv(np.linalg.cholesky(whole)).T)
    odds = np.array(odds)
    return _Members(
        tuple(kept),
        np.array(hypothesis),
        odds - log_sum_exp(odds),
        tuple(columns),
        np.array(means),
        tuple(precisions),
        tuple(roots),
    )


def _misfits(members, information, truths):
    """-2 ln p_j on average, but for what is common to all models, for readings that true coefficients make.

    Parameters
    ----------
    members : _Members
    information : ndarray (N, U, U)
    truths : ndarray (T, U)

    Returns
    -------
    ndarray (N, T, M)
    """
    of_truths = information @ truths.T
    squares = (of_truths * truths.T).sum(axis=1)
    found = np.empty((len(information), len(truths), len(members.means)))
    for number, (columns, mean, precision) in enumerate(zip(members.columns, members.means, members.precisions, strict=True)):
        of_mean = information @ mean
        quadratic = squares - 2.0 * of_mean @ truths.T + (of_mean @ mean)[:, None]
        seen = of_truths[:, columns] - of_mean[:, columns, None]
        inner = information[:, columns[:, None], columns] + precision
        factor = np.linalg.cholesky(inner)
        inverse = np.linalg.inv(inner)
        quadratic -= (seen * (inverse @ seen)).sum(axis=1)
        log_det = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1) - np.linalg.slogdet(precision)[1]
        common = (inverse * precision).sum(axis=(1, 2)) - len(columns) + log_det
        found[..., number] = quadratic + common[:, None]
    return found


@dataclass(frozen=True)
class _Criterion:
    """Entropy of the hypotheses that an experiment leaves, by pairwise separations.

    Attributes
    ----------
    members : _Members
    truths : ndarray (T, U)
        Draws of each model's coefficients.
    source : ndarray of int (T,)
        Whose.
    """

    members: _Members
    truths: np.ndarray
    source: np.ndarray

    @classmethod
    def of(cls, members, stream):
        """With fresh draws."""
        count = len(members.means)
        truths = np.concatenate([members.drawn(model, _DRAWS, stream) for model in range(count)])
        return cls(members, truths, np.repeat(np.arange(count), _DRAWS))

    @property
    def work(self):
        """Multiplications for one entry."""
        return sum(len(columns) ** 3 for columns in self.members.columns) + self.truths.size * self.truths.shape[1]

    def left(self, information):
        """Entropy left after experiments of some information (N, U, U), ndarray (N,), nats."""
        misfits = _misfits(self.members, information, self.truths)
        own = misfits[:, np.arange(len(self.source)), self.source]
        exponents = self.members.log_weights - (misfits - own[..., None]) / 8.0
        mine = self.members.hypothesis == self.members.hypothesis[self.source][:, None]
        right = log_sum_exp(np.where(mine, exponents, -np.inf), axis=2)
        weights = np.exp(self.members.log_weights[self.source]) / _DRAWS
        return (log_sum_exp(exponents, axis=2) - right) @ weights


def _searched(members, instrument, poses, stream):
    """The experiment that leaves least entropy: its entries, their information, and the targets that are read."""
    criterion, reach = _Criterion.of(members, stream), instrument.reach
    every = list(range(len(instrument.model.targets)))
    pool, looks = _STATES // len(reach.shares), (1 + _EXCHANGES) * poses
    share = min(1.0, _WORK / (criterion.work * (pool + looks * _SHORT_LIST)))
    short = max(int(share * _SHORT_LIST), 2 * poses)
    entries = new_states.drawn(reach, max(int(share * pool), short), stream)
    entries, information = _short_list(criterion, instrument, entries, every, short, stream)
    chosen = []
    for _ in range(poses):
        total = information[chosen].sum(axis=0)
        left = criterion.left(total + information)
        left[chosen] = np.inf
        chosen.append(int(np.argmin(left)))
    for _ in range(_EXCHANGES):
        before = list(chosen)
        for place in range(poses):
            rest = [number for number in chosen if number != chosen[place]]
            left = criterion.left(information[rest].sum(axis=0) + information)
            left[rest] = np.inf
            chosen[place] = int(np.argmin(left))
        if chosen == before:
            break
    entries, information = entries.at(chosen), information[chosen]
    for radius in _RADII:
        tried = new_states.near(reach, entries, _NEIGHBOURS, radius, stream)
        told = instrument.information(tried, every)
        numbers = np.arange(poses)
        pool, known = entries.then(tried), np.concatenate([information, told])
        for place in range(poses):
            mine = np.append(place, poses + _NEIGHBOURS * place + np.arange(_NEIGHBOURS))
            rest = known[np.delete(numbers, place)].sum(axis=0)
            numbers[place] = mine[int(np.argmin(criterion.left(rest + known[mine])))]
        entries, information = pool.at(numbers), known[numbers]
    return _without_idle_targets(criterion, instrument, entries, information, every)


def _short_list(criterion, instrument, entries, targets, count, stream):
    """Half of a short list by what entries tell alone, half at random."""
    left, size = [], max(int(_MEMORY / instrument.unknowns**2), 1)
    for start in range(0, len(entries), size):
        part = entries.at(np.arange(start, min(start + size, len(entries))))
        left.append(criterion.left(instrument.information(part, targets)))
    order = np.argsort(np.concatenate(left), kind="stable")
    half = count // 2
    kept = entries.at(np.concatenate([order[:half], stream.permutation(order[half:])[: count - half]]))
    return kept, instrument.information(kept, targets)


def _without_idle_targets(criterion, instrument, entries, information, targets):
    """Leave out targets on further points that are not worth mounting."""
    nothing = np.zeros((1, *information.shape[1:]))
    start = criterion.left(nothing)[0]
    for point in instrument.extra_points:
        fewer = [target for target in targets if target != point]
        less = instrument.information(entries, fewer)
        with_it, without = (criterion.left(told.sum(axis=0)[None])[0] for told in (information, less))
        if without - with_it < _WORTH_A_TARGET * (start - with_it):
            targets, information = fewer, less
    return entries, information, targets


def _by_worth(members, information, stream):
    """Order of the entries in which each leaves least entropy after those before it."""
    criterion, order = _Criterion.of(members, stream), []
    total = np.zeros(information.shape[1:])
    for _ in range(len(information)):
        left = criterion.left(total + information)
        left[order] = np.inf
        order.append(int(np.argmin(left)))
        total = total + information[order[-1]]
    return np.array(order)


class _Promise:
    """What an experiment brings, by simulation with the same random numbers for every experiment."""

    def __init__(self, members, stream):
        self.members = members
        hypotheses = len(members.names)
        self.log_prior = np.array([log_sum_exp(members.log_weights[members.hypothesis == h]) for h in range(hypotheses)])
        truths, self.hypothesis = [], np.repeat(np.arange(hypotheses), _PROMISE_DRAWS)
        for h in range(hypotheses):
            mine = np.flatnonzero(members.hypothesis == h)
            share = np.exp(members.log_weights[mine] - self.log_prior[h])
            counts = np.bincount(stream.choice(len(mine), _PROMISE_DRAWS, p=share / share.sum()), minlength=len(mine))
            truths += [members.drawn(model, count, stream) for model, count in zip(mine, counts, strict=True)]
        self.truths = np.concatenate(truths)
        self.white = stream.standard_normal(self.truths.shape)

    def log_factors(self, information):
        """ln p of the simulated readings under each hypothesis, but for what is common to all; ndarray (N, H)."""
        members = self.members
        values, vectors = np.linalg.eigh(information)
        noise = self.white @ (vectors * np.sqrt(np.clip(values, 0.0, None))).T
        logs, of_truths = np.empty((len(self.truths), len(members.means))), self.truths @ information
        for number, (columns, mean, precision) in enumerate(
            zip(members.columns, members.means, members.precisions, strict=True)
        ):
            off = self.truths - mean
            seen = of_truths - mean @ information
            inner = precision + information[np.ix_(columns, columns)]
            along = (seen + noise)[:, columns]
            quadratic = ((seen + 2.0 * noise) * off).sum(axis=1) - (along * np.linalg.solve(inner, along.T).T).sum(axis=1)
            logs[:, number] = -0.5 * (quadratic + np.linalg.slogdet(inner)[1] - np.linalg.slogdet(precision)[1])
        logs += members.log_weights
        found = [log_sum_exp(logs[:, members.hypothesis == h], axis=1) for h in range(len(members.names))]
        return np.column_stack(found) - self.log_prior

    def separations(self, logs):
        """Separation of the best hypothesis from each by `log_factors` of an experiment, ndarray (H,); 0 for the best.

        Twice the mean log Bayes factor for the truth, or, where that is carried by a few large draws, the separation of two
        fixed hypotheses of which one gets odds of 19:1 as often: the smaller of both.
        """
        weights = np.exp(self.log_prior)
        found = np.zeros(len(weights))
        for h in range(1, len(weights)):
            shares = weights[[0, h]] / (weights[0] + weights[h])
            factors = [logs[self.hypothesis == true, true] - logs[self.hypothesis == true, h - true] for true in (0, h)]
            mean = shares @ [factor.mean() for factor in factors]
            often = shares @ [(factor >= np.log(19.0)).mean() for factor in factors]
            found[h] = max(min(2.0 * mean, separation_resolved(often)), 0.0)
        return found

    def resolved(self, logs):
        """Probability that the right hypothesis ends up with odds of 19:1, by `log_factors` of an experiment."""
        logs = logs + self.log_prior
        right = logs[np.arange(len(logs)), self.hypothesis] - log_sum_exp(logs, axis=1) >= np.log(0.95)
        weights = np.exp(self.log_prior[self.hypothesis]) / _PROMISE_DRAWS
        return float(right @ weights / weights.sum())


def _poses_needed(promise, total, resolved):
    """Poses after which 90 % are resolved: of those proposed, or as many more as tell the same; None beyond the most."""
    enough = np.flatnonzero(resolved >= WANTED_PROBABILITY)
    if len(enough):
        return int(enough[0]) + 1
    poses = len(resolved)
    low, high = poses, MOST_POSES
    if high <= poses or promise.resolved(promise.log_factors(total * (high / poses))) < WANTED_PROBABILITY:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        if promise.resolved(promise.log_factors(total * (middle / poses))) >= WANTED_PROBABILITY:
            high = middle
        else:
            low = middle
    return high


def _present_separation(linearized, found, alternative, factor):
    """What the present readings separate an effect as large as the one found from a model that is fitted to it."""
    problem = linearized.problem
    statistics = problem.statistics
    at = int(np.argmin(np.abs(statistics.pose_error_rad - found.pose_error_rad)))
    gram, along = statistics.gram[at] / factor**2, statistics.along[at] / factor**2

    def of(model):
        columns = np.concatenate([np.zeros(0, int), *(problem.units[n].columns for n in model.units)])
        deviations = factor * np.repeat(model.scales, [len(problem.units[n].columns) for n in model.units])
        return columns, gram[np.ix_(columns, columns)] + np.diag(deviations**-2)

    mine, inner = of(found)
    value = np.linalg.solve(inner, along[mine])
    others, inner = of(alternative)
    seen = gram[np.ix_(others, mine)] @ value
    return float(value @ gram[np.ix_(mine, mine)] @ value - seen @ np.linalg.solve(inner, seen))
