"""Audit of the probabilities of a verdict.

The search computes evidence from products of columns, after it has eliminated the
declared parameters. The audit computes it from the columns themselves, by the normal
density of all measurements with their covariance written out. The prior and the
probabilities of sets of mechanisms follow from the settings as docs/method.md states
them.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats
from scipy.linalg import solve_triangular
from scipy.special import gammaln, logit, logsumexp

from elastocal_proof.audit.finished_run import Finding, FinishedRun, compare

_OTHER = "other"
_GROSS_ERROR = "gross error"
# Absolute tolerance of log odds: the search leaves out improbable pose errors, and
# keeps the signs of other terms fixed while it sums over the scales of one.
_LOG_ODDS = 0.1
# Absolute tolerance of probabilities that follow from the stated log odds.
_PROBABILITY = 1e-6
# Less probable sets of mechanisms are not stated.
_STATED = 1e-3
_BY = "normal density with its covariance in full"


@dataclass(frozen=True)
class _Measurements:
    """All measurements at one size of the pose error, rotated so that the declared
    parameters are integrated out.

    Attributes
    ----------
    log_weight : log prior weight of this size, and its log determinant
    columns : (R, K), whitened candidate columns
    residual : (R,)
    """

    log_weight: float
    columns: np.ndarray
    residual: np.ndarray


class TracedEvidence:
    """Columns and models of a campaign, from results/evidence.

    Attributes
    ----------
    settings : settings of the diagnosis
    models : stated models, the most probable first
    """

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.settings: Mapping[str, Any] = document["settings"]
        self.models: Sequence[Mapping[str, Any]] = document["models"]
        self._document = document
        self._scales = np.array(self.settings["scales"])
        self._pose_errors = np.array(document["pose_error_rad"])
        self._span: tuple[int, ...] | None = None
        self._rotated: list[_Measurements] = []
        weights = self._weigh_pose_errors()
        self._measurements = [
            _integrate_declared(document, *size_and_weight)
            for size_and_weight in zip(self._pose_errors, weights, strict=True)
        ]

    def _weigh_pose_errors(self) -> np.ndarray:
        """Prior weights of the pose errors: zero, or half-Cauchy by size."""
        ratio = self._pose_errors / self.settings["pose_repeatability_rad"]
        density = ratio * stats.halfcauchy.pdf(ratio)
        present = self.settings["pose_error_probability"]
        density *= present / max(density.sum(), np.finfo(float).tiny)
        return np.asarray(np.where(ratio > 0.0, density, 1.0 - present))

    def list_terms(self, model: Mapping[str, Any]) -> list[Mapping[str, Any]]:
        """List the terms of a model."""
        return [self._document["terms"][number] for number in model["terms"]]

    def _select_columns(
        self, terms: Sequence[Mapping[str, Any]], scales: Sequence[float]
    ) -> tuple[list[int], np.ndarray]:
        """Select the columns of some terms, with their prior standard deviations."""
        columns = [column for term in terms for column in term["columns"]]
        return columns, np.repeat(scales, [len(term["columns"]) for term in terms])

    def compute_log_density(
        self, terms: Sequence[Mapping[str, Any]], scales: Sequence[float]
    ) -> float:
        """Compute the log density of all measurements under terms of given scales,
        averaged over the pose error."""
        columns, deviations = self._select_columns(terms, scales)
        signs = np.array([sign for term in terms for sign in term["signs"]])
        count = self._document["degrees_of_freedom"]
        densities = [
            measurements.log_weight
            + _compute_log_normal(
                measurements.columns * deviations, measurements.residual, signs, count
            )
            for measurements in self._rotate_into(tuple(columns))
        ]
        return float(logsumexp(densities))

    def _rotate_into(self, columns: tuple[int, ...]) -> list[_Measurements]:
        """Rotate the measurements into the span of some columns and the residual, beyond
        which the covariance is one at any scales; the last span is kept."""
        if self._span != columns:
            self._span = columns
            self._rotated = []
            for measurements in self._measurements:
                values = [measurements.columns[:, columns], measurements.residual]
                triangle = np.array(np.linalg.qr(np.column_stack(values), mode="r"))
                self._rotated.append(
                    _Measurements(
                        measurements.log_weight, triangle[:, :-1], triangle[:, -1]
                    )
                )
        return self._rotated

    def compute_log_evidence(self, model: Mapping[str, Any]) -> float:
        """Compute the log evidence of a model: the product of the sums over the scales
        of each term about the stated ones."""
        terms = self.list_terms(model)
        stated = model["scales"]
        weights = [self._weigh_scales(term) for term in terms]
        at_mode = self.compute_log_density(terms, stated)
        for weight, scale in zip(weights, stated, strict=True):
            at_mode += weight[scale]
        total = at_mode
        for index, weight in enumerate(weights):
            profile = []
            for scale, log_weight in weight.items():
                scales = [*stated[:index], scale, *stated[index + 1 :]]
                profile.append(log_weight + self.compute_log_density(terms, scales))
            total += logsumexp(profile) - profile[[*weight].index(stated[index])]
        return float(total)

    def _weigh_scales(self, term: Mapping[str, Any]) -> dict[float, float]:
        """Log weights of the scales of a term, by scale: split normal in the logarithm
        of the scale."""
        distance = np.log(self._scales / self.settings["scale_center"])
        below, above = self.settings["scale_spread"]
        weights = -0.5 * (distance / np.where(distance < 0, below, above)) ** 2
        end = term["largest"] % len(weights) + 1
        chosen = slice(term["smallest"], end)
        log_weights = weights[chosen] - logsumexp(weights[chosen])
        return dict(zip(self._scales[chosen].tolist(), log_weights, strict=True))

    def compute_log_prior(self, model: Mapping[str, Any]) -> float:
        """Compute the log prior odds of a model against the declared model alone."""
        settings = self.settings
        terms = self.list_terms(model)
        total = sum(term["log_prior"] for term in terms)
        counts = Counter(term["mechanism"] for term in terms)
        gross_errors = counts.pop(_GROSS_ERROR, 0)
        total += gross_errors * logit(settings["gross_error_probability"])
        for mechanism, count in counts.items():
            locations = self._document["locations"][mechanism]
            geometric = settings["further_location"] ** np.arange(1, locations + 1)
            log_sets = gammaln(locations + 1)
            log_sets -= gammaln(count + 1) + gammaln(locations - count + 1)
            total += logit(self._get_presence(mechanism)) - log_sets
            total += np.log(geometric[count - 1] / geometric.sum())
        if counts:
            none = (1 - settings["mechanism_probability"]) ** self._document["effects"]
            none *= 1 - settings["other_probability"]
            total += logit(none) - logit(settings["nothing_probability"])
        return float(total)

    def _get_presence(self, mechanism: str) -> float:
        """Prior probability of a mechanism."""
        names = {
            "link_weight": "gravity_probability",
            _OTHER: "other_probability",
            "local effect": "other_probability",
        }
        name = names.get(mechanism, "mechanism_probability")
        return float(self.settings[name])

    def state_probabilities(self) -> dict[tuple[str, ...], float]:
        """Compute the probability of each set of mechanisms from the stated log odds,
        tempered between sets by which something is missing."""
        by_set = self._sum_by_set()
        nothing = by_set.pop((), 0.0)
        missing = {names: value for names, value in by_set.items() if value > 0.0}
        if not missing:
            return {(): nothing}
        power = self._compute_power()
        leader = max(missing, key=missing.__getitem__)

        def temper(names: tuple[str, ...]) -> float:
            prior = sum(logit(self._get_presence(name)) for name in names)
            return float(prior + power * (np.log(missing[names]) - prior))

        odds = {}
        for names, value in missing.items():
            odds[names] = temper(names)
            if set(names) > set(leader):
                odds[names] = temper(leader) + np.log(value / missing[leader])
        shares = np.exp(np.array([*odds.values()]) - logsumexp([*odds.values()]))
        shares *= sum(missing.values())
        return {(): nothing} | dict(zip(odds, shares.tolist(), strict=True))

    def _sum_by_set(self) -> dict[tuple[str, ...], float]:
        """Sum the probabilities of the models by their set of mechanisms."""
        log_odds = np.array([model["log_odds"] for model in self.models])
        probabilities = np.exp(log_odds - logsumexp(log_odds))
        by_set: dict[tuple[str, ...], float] = defaultdict(float)
        for model, probability in zip(self.models, probabilities, strict=True):
            by_set[self._find_acting(model, probability)] += probability
        return by_set

    def _compute_power(self) -> float:
        """Power to which odds between mechanisms are tempered: the smaller, the larger
        the displacements that laws describe only nearly."""
        best = next(model for model in self.models if model["terms"])
        mechanisms = {term["mechanism"] for term in self.list_terms(best)}
        squares = sum(self._split_squares(best, {name})[0][0] for name in mechanisms)
        departure = self.settings["confusable_share"]
        departure *= self.settings["law_tolerance"] ** 2 * squares
        return float(1.0 / (1.0 + 0.5 * departure))

    def _find_acting(
        self, model: Mapping[str, Any], probability: float
    ) -> tuple[str, ...]:
        """Mechanisms of a model without the smooth error, or without all others, if these
        are within the tolerance of laws."""
        names = {term["mechanism"] for term in self.list_terms(model)}
        laws = names - {_OTHER}
        acting = names
        if laws and laws != names and probability > _STATED:
            law_tolerance = self.settings["law_tolerance"] ** 2
            smooth_tolerance = self.settings["smooth_tolerance"] ** 2
            of_laws, of_smooth = self._split_squares(model, laws)
            if of_smooth[1] < law_tolerance * of_laws[0]:
                acting = laws
            elif (
                of_laws[1] < law_tolerance * of_smooth[0]
                or of_laws[0] < smooth_tolerance * of_smooth[0]
            ):
                acting = {_OTHER}
        return tuple(sorted(acting))

    def _split_squares(
        self, model: Mapping[str, Any], mechanisms: set[str]
    ) -> list[tuple[float, float]]:
        """Whitened squares of the displacements by some mechanisms of a model, and by its
        other mechanisms: of each group in all, and of the part outside the span of the
        other group."""
        terms = self.list_terms(model)
        columns, deviations = self._select_columns(terms, model["scales"])
        distance = np.abs(self._pose_errors - model["pose_error_rad"])
        measurements = self._measurements[int(np.argmin(distance))]
        spread = measurements.columns[:, columns] * deviations
        unexplained = _solve_covariance(spread, measurements.residual)
        coefficients = deviations * (spread.T @ unexplained)
        in_group = np.concatenate(
            [len(term["columns"]) * [term["mechanism"] in mechanisms] for term in terms]
        )
        at_rest = self._measurements[0].columns[:, columns]
        squares = []
        for group in (in_group, ~in_group):
            made = at_rest[:, group] @ coefficients[group]
            of_complement = at_rest[:, ~group] * deviations[~group]
            unexplained = _solve_covariance(of_complement, made)
            squares.append((float(made @ made), float(made @ unexplained)))
        return squares


def _solve_covariance(spread: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Solve for values (R,) with the covariance I + spread spread'."""
    return np.linalg.solve(np.eye(len(spread)) + spread @ spread.T, values)


