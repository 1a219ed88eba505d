"""Conclude from the posterior which mechanisms act, how probably, and with which verdict.

A hypothesis is a set of mechanisms, whatever their locations. The competitor `OTHER`
together with a mechanism means that a related mechanism acts; `OTHER` alone means that
the catalogue does not have what acts.

The probability of a mechanism is its posterior inclusion probability [1]_, summed over
hypotheses. No machine follows a modelled law exactly. So the part that the smooth error
adds to a mechanism counts as the mechanism itself while it is small in comparison.

References
----------
.. [1] Barbieri, M. M. and Berger, J. O., Optimal predictive model selection, Annals of
   Statistics 32, 2004.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc, fdtrc

from elastocal.diagnosis.confounding import (
    compute_joint_p_value,
    find_confounded_mechanisms,
)
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.model_averaging import compute_extra_squares
from elastocal.diagnosis.tempering import temper_hypotheses
from elastocal.fitting.least_squares import compute_negative_compliances
from elastocal.fitting.noise import count_effective_parameters

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from elastocal.diagnosis.alarm import Alarm
    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.diagnosis.search import Posterior, ScoredModel, SearchProblem
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.verdict import RepeatableResidual

Location = tuple[int | str, ...]
ADEQUATE = "adequate"
NAMED = "named"
CLASS = "class"
SEVERAL = "several"
UNEXPLAINED = "unexplained"
NOT_TESTABLE = "not_testable"
# Family of the effects of the measurement itself. Every campaign can test them, even one
# of a single pose, so not finding one says nothing about the robot.
_SETUP_FAMILY = "drift"
# Models below this probability change no probability that is reported; hypotheses and
# locations below it are not listed.
MIN_REPORTED_PROBABILITY = 1e-3


@dataclass(frozen=True)
class Hypothesis:
    """A set of mechanisms with its posterior probability.

    Attributes
    ----------
    mechanisms : tuple of str
        Names in alphabetical order; empty for "nothing is missing".
    probability : float
        Sum over the models of the set.
    model : int
        Index of its most probable model in the posterior; -1 if there is none.
    """

    mechanisms: tuple[str, ...]
    probability: float
    model: int

    @property
    def named(self) -> tuple[str, ...]:
        """Its mechanisms that are in the catalogue."""
        return tuple(name for name in self.mechanisms if name != OTHER)


@dataclass(frozen=True)
class Conclusion:
    """The verdict that follows from a posterior and an alarm.

    Attributes
    ----------
    verdict : str
        One of the six verdicts above.
    hypotheses : tuple of Hypothesis
        The most probable one first; "nothing" is among them.
    best : Hypothesis
        The most probable one that agrees with the alarm: "nothing" without an alarm.
    alternatives : dict
        For each mechanism of the best hypothesis, mechanisms that may be meant instead.
    mechanisms : dict
        Posterior inclusion probability of each mechanism, in falling order.
    probability : float or None
        Probability that one of the hypotheses is right which the verdict leaves open;
        None if nothing was tested.
    """

    verdict: str
    hypotheses: tuple[Hypothesis, ...]
    best: Hypothesis
    alternatives: dict[str, tuple[str, ...]]
    mechanisms: dict[str, float]
    probability: float | None


@dataclass(frozen=True)
class Evidence:
    """Result of the last search of a diagnosis; there is none if the data are at fault.

    Attributes
    ----------
    design : CandidateDesign
        The linearised problem.
    posterior : Posterior
        Models with their probabilities.
    alarm : Alarm
        Test of whether anything is missing.
    conclusion : Conclusion
        The verdict.
    fitted : Fit
        The model found, fitted to the observations of the search.
    expected_to_help : bool
        Whether the effects found are expected to make predictions better.
    adopted : bool
        Whether they enter the model.
    settled : bool
        Whether a further linearisation would lead to the same model.
    tested : tuple
        The last fit whose residuals were tested for a function of the joints, and the
        result of that test; both None if there was no test.
    """

    design: CandidateDesign
    posterior: Posterior
    alarm: Alarm
    conclusion: Conclusion
    fitted: Fit
    expected_to_help: bool = False
    adopted: bool = False
    settled: bool = False
    tested: tuple[Fit | None, RepeatableResidual | None] = (None, None)

    @property
    def named_model(self) -> ScoredModel:
        """Most probable model of the best hypothesis; the declared model alone if the
        hypothesis names no mechanism of the catalogue."""
        best = self.conclusion.best
        if best.named:
            return self.posterior.models[best.model]
        return self.posterior.empty_model


def conclude(problem: SearchProblem, posterior: Posterior, alarm: Alarm) -> Conclusion:
    """Choose the verdict of least expected loss.

    Without an alarm the declared model is adequate, or not testable if the candidates
    say nothing about the robot. With an alarm the posterior first decides how many
    mechanisms act (none of the catalogue, one, or several), then which.

    Parameters
    ----------
    problem
        The linearised problem; its settings hold the losses.
    posterior
        Models with their probabilities.
    alarm
        Test of whether anything is missing.
    """
    ranked = rank_hypotheses(problem, posterior)
    hypotheses = temper_hypotheses(problem, posterior, ranked)
    nothing = next(h for h in hypotheses if not h.mechanisms)
    mechanisms = _compute_inclusion_probabilities(hypotheses)
    families = {term.candidate.family for term in problem.terms if term.candidate}
    tests_robot = bool(families - {_SETUP_FAMILY})
    if not families or not (tests_robot or alarm.raised):
        return Conclusion(NOT_TESTABLE, hypotheses, nothing, {}, mechanisms, None)
    if not alarm.raised:
        return Conclusion(
            ADEQUATE, hypotheses, nothing, {}, mechanisms, nothing.probability
        )
    leaders = _choose_leaders(problem, posterior, ranked)
    conclusion, stated = _choose_verdict(
        hypotheses, leaders, mechanisms, problem.settings
    )
    conclusion = _add_confounded_mechanisms(problem, posterior, conclusion, stated)
    has_alternatives = any(conclusion.alternatives.values())
    if conclusion.verdict == CLASS and not has_alternatives:
        # No competitor is worth a line, but together they are too probable for a name.
        return allow_related_mechanisms(conclusion, conclusion.best.named)
    return conclusion


def _choose_leaders(
    problem: SearchProblem, posterior: Posterior, ranked: Sequence[Hypothesis]
) -> tuple[str, tuple[str, ...] | None]:
    """Choose how many mechanisms act, as a verdict, and the mechanisms that lead.

    Of the hypotheses with the most probable number of mechanisms, the most probable one
    leads by which each mechanism explains something significant, at the level of the
    alarm; None if there is none.
    """
    by_verdict: dict[str, list[Hypothesis]] = {UNEXPLAINED: [], CLASS: [], SEVERAL: []}
    by_count = list(by_verdict)
    for hypothesis in ranked:
        if hypothesis.mechanisms:
            by_verdict[by_count[min(len(hypothesis.named), 2)]].append(hypothesis)
    verdict = max(by_verdict, key=lambda name: _sum_probabilities(by_verdict[name]))
    for hypothesis in by_verdict[verdict]:
        model = posterior.models[hypothesis.model]
        p_values = [
            compute_joint_p_value(problem, model, name) for name in hypothesis.named
        ]
        if max(p_values, default=0.0) <= problem.settings.alarm_level:
            return verdict, hypothesis.mechanisms
    return verdict, None


def _choose_verdict(
    hypotheses: tuple[Hypothesis, ...],
    leaders: tuple[str, tuple[str, ...] | None],
    mechanisms: dict[str, float],
    settings: Settings,
) -> tuple[Conclusion, Sequence[Hypothesis]]:
    """Choose a verdict after an alarm, which has decided that something is missing.

    The evidence as it is chooses the hypothesis that leads, whose model is fitted. How
    certain it is follows from tempered probabilities. Nothing is stated that is less
    probable than "nothing is missing".

    Parameters
    ----------
    hypotheses : tuple of Hypothesis
        With tempered probabilities, the most probable one first.
    leaders : tuple
        Result of `_choose_leaders`.
    mechanisms : dict
        Posterior inclusion probabilities.
    settings : Settings
        The losses.

    Returns
    -------
    Conclusion
        The verdict.
    sequence of Hypothesis
        The hypotheses of which one is right if the verdict is.
    """
    tempered = {hypothesis.mechanisms: hypothesis for hypothesis in hypotheses}
    nothing = tempered[()]
    verdict, leading = leaders
    best = tempered[leading or ()]
    competitors = [entry for entry in hypotheses if entry not in (best, nothing)]
    # A wrong name costs one, a class its ambiguity, because nobody repairs a robot by it.
    state_alone = 1.0 - best.probability < settings.ambiguity_loss
    is_named = state_alone and verdict == CLASS and OTHER not in best.mechanisms
    stated = [best] if is_named else _choose_class([best, *competitors], settings)
    if best is nothing or _sum_probabilities(stated) < nothing.probability:
        stated = []
        best = nothing
    alternatives: dict[str, tuple[str, ...]] = {}
    if verdict == UNEXPLAINED or not stated:
        verdict = UNEXPLAINED
        probability = _sum_unnamed(hypotheses)
        if stated:
            probability -= nothing.probability
    else:
        verdict = NAMED if is_named else verdict
        probability = _sum_probabilities(stated)
        alternatives = {
            name: _find_alternatives(name, best, stated) for name in best.named
        }
    # Rounding may carry the sum of the models beyond one.
    probability = min(probability, 1.0)
    conclusion = Conclusion(
        verdict, hypotheses, best, alternatives, mechanisms, probability
    )
    return conclusion, stated


def _sum_unnamed(hypotheses: Sequence[Hypothesis]) -> float:
    """Sum the probabilities of the hypotheses without a mechanism of the catalogue."""
    return _sum_probabilities([entry for entry in hypotheses if not entry.named])


def _add_confounded_mechanisms(
    problem: SearchProblem,
    posterior: Posterior,
    conclusion: Conclusion,
    stated: Sequence[Hypothesis],
) -> Conclusion:
    """Add to each name the mechanisms that this campaign cannot distinguish from it.

    A verdict that names one mechanism becomes a class with them, and its probability is
    that of the whole class.
    """
    best = conclusion.best
    if not best.named or conclusion.verdict == UNEXPLAINED:
        return conclusion
    model = posterior.models[best.model]
    alternatives = {}
    replaced: set[tuple[str, ...]] = set()
    for name, listed in conclusion.alternatives.items():
        confounded = find_confounded_mechanisms(problem, model, name)
        alternatives[name] = tuple(dict.fromkeys((*listed, *confounded)))
        replaced |= {
            replace_mechanism(best.mechanisms, name, mechanism)
            for mechanism in confounded
        }
    if not replaced:
        return conclusion
    listed_hypotheses = [
        hypothesis
        for hypothesis in conclusion.hypotheses
        if hypothesis in stated or hypothesis.mechanisms in replaced
    ]
    return replace(
        conclusion,
        verdict=CLASS if conclusion.verdict == NAMED else conclusion.verdict,
        alternatives=alternatives,
        probability=min(_sum_probabilities(listed_hypotheses), 1.0),
    )


def replace_mechanism(
    mechanisms: tuple[str, ...], name: str, alternative: str
) -> tuple[str, ...]:
    """Put an alternative in the place of one of the mechanisms of a hypothesis."""
    companions = set(mechanisms) - {name}
    return tuple(sorted(companions | {alternative}))


def _compute_inclusion_probabilities(
    hypotheses: Sequence[Hypothesis],
) -> dict[str, float]:
    """Return the probability of each mechanism, the most probable first."""
    probabilities: dict[str, float] = defaultdict(float)
    for hypothesis in hypotheses:
        for name in hypothesis.mechanisms:
            # Rounding may carry the sum beyond one.
            probabilities[name] = min(probabilities[name] + hypothesis.probability, 1.0)
    return dict(sorted(probabilities.items(), key=lambda entry: -entry[1]))


def _sum_probabilities(hypotheses: Sequence[Hypothesis]) -> float:
    return sum(hypothesis.probability for hypothesis in hypotheses)


def allow_related_mechanisms(
    conclusion: Conclusion, doubted: Collection[str]
) -> Conclusion:
    """Add "a related mechanism" to the alternatives of some mechanisms.

    A verdict that names one mechanism becomes a class.

    Parameters
    ----------
    conclusion : Conclusion
        The verdict so far.
    doubted : collection of str
        Mechanisms whose size is not plausible.
    """
    alternatives = {
        name: tuple(dict.fromkeys((*alternative, OTHER)))
        if name in doubted
        else alternative
        for name, alternative in conclusion.alternatives.items()
    }
    verdict = conclusion.verdict
    if verdict == NAMED and doubted:
        verdict = CLASS
    return replace(conclusion, verdict=verdict, alternatives=alternatives)


def _choose_class(
    ranked: Sequence[Hypothesis], settings: Settings
) -> Sequence[Hypothesis]:
    """Make the Bayes decision between classes and no statement.

    A class costs one if it does not contain the truth, something by itself, and
    something for each further line. No statement costs the loss of a missed effect.

    Parameters
    ----------
    ranked : sequence of Hypothesis
        Without "nothing", the best first.
    settings : Settings
        The losses.

    Returns
    -------
    The class of least loss; empty if the least loss is that of no statement.
    """
    probability = np.array([hypothesis.probability for hypothesis in ranked])
    further_lines = np.arange(len(ranked))
    missed = np.clip(probability.sum() - np.cumsum(probability), 0.0, None)
    class_losses = (
        settings.ambiguity_loss + settings.width_loss * further_lines + missed
    )
    if settings.missed_loss * probability.sum() <= class_losses.min():
        return ()
    return ranked[: int(np.argmin(class_losses)) + 1]


def rank_hypotheses(
    problem: SearchProblem, posterior: Posterior
) -> tuple[Hypothesis, ...]:
    """Sum the probabilities of the models of each set of mechanisms.

    Returns
    -------
    tuple of Hypothesis
        The most probable one first; "nothing" is always among them.
    """
    probabilities: dict[tuple[str, ...], float] = {(): 0.0}
    best_models: dict[tuple[str, ...], int] = {}
    for index, (model, probability) in enumerate(
        zip(posterior.models, posterior.probabilities.tolist(), strict=True)
    ):
        names = tuple(sorted(_find_acting_mechanisms(problem, model, probability)))
        probabilities[names] = probabilities.get(names, 0.0) + probability
        # Models come in falling order of their probability.
        best_models.setdefault(names, index)
    ranked = sorted(probabilities.items(), key=lambda entry: -entry[1])
    return tuple(
        Hypothesis(names, probability, best_models.get(names, -1))
        for names, probability in ranked
    )


def _find_acting_mechanisms(
    problem: SearchProblem, model: ScoredModel, probability: float
) -> set[str]:
    """Return the mechanisms of a model, with `OTHER` for the smooth error.

    Neither the laws nor the smooth error are exactly what the machine does. So one of
    them counts as a part of the other if the displacements that only it can make are
    within the tolerance of laws. If the smooth error is far larger than the mechanisms,
    it is not a related mechanism, and it acts alone.
    """
    names = {problem.terms[index].mechanism for index in model.term_indices}
    catalogue_names = names - {OTHER}
    has_both = bool(catalogue_names) and catalogue_names != names
    if not has_both or probability <= MIN_REPORTED_PROBABILITY:
        return names
    law_tolerance = problem.settings.law_tolerance**2
    smooth_tolerance = problem.settings.smooth_tolerance**2
    of_laws, of_smooth = compute_extra_squares(problem, model, catalogue_names)
    (law_squares, law_extra_squares) = of_laws
    (smooth_squares, smooth_extra_squares) = of_smooth
    if smooth_extra_squares < law_tolerance * law_squares:
        return catalogue_names
    if law_extra_squares < law_tolerance * smooth_squares:
        return {OTHER}
    if law_squares < smooth_tolerance * smooth_squares:
        return {OTHER}
    return names


def list_locations(
    problem: SearchProblem, model: ScoredModel, mechanism: str
) -> list[Location]:
    """Return the locations of a mechanism in a model, in the order of the terms.

    The order of a set would differ from one process to the next.
    """
    terms = [problem.terms[index] for index in model.term_indices]
    return list(
        dict.fromkeys(term.location for term in terms if term.mechanism == mechanism)
    )


def compute_location_probabilities(
    problem: SearchProblem, posterior: Posterior, mechanism: str
) -> dict[Location, float]:
    """Return the probability of each location of a mechanism, given that it acts."""
    total = 0.0
    probabilities: dict[Location, float] = defaultdict(float)
    for probability, model in zip(
        posterior.probabilities.tolist(), posterior.models, strict=True
    ):
        locations = list_locations(problem, model, mechanism)
        if locations:
            total += probability
        for location in locations:
            probabilities[location] += probability
    ranked = sorted(probabilities.items(), key=lambda entry: -entry[1])
    return {location: value / total for location, value in ranked}


def _find_alternatives(
    name: str, best: Hypothesis, stated: Sequence[Hypothesis]
) -> tuple[str, ...]:
    """Return what the other stated hypotheses have in the place of a mechanism."""
    alternatives: dict[str, None] = {}
    for hypothesis in stated:
        if hypothesis == best:
            continue
        # The mechanism itself, and mechanisms that the best hypothesis does not have.
        candidates = [
            mechanism
            for mechanism in hypothesis.mechanisms
            if mechanism == name or mechanism not in best.mechanisms
        ]
        if name not in candidates or {*candidates} == {name, OTHER}:
            alternatives |= dict.fromkeys(candidates)
    if OTHER in best.mechanisms:
        alternatives.setdefault(OTHER)
    alternatives.pop(name, None)
    return tuple(alternatives)


def find_contradictions(final: Fit, measured: Noise, settings: Settings) -> list[str]:
    """Return reasons why a declared model is not adequate although no alarm is raised.

    Noise that is estimated along with the model may hide a misfit, and so may a
    parameter whose value no robot has.

    Parameters
    ----------
    final : Fit
        Fit of the declared model.
    measured : Noise
        Noise of the repeats or of the sensor.
    settings : Settings
        Limits.

    Returns
    -------
    list of str
        One sentence for each reason.
    """
    contradictions = []
    # Declared noise may be a guess; a warning says so if it is far from the residuals.
    if measured.source == "repeats":
        scatter = final.noise.position_m / measured.position_m
        contradictions += warn_of_scatter(scatter, measured, settings.largest_scatter)
    contradictions += warn_of_pose_error(final.noise, settings.largest_pose_error_rad)
    if not final.model.identifies_compliance:
        return contradictions
    multiples = compute_negative_compliances(final)
    for joint in np.flatnonzero(multiples > settings.negative_compliance):
        multiple = multiples[joint]
        contradictions.append(
            f"the compliance of joint {joint + 1} would be negative by "
            f"{multiple:.1f} standard errors"
        )
    return contradictions


def describe_repeatable_residual(repeatable: RepeatableResidual | None) -> list[str]:
    """Return a sentence if a part of the residual is a function of the joints, which no
    verdict covers; otherwise nothing."""
    if repeatable is None or not repeatable.remains:
        return []
    size = f"{1e6 * repeatable.rms_m:.0f} ± {1e6 * repeatable.rms_std_error_m:.0f}"
    return [
        f"a repeatable error of {size} µm RMS remains: it depends on the joint angles, "
        "and no mechanism of the catalogue explains it"
    ]


def warn_of_excess_scatter(
    final: Fit, measured: Noise, scatter: float, level: float
) -> list[str]:
    """Return a warning if the residuals of a model scatter more than the noise explains.

    The noise of repeats, or the stated one, bounds what may count as noise: the mean
    square of the residuals over it has a chi-squared distribution by chance, and an F
    distribution if the noise is estimated from repeats (Snedecor and Cochran 1989).

    Parameters
    ----------
    final : Fit
        Fit of the model that is kept.
    measured : Noise
        Noise of the repeats, or declared noise.
    scatter : float
        Ratio of the noise that the model leaves to that one.
    level : float
        Probability of a warning if the noise is as stated.
    """
    ratio = scatter**2
    freedom = final.residual.size - count_effective_parameters(final)
    if measured.source == "residual" or ratio <= 1.0 or freedom < 1.0:
        return []
    if measured.degrees_of_freedom:
        repeats_freedom = 3.0 * measured.degrees_of_freedom / final.model.rows
        chance = fdtrc(freedom, repeats_freedom, ratio)
    else:
        chance = chdtrc(freedom, freedom * ratio)
    if chance >= level:
        return []
    (sentence,) = warn_of_scatter(scatter, measured, 0.0)
    return [
        f"{sentence}, over {freedom:.0f} numbers; by chance alone this happens in less"
        f" than {100 * level:g} % of campaigns: the excess counts as an error of the model"
    ]


def warn_of_scatter(factor: float, measured: Noise, least: float) -> list[str]:
    """Return a warning if the residuals of a model scatter far more than the noise.

    Parameters
    ----------
    factor : float
        Ratio of the noise that the model leaves to the measured one.
    measured : Noise
        Noise of the repeats, or declared noise.
    least : float
        Ratio from which on there is a warning.
    """
    if factor < least:
        return []
    if measured.source == "repeats":
        reference = "their repeats about each other"
    else:
        reference = "the noise that is declared for them"
    decimals = 0 if factor > 10 else 2 if factor < 1.5 else 1
    return [
        f"measurements scatter about the model {factor:.{decimals}f} times as much as {reference}"
    ]


def warn_of_pose_error(residual_noise: Noise, least_rad: float) -> list[str]:
    """Return a warning if the measurements of a pose share at least such a joint error."""
    if residual_noise.pose_rad < least_rad:
        return []
    return [
        "errors within a pose are correlated, as if each joint were "
        f"{1e6 * residual_noise.pose_rad:.0f} µrad off; repeats of a pose do not show "
        "this error, so new poses will have errors of this size"
    ]
