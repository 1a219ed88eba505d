"""The next experiment: poses and loads after which the measurements, most probably, say which hypothesis holds.

Each pose is read at the campaign's targets without its load and under it. Loads are those of the campaign, made as large as its
largest or as the rated payload.

Models of the posterior are linear in their coefficients, so that what an experiment tells is one matrix, its information G on
declared parameters and units together. A model j that present measurements leave with coefficients N(m_j, P_j^-1) expects
measurements with mean A_j m_j and covariance I + A_j P_j^-1 A_j', A'A = G. If measurements come from coefficients t instead,
then on average

    -2 ln p_j = u'G u - u'G_j (P_j + G_jj)^-1 G_j'u + tr((P_j + G_jj)^-1 P_j) + ln |P_j + G_jj| - ln |P_j| - d_j + const,

with u = t - m_j and d_j coefficients. Of random entries those are chosen, one after the other, that leave the least entropy
between the hypotheses (Lindley, Annals of Mathematical Statistics 1956), by pairwise Bhattacharyya coefficients (Kolchinsky and
Tracey, Entropy 2017). What is promised of them is simulated with coefficients from the posterior: preposterior analysis (Raiffa
and Schlaifer, Applied Statistical Decision Theory, 1961).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.constants import g as standard_gravity

from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.refit import mean_square_left
from elastocal.diagnosis.statistics import normal_equations
from elastocal.diagnosis.verdict import ADEQUATE, NAMED, NOT_TESTABLE, Evidence, mechanisms_of_models
from elastocal.fitting.linearization import effect_columns, linearize
from elastocal.fitting.model import conditions
from elastocal.fitting.normal_equations import whitening
from elastocal.fitting.observations import Observations, States
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.hypotheses import Unit
    from elastocal.diagnosis.linearize import Linearized
    from elastocal.diagnosis.search import Model
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.mechanics.robot import Robot

    _Name = tuple[str, ...]
    # Joint angles (E, n), rad, and loads (E, 6) at the last measuring point in base axes, N and N m, of E poses.
    Entries = tuple[np.ndarray, np.ndarray]

# Said where nothing within reach helps.
NOT_DISTINGUISHABLE = "not distinguishable with this robot and tracker"
NOTHING_MISSING, NOTHING_AMBIGUOUS = "nothing is missing", "nothing is ambiguous"
DATA_AT_FAULT, NOTHING_TESTABLE = "the data are at fault", "the measurements can test no mechanism"
# Entries that are chosen from, and multiplications that the choice may take; numbers in memory at once.
_ENTRIES, _WORK, _MEMORY = 600, 4e9, 5e5
# Models that stand for the hypotheses; the others hold a few per cent.
_MODELS, _HYPOTHESES = 12, 8
# Draws of each model's coefficients for the choice and for the promise.
_DRAWS, PROMISE_DRAWS = 4, 300
# Poses after which nobody goes on: some two days with a tracker.
_MOST_POSES = 100


def drawn(states: States, robot: Robot, count: int, stream: np.random.Generator) -> Entries:
    """Random entries within reach of a robot, under the heavier loads of the states of its campaign."""
    low, high = np.clip(robot.joint_limits, -np.pi, np.pi).T
    angles = low + (high - low) * stream.random((count, len(low)))
    size = np.linalg.norm(states.wrench[:, :3], axis=1)
    if not size.any():
        return angles, np.zeros((count, 6))
    heavy = np.flatnonzero(size >= np.median(size[size > 0]))
    chosen = heavy[stream.integers(0, len(heavy), count)]
    largest = max(size.max(), (robot.payload_kg or 0.0) * standard_gravity)
    return angles, states.wrench[chosen] * (largest / size[chosen])[:, None]


@dataclass(frozen=True)
class Instrument:
    """Turns entries into information on declared parameters and units.

    `fitted`: about which sensitivities are taken. `linearized`: in the parameters of whose products information is stated.
    `units`: in the order of the columns. `noise`: with the error common to the measurements of a pose. `states`: of the
    campaign, whose last session, time and usual temperature go on.
    """

    fitted: Fit
    linearized: Linearized
    units: tuple[Unit, ...]
    noise: Noise
    states: States

    def information(self, entries: Entries) -> np.ndarray:
        """Fisher information on all U unknowns in each entry, ndarray (E, U, U)."""
        model, estimate, observations = self.fitted.model, self.fitted.estimate, self.observations(entries)
        # Nothing comes after the last row of the campaign but these.
        around = replace(conditions(model, estimate, observations.states), progress=np.ones(len(observations.states)))
        line, products = linearize(model, estimate, observations, around), self.linearized.products
        jacobian, columns = line.coordinate_jacobian, np.concatenate([unit.columns for unit in self.units])
        laws = [(law.displacement, unit.shapes) for unit in self.units if (law := unit.candidate or unit.law)]
        made = effect_columns(laws, line.conditions, jacobian, observations.state)
        declared = [owner not in self.linearized.candidates for owner, _ in self.fitted.parameters]
        white = whitening(observations, jacobian[..., : model.sites.joints], self.noise)
        basis = white.apply(line.sensitivities[..., declared]) @ products.into_basis
        beside = white.apply(made * np.concatenate([unit.sizes for unit in self.units]))
        rows = np.concatenate([basis, beside - basis @ products.projected[:, columns]], axis=-1)
        rows = rows.reshape(len(entries[0]), -1, rows.shape[-1])
        return np.asarray(rows.transpose(0, 2, 1) @ rows)

    def observations(self, entries: Entries) -> Observations:
        """Entries as observations, those of an entry together, joints approached from either side in turn; zeros measured."""
        model, (angles, wrench), own = self.fitted.model, entries, self.states
        # Without the load, and under it.
        shares = np.array([0.0, 1.0] if own.wrench[:, :3].any() else [1.0])
        entry, load = np.repeat(np.arange(len(angles)), len(shares)), np.tile(np.arange(len(shares)), len(angles))
        count, targets = len(entry), len(model.targets)
        side = np.where(np.add.outer(np.arange(count), np.arange(angles.shape[1])) % 2, -1.0, 1.0)
        states = States(
            np.full(count, self.fitted.estimate.sessions[-1]),
            entry,
            load,
            angles[entry],
            wrench[entry] * shares[load, None],
            np.ones(count, int),
            None if own.approach is None else side,
            None if own.time_s is None else np.full(count, own.time_s.max()),
            None if own.temperature_c is None else np.full(count, own.temperature_c.mean()),
        )
        state, target = np.repeat(np.arange(count), targets), np.tile(np.arange(targets), count)
        rotation = np.tile(np.eye(3), (len(target), 1, 1)) if model.rows == 6 else None
        return Observations(states, state, target, np.zeros((len(target), 3)), rotation)


@dataclass(frozen=True)
class Alternative:
    """A model as it is after the present measurements.

    `name`: of its hypothesis. `columns` (d,): of the unknowns that it has. `mean` (U,): of the unknowns; zero for those that it
    does not have. `precision` (d, d): of its coefficients, for which half-normal priors count as normal ones.
    """

    name: _Name
    log_odds: float
    columns: np.ndarray
    mean: np.ndarray
    precision: np.ndarray

    def drawn(self, count: int, stream: np.random.Generator) -> np.ndarray:
        """Coefficients from its posterior, ndarray (count, U)."""
        found, root = np.repeat(self.mean[None], count, axis=0), np.linalg.inv(np.linalg.cholesky(self.precision))
        found[:, self.columns] += stream.standard_normal((count, len(self.columns))) @ root
        return found


def alternatives_of(
    linearized: Linearized, units: Sequence[Unit], kept: Sequence[tuple[_Name, Model]], factor: float
) -> list[Alternative]:
    """Posterior of the coefficients of each model in the unknowns of some units, in units of `factor` times the noise taken.

    All are taken at the pose error of the first one.
    """
    problem, products, count = linearized.problem, linearized.products, linearized.products.declared
    total = normal_equations(products, kept[0][1].pose_error_rad) / factor**2
    place, known = np.zeros(len(total), int), np.arange(count)
    columns = count + np.concatenate([unit.columns for unit in units])
    place[columns] = np.arange(count, count + len(columns))
    found = []
    for name, model in kept:
        mine, deviations = problem.columns_of(model.units, model.scales)
        chosen, at = np.append(known, count + mine), np.append(known, place[count + mine])
        precision = total[np.ix_(chosen, chosen)] + np.diag(np.append(0.0 * known, (factor * deviations) ** -2))
        mean = np.zeros(count + len(columns))
        mean[at] = np.linalg.solve(precision, total[chosen, -1])
        found.append(Alternative(name, model.log_odds, at, mean, precision))
    return found


class Hypotheses:
    """Models by the hypotheses to which they belong, the best first, and coefficients that might be true.

    `names` (H). `log_priors` (H,): of their probabilities before the experiment. `truths` (T, U): so many draws of each model.
    `source` (T,) of int: hypothesis of each.
    """

    def __init__(self, models: Sequence[Alternative], draws: int, stream: np.random.Generator) -> None:
        self.models, self.names = models, list(dict.fromkeys(model.name for model in models))
        self._own = np.array([self.names.index(model.name) for model in models])
        odds = np.array([model.log_odds for model in models])
        self._log_weights = odds - log_sum_exp(odds)
        self.log_priors = self._summed(self._log_weights)
        self.truths = np.concatenate([model.drawn(draws, stream) for model in models])
        self._model = np.repeat(np.arange(len(models)), draws)
        self.source, self._weights = self._own[self._model], np.exp(self._log_weights[self._model]) / draws
        self._white = stream.standard_normal(self.truths.shape)

    def _summed(self, logs: np.ndarray) -> np.ndarray:
        """Logarithms (..., M) for models as those for hypotheses, (..., H)."""
        each = [log_sum_exp(logs[..., self._own == h], axis=-1) for h in range(len(self.names))]
        return np.stack(each, axis=-1)

    def misfits(self, information: np.ndarray, noise: np.ndarray | None = None) -> np.ndarray:
        """-2 ln p of measurements that the true coefficients make under each model, but for what is common to all models.

        `information` (N, U, U): of N experiments. `noise` (T, U): its products with the sensitivities, of variance G; on
        average over the noise where it is not given. Returns (N, T, M).
        """
        expected = information @ self.truths.T
        squares = (expected * self.truths.T).sum(axis=1)
        if noise is not None:
            expected, squares = expected + noise.T, squares + 2.0 * (noise * self.truths).sum(axis=1)
        found = np.empty((len(information), len(self.truths), len(self.models)))
        for number, model in enumerate(self.models):
            of_mean = information @ model.mean
            left = squares - 2.0 * model.mean @ expected + (of_mean @ model.mean)[:, None]
            seen = expected[:, model.columns] - of_mean[:, model.columns, None]
            inner = information[:, model.columns[:, None], model.columns] + model.precision
            inverse = np.linalg.inv(inner)
            left -= (seen * (inverse @ seen)).sum(axis=1)
            common = np.linalg.slogdet(inner)[1] - np.linalg.slogdet(model.precision)[1]
            if noise is None:
                common += (inverse * model.precision).sum(axis=(1, 2)) - len(model.columns)
            found[..., number] = left + common[:, None]
        return found

    def entropy_left(self, information: np.ndarray) -> np.ndarray:
        """Of the hypotheses after experiments of some information (N, U, U), ndarray (N,), nats."""
        misfits = self.misfits(information)
        own = misfits[:, np.arange(len(self._model)), self._model]
        logs = self._summed(self._log_weights - (misfits - own[..., None]) / 8.0)
        return (log_sum_exp(logs, axis=2) - logs[:, np.arange(len(self.source)), self.source]) @ self._weights

    def promise(self, information: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """What a whole experiment of some information (U, U) brings, by simulation.

        Returns, of the best hypothesis beside each (H,), twice the mean log Bayes factor for the true one of both and how often
        that reaches 19; and the probability that the right one of all ends up with odds of 19:1.
        """
        values, vectors = np.linalg.eigh(information)
        noise = self._white @ (vectors * np.sqrt(np.clip(values, 0.0, None))).T
        logs = self._summed(self._log_weights - 0.5 * self.misfits(information[None], noise)[0])
        right = logs[np.arange(len(logs)), self.source] - log_sum_exp(logs, axis=1) >= np.log(0.95)
        factors = logs - self.log_priors
        factors = np.where(self.source[:, None] > 0, -1.0, 1.0) * (factors[:, :1] - factors)
        both = (self.source[:, None] == 0) | (self.source[:, None] == np.arange(len(self.names)))
        weights = both * self._weights[:, None] / (both * self._weights[:, None]).sum(axis=0)
        separations = 2.0 * (weights * factors).sum(axis=0)
        return np.maximum(separations, 0.0), (weights * (factors >= np.log(19.0))).sum(axis=0), float(self._weights @ right)

    def best_of(self, information: np.ndarray, count: int) -> list[int]:
        """So many entries, of which there is the information in each (E, U, U), each the best beside those before it."""
        size, chosen = max(int(_MEMORY / information.shape[1] ** 2), 1), list[int]()
        for _ in range(count):
            known, parts = information[chosen].sum(axis=0), np.split(information, range(size, len(information), size))
            left = np.concatenate([self.entropy_left(known + part) for part in parts])
            left[chosen] = np.inf
            chosen.append(int(np.argmin(left)))
        return chosen


def propose(diagnosis: Diagnosis, stream: np.random.Generator, poses: int = 10) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Choose the poses and loads that most probably resolve what a diagnosis leaves ambiguous.

    Returns columns of the table of poses, in the order of their worth: ``effect``, the best hypothesis and the nearest other;
    ``pose``; ``point``, at which targets are read; joint angles as the controller reports them (rad); the load; and what they
    and all before them promise, ``separation`` from the nearest other, 16 of which gives the true one odds of 19:1 from even
    ones with 90 %, and ``resolved``, the probability that the right one of all then has 95 %. And what verdict.json says:
    ``reason`` why there is nothing to measure, and what is ``indistinguishable`` from the best by any experiment within reach,
    which the promise leaves aside.
    """
    campaign, evidence = diagnosis.case.campaign, diagnosis.evidence
    if evidence is None:
        return _stated(campaign.robot, (), DATA_AT_FAULT)
    kept, reason = _ambiguous(evidence)
    best = evidence.conclusion.best.mechanisms
    if reason:
        return _stated(campaign.robot, best, reason)
    linearized, states, lead = evidence.linearized, diagnosis.case.observations.states, kept[0][1]
    factor = float(np.sqrt(max(mean_square_left(linearized.problem, lead), 1.0)))
    noise = replace(linearized.about.noise.scaled(factor), pose_rad=factor * lead.pose_error_rad)
    units = tuple(linearized.problem.units[n] for n in sorted({n for _, model in kept for n in model.units}))
    models = alternatives_of(linearized, units, kept, factor)
    choosing = Hypotheses(models, _DRAWS, stream)
    # Hypotheses of a hundred units each leave time for few entries.
    work = sum(len(model.columns) ** 3 for model in models) + choosing.truths.size * choosing.truths.shape[1]
    angles, wrench = drawn(states, campaign.robot, int(np.clip(_WORK / (work * 2 * poses), 2 * poses, _ENTRIES)), stream)
    information = Instrument(diagnosis.final, linearized, units, noise, states).information((angles, wrench))
    chosen = choosing.best_of(information, poses)
    promising = Hypotheses(models, PROMISE_DRAWS, stream)
    _, often, _ = promising.promise(information[chosen].sum(axis=0) * (_MOST_POSES / poses))
    unreachable = [name for name, share in zip(promising.names[1:], often[1:], strict=True) if share < 0.5]
    if unreachable:
        models = [model for model in models if model.name not in unreachable]
        promising = Hypotheses(models, PROMISE_DRAWS, stream)
        # What is distinguishable from the best holds no more probability than is left open where nothing is ambiguous.
        if np.exp(promising.log_priors[0]) >= linearized.settings.credible:
            return _stated(campaign.robot, best, NOT_DISTINGUISHABLE, unreachable)
        chosen = Hypotheses(models, _DRAWS, stream).best_of(information, poses)
    promised = [promising.promise(total) for total in np.cumsum(information[chosen], axis=0)]
    apart = np.array([separations[1:] for separations, _, _ in promised])
    point = " ".join(dict.fromkeys(target.point for target in diagnosis.final.model.targets))
    table = angles[chosen], wrench[chosen], point, apart.min(axis=1), np.array([resolved for _, _, resolved in promised])
    return _stated(campaign.robot, best, "", unreachable, promising.names[1 + int(np.argmin(apart[-1]))], table)