def _compute_log_normal(
    spread: np.ndarray, residual: np.ndarray, signs: np.ndarray, count: int
) -> float:
    """Compute the log density of a residual with the covariance I + spread spread'.

    Parameters
    ----------
    spread : (R, k), columns times the prior standard deviations of their coefficients
    residual : (R,)
    signs : (k,), sign that physics gives a coefficient, 0 if it may have either
    count : degrees of freedom, from which the noise is estimated if it exceeds one
    """
    covariance = stats.Covariance.from_cholesky(
        np.linalg.cholesky(np.eye(len(spread)) + spread @ spread.T)
    )
    white = covariance.whiten(residual)
    squares = float(white @ white)
    variance = max(squares / count, 1.0)
    density = -0.5 * (covariance.log_pdet + count * np.log(variance))
    density -= 0.5 * squares / variance
    # Half-normal priors: twice the probability of the sign that physics gives.
    gains = covariance.whiten(spread.T)
    std = np.sqrt(variance * (1.0 - (gains**2).sum(axis=1)))
    of_sign = np.log(2.0) + stats.norm.logcdf(signs * (gains @ white) / std)
    return float(density + of_sign[signs != 0].sum())


def _integrate_declared(
    document: Mapping[str, Any], pose_error_rad: float, weight: float
) -> _Measurements:
    """Whiten all measurements by their covariance, and rotate the declared parameters
    out.

    Parameters
    ----------
    document : contents of a file of results/evidence
    pose_error_rad : error of each joint that the measurements of a pose have in common
    weight : its prior weight
    """
    pose = np.array(document["pose"])
    jacobian = np.array(document["jacobian"]) * pose_error_rad
    same_pose = pose[:, None] == pose
    factor = np.linalg.cholesky(np.eye(len(pose)) + same_pose * (jacobian @ jacobian.T))
    values = [np.array(document[name]) for name in ("declared", "candidates")]
    values.append(np.array(document["residual"])[:, None])
    measured = solve_triangular(factor, np.concatenate(values, axis=1), lower=True)
    # A prior is one more measurement of each declared parameter.
    precision = 1.0 / np.array(document["prior_std"])
    count = len(precision)
    prior = np.zeros((count, measured.shape[1]))
    prior[:, :count] = np.diag(precision)
    prior[:, -1] = -np.array(document["present"]) * precision
    rows = np.concatenate([measured, prior])
    norms = np.linalg.norm(rows[:, :count], axis=0)
    rows[:, :count] /= norms
    triangle = np.array(np.linalg.qr(rows, mode="r"))
    log_det = np.log(np.diag(factor)).sum()
    log_det += np.log(np.abs(np.diag(triangle)[:count]) * norms).sum()
    with np.errstate(divide="ignore"):
        log_weight = np.log(weight) - log_det
    return _Measurements(log_weight, triangle[count:, count:-1], triangle[count:, -1])


def check_evidence(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """Log odds of sampled models, and the probability of each mechanism and set in the
    verdict."""
    document = run.document(file)
    if not document:
        return
    trace = TracedEvidence(document)
    declared_alone = trace.compute_log_density([], [])
    chosen = [0, *run.pick(file, len(trace.models)).tolist()]
    expected = [
        trace.compute_log_evidence(trace.models[number])
        - declared_alone
        + trace.compute_log_prior(trace.models[number])
        for number in chosen
    ]
    yield compare(
        f"log odds of {len(chosen)} of {len(trace.models)} models",
        _BY,
        [trace.models[number]["log_odds"] for number in chosen],
        expected,
        0.0,
        _LOG_ODDS,
    )
    stated = run.document(f"reports/loop/{campaign}/verdict.json")["probabilities"]
    yield from _compare_probabilities(trace.state_probabilities(), stated)


def _compare_probabilities(
    by_set: Mapping[tuple[str, ...], float], stated: Mapping[str, Any]
) -> Iterator[Finding]:
    """Compare the probabilities of sets and mechanisms with those of a verdict."""
    by_mechanism: dict[str, float] = defaultdict(float)
    for names, probability in by_set.items():
        for name in names:
            by_mechanism[name] += probability
    sets = {tuple(entry["mechanisms"]): entry for entry in stated["sets"]}
    pairs = {
        "nothing": ([stated["nothing"]], [by_set[()]]),
        "sets of mechanisms": (
            [entry["probability"] for entry in sets.values()],
            [by_set.get(names, 0.0) for names in sets],
        ),
        "mechanisms": (
            [*stated["mechanisms"].values()],
            [by_mechanism[name] for name in stated["mechanisms"]],
        ),
    }
    for name, compared in pairs.items():
        yield compare(
            f"probability of {name}", "numpy, scipy", *compared, 0.0, _PROBABILITY
        )


CHECKS = {"results/evidence/{campaign}.json": check_evidence}