def _stated(
    robot: Robot,
    best: _Name,
    reason: str,
    indistinguishable: Sequence[_Name] = (),
    nearest: _Name = (),
    table: tuple[np.ndarray, np.ndarray, str, np.ndarray, np.ndarray] | None = None,
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    nothing = np.zeros(0)
    angles, wrench, point, separation, resolved = table or (np.zeros((0, robot.joints)), np.zeros((0, 6)), "", nothing, nothing)
    count = len(angles)
    columns = {
        "effect": np.full(count, f"{' + '.join(best)} or {' + '.join(nearest)}"),
        "pose": np.arange(count),
        "point": np.full(count, point),
        **{f"q{joint}": angle for joint, angle in enumerate(robot.reported_angles(angles).T, 1)},
        **dict(zip(WRENCH_NAMES, wrench.T, strict=True)),
        "separation": separation,
        "resolved": resolved,
    }
    last = {name: float(columns[name][-1]) if count else None for name in ("separation", "resolved")}
    names = {"best": list(best), "nearest": list(nearest), "indistinguishable": [list(name) for name in indistinguishable]}
    return columns, {"poses": count, "reason": reason} | names | last


def _ambiguous(evidence: Evidence) -> tuple[list[tuple[_Name, Model]], str]:
    """Models of the credible hypotheses with their names, those of the best first; or why there is nothing to resolve."""
    conclusion, found = evidence.conclusion, evidence.posterior
    if conclusion.verdict in (ADEQUATE, NOT_TESTABLE):
        return [], NOTHING_MISSING if conclusion.verdict == ADEQUATE else NOTHING_TESTABLE
    there = [h for h in conclusion.hypotheses if h.mechanisms and h.model >= 0]
    reached = np.cumsum([h.probability for h in there])
    credible = there[: int(np.searchsorted(reached, evidence.linearized.settings.credible * reached[-1])) + 1]
    names = [conclusion.best.mechanisms, *(h.mechanisms for h in credible if h != conclusion.best)][:_HYPOTHESES]
    # Where the verdict names one mechanism, whatever else is beside it does not make the name ambiguous.
    instead = [name for name in names[1:] if not set(name) >= set(names[0])]
    if len(names) < 2 or (conclusion.verdict == NAMED and not instead):
        return [], NOTHING_AMBIGUOUS
    models: dict[_Name, list[Model]] = {name: [] for name in names}
    room = _MODELS - len(names)
    for model, name in zip(found.models, mechanisms_of_models(evidence.linearized.problem, found), strict=True):
        if name in models and (not models[name] or room > 0):
            room -= bool(models[name])
            models[name].append(model)
    return [(name, model) for name, those in models.items() for model in those], ""
