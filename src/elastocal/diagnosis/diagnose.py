"""Find what the declared model of a campaign lacks, by its training poses alone.

The held-out poses are opened by `judge`, once, at the end.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.counting import format_count
from elastocal.data_checks.faults import find_faults
from elastocal.data_checks.target_distances import compare_target_distances
from elastocal.diagnosis import adoption, model_averaging, refit, verdict
from elastocal.diagnosis.alarm import run_alarm_test
from elastocal.diagnosis.candidate_design import build_candidate_design, refine_shapes
from elastocal.diagnosis.centre_prior import choose_centre_prior
from elastocal.diagnosis.contamination import JudgedRows, find_wrong_rows
from elastocal.diagnosis.effect_estimates import find_oversized_effects
from elastocal.diagnosis.fitted_subset import (
    FittedSubset,
    fit_subset,
    sample_for_search,
    select_initial_subset,
)
from elastocal.diagnosis.grid_ends import warn_of_grid_ends
from elastocal.diagnosis.gross_errors import (
    OutlierTest,
    describe_gross_errors,
    describe_standing_out,
)
from elastocal.diagnosis.search import screen_terms, search_models
from elastocal.diagnosis.training_verdict import TrainingResult, state_training_verdict
from elastocal.diagnosis.verdict import MIN_REPORTED_PROBABILITY, Evidence
from elastocal.effects.catalogue import list_effects
from elastocal.fitting.least_squares import (
    CONVERGENCE_TOLERANCE,
    INTERMEDIATE_TOLERANCE,
    fit_model,
)
from elastocal.fitting.model import (
    Case,
    build_nominal_model,
    get_parameter_values,
)
from elastocal.fitting.noise import serialize_noise
from elastocal.fitting.observations import Observations
from elastocal.io.typed_json import to_document
from elastocal.random_streams import open_stream
from elastocal.residual_model.repeatable import detect_repeatable_residual

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from elastocal.campaigns.campaign import Measurements
    from elastocal.data_checks.protocol import Fault
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.verdict import RepeatableResidual, TrainingVerdict

# Number of mechanisms that are added one at a time, each by a fit of its own. With more
# mechanisms, only the first has a step of its own.
_MAX_STEPS = 4
# Shift of the parameters, in standard errors, below which a new search would find the
# same: it changes a log likelihood by 0.03 a parameter.
_NEGLIGIBLE_SHIFT = 0.25


@dataclass(frozen=True)
class Step:
    """One model on the way from the nominal robot to all effects found, fitted to the
    training poses.

    Attributes
    ----------
    name
        For tables and reports.
    kind
        "frames", "declared", "effect"; or "kept", of a last step whose frames alone
        predict training poses better than the declared model.
    fitted
        Its fit.
    """

    name: str
    kind: str
    fitted: Fit


@dataclass(frozen=True)
class Diagnosis:
    """What the training poses say of a campaign.

    Attributes
    ----------
    case
        Training poses without the gross errors.
    steps
        Models from the frames to the final one.
    evidence
        Result of the search; None if the data are at fault.
    verdict
        The verdict, without what held-out poses add.
    left_out
        Gross errors.
    settings
        Settings of the diagnosis.
    """

    case: Case
    steps: tuple[Step, ...]
    evidence: Evidence | None
    verdict: TrainingVerdict = field(repr=False)
    left_out: Measurements
    settings: Settings = field(repr=False)

    @cached_property
    def document(self) -> dict[str, Any]:
        """The verdict as a JSON document."""
        document: dict[str, Any] = to_document(self.verdict)
        return document

    @property
    def nominal(self) -> Fit:
        """The robot before any calibration: see `build_nominal_model`."""
        return self.steps[0].fitted

    @property
    def declared(self) -> Fit:
        """Fit of the declared model."""
        return next(step.fitted for step in self.steps if step.kind == "declared")

    @property
    def final(self) -> Fit:
        """Fit with all effects that were adopted."""
        return self.steps[-1].fitted


@dataclass(frozen=True)
class _Context:
    """What every stage of a diagnosis needs: the whole case, settings, seed of the
    random streams, and a function that reports progress in a line."""

    case: Case
    settings: Settings
    seed: int
    report: Callable[[str], None]


@dataclass(frozen=True)
class _Visit:
    """A model about which the problem was linearised in a search.

    Attributes
    ----------
    named
        Mechanisms that the model has beyond the declared one; None for the declared
        model.
    noise_m
        Noise by which the problem was whitened.
    probabilities
        Of each set of mechanisms, as the problem states them there.
    """

    named: tuple[str, ...] | None
    noise_m: float
    probabilities: Mapping[tuple[str, ...], float]


@dataclass(frozen=True)
class _SearchRound:
    """Start of one round of a search.

    Attributes
    ----------
    number
        From 0; the first round about a model that a former search found is 1.
    reference
        Fit about which the problem is linearised.
    named
        Mechanisms that this model has beyond the declared one; None for the declared
        model.
    max_pose_error_rad
        Largest error common to the measurements of a pose that is considered.
    tested
        The last fit whose residual was tested for a repeatable part, and the outcome.
    visits
        Models about which this search was linearised before, in order.
    closes_cycle
        Whether the search has returned to a model, and this round leads to the more
        probable one of those between which it alternates.
    """

    number: int
    reference: Fit
    named: tuple[str, ...] | None
    max_pose_error_rad: float = np.inf
    tested: tuple[Fit | None, RepeatableResidual | None] = (None, None)
    visits: tuple[_Visit, ...] = ()
    closes_cycle: bool = False


@dataclass(frozen=True)
class _RowRound:
    """Start of a search with a selection of the rows.

    Attributes
    ----------
    number
        Number of row selections so far.
    subset
        Rows to fit.
    readmitted
        (N,) of bool, rows that stay because a model without them explained them.
    search
        Start of the search.
    """

    number: int
    subset: FittedSubset
    readmitted: np.ndarray
    search: _SearchRound


@dataclass(frozen=True)
class _SettledRows:
    """Rows that no further search would change.

    Attributes
    ----------
    subset
        Rows that are fitted.
    outliers
        Last test of all rows.
    standing_out
        (N,) of bool, rows that are far from the model and stay.
    evidence
        Result of the last search; None if the data are at fault.
    fitted
        The most probable model, fitted to the search sample of the subset.
    """

    subset: FittedSubset
    outliers: OutlierTest
    standing_out: np.ndarray
    evidence: Evidence | None
    fitted: Fit


def diagnose(
    case: Case,
    settings: Settings,
    seed: int,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Find what the declared model of a campaign lacks.

    Parameters
    ----------
    case
        Training poses.
    settings
        Settings of the diagnosis.
    seed
        Seed of the simulated null distribution and of the cross-validation.
    progress
        Called with a line after each stage.
    """
    report = progress or (lambda line: None)
    subset = select_initial_subset(case, settings)
    data_faults = find_faults(subset.case.campaign)
    if data_faults:
        # If the whole data set has a fault, such as a wrong unit or frame, do not look
        # for single bad rows.
        every_row = np.ones(len(case.campaign.measurements), bool)
        subset = fit_subset(case, every_row, settings)
    else:
        subset = choose_centre_prior(subset, settings)
    count = format_count(len(subset.case.observations), "measurement")
    report(f"declared model fitted to {count}")
    context = _Context(replace(case, model=subset.case.model), settings, seed, report)
    outliers = OutlierTest.none(len(subset.kept), case.model.rows)
    rows = _SettledRows(subset, outliers, outliers.gross, None, subset.declared)
    if not data_faults:
        rows = _settle_rows(context, subset)
    result = _choose_model(context, rows, data_faults)
    return Diagnosis(
        result.case,
        result.steps,
        result.evidence,
        state_training_verdict(result, settings),
        case.campaign.measurements.select(~rows.subset.kept),
        settings,
    )


def _settle_rows(context: _Context, subset: FittedSubset) -> _SettledRows:
    """Search for the model, judge all rows by it, and search again without the gross
    errors until they stay the same.

    A round returns where the next one starts, and not its evidence: so the statistics
    of one search are released before the next search allocates its own.
    """
    state: _RowRound | _SettledRows = _RowRound(
        0,
        subset,
        np.zeros(len(subset.kept), bool),
        _SearchRound(0, subset.declared, None),
    )
    while isinstance(state, _RowRound):
        state = _search_and_judge_rows(context, state)
    return state


def _search_and_judge_rows(
    context: _Context, start: _RowRound
) -> _RowRound | _SettledRows:
    """Search for the model with some rows, and judge all rows by it; the start of the
    next search if other rows change the model."""
    case = context.case
    settings = context.settings
    subset = start.subset
    evidence = _search_until_settled(context, subset, start.search)
    fitted = evidence.fitted
    outliers = OutlierTest.none(len(subset.kept), case.model.rows)
    # A row that a model without it explains stays, whatever the next model says of it.
    # Therefore no set of rows comes back.
    readmitted = start.readmitted.copy()
    for number in range(start.number, settings.gross_error_rounds):
        outliers = find_wrong_rows(
            fitted,
            subset.noise,
            case,
            JudgedRows(subset.kept, readmitted, subset.wrong_probability),
            settings,
        )
        readmitted |= _find_readmitted(outliers, subset.kept)
        remaining = ~outliers.gross | readmitted
        is_last = number + 1 == settings.gross_error_rounds
        if is_last or (remaining == subset.kept).all():
            break
        # Refit the current model without the rejected rows, and judge all rows by it,
        # before starting another search.
        sample = sample_for_search(case, case.select(remaining), settings)
        fitted = _refit_from(fitted, sample, fitted.noise, INTERMEDIATE_TOLERANCE)
        outliers = find_wrong_rows(
            fitted,
            subset.noise,
            case,
            JudgedRows(remaining, readmitted, outliers.probability),
            settings,
        )
        readmitted |= _find_readmitted(outliers, remaining)
        previous = subset
        subset = fit_subset(case, ~outliers.gross | readmitted, settings, previous)
        if subset is previous:
            break
        subset = replace(subset, wrong_probability=outliers.probability)
        context.report(
            f"{format_count((~subset.kept).sum(), 'gross error')} in"
            f" {format_count(len(readmitted), 'row')}: once more without"
        )
        refitted = fitted
        has_same_noise = serialize_noise(subset.noise) == serialize_noise(
            previous.noise
        )
        if has_same_noise and (subset.kept != remaining).any():
            refitted = _refit_from(
                fitted, subset.search_sample, fitted.noise, INTERMEDIATE_TOLERANCE
            )
        if not has_same_noise or not _is_shift_negligible(evidence.fitted, refitted):
            search = _restart_search(subset, evidence, fitted)
            return _RowRound(number + 1, subset, readmitted, search)
        fitted = refitted
    return _SettledRows(
        subset, outliers, outliers.distant & subset.kept, evidence, fitted
    )


def _find_readmitted(outliers: OutlierTest, kept: np.ndarray) -> np.ndarray:
    """Rows, (N,) of bool, that are not wrong after all: some that were left out, and
    some that are far from the model, for which an effect is more probable than
    accidents."""
    return ~outliers.gross & (~kept | outliers.distant)


def _is_shift_negligible(searched: Fit, refitted: Fit) -> bool:
    """Whether the rows that changed have so little weight that a new search would find
    the same."""
    shift = np.subtract(
        get_parameter_values(refitted.model, refitted.estimate),
        get_parameter_values(searched.model, searched.estimate),
    )
    std_error = np.sqrt(np.diag(searched.covariance))
    return bool((np.abs(shift) <= _NEGLIGIBLE_SHIFT * std_error).all())


def _restart_search(
    subset: FittedSubset, evidence: Evidence, fitted: Fit
) -> _SearchRound:
    """Start the next search at the model found so far if the last one was linearised
    about a model that it had found; starting at the declared model would repeat the
    same steps."""
    design = evidence.design
    declared_effects = subset.declared.model.effects
    if len(design.reference_fit.model.effects) <= len(declared_effects):
        return _SearchRound(0, subset.declared, None, design.max_pose_error_rad)
    reference = _refit_from(
        fitted, subset.search_sample, fitted.noise, INTERMEDIATE_TOLERANCE
    )
    named = evidence.conclusion.best.named
    return _SearchRound(1, reference, named, design.max_pose_error_rad)


def _refit_from(
    fitted: Fit, observations: Observations, noise: Noise, tolerance: float
) -> Fit:
    """Fit the model of a fit to other observations, or with other noise, from its
    estimate on."""
    return fit_model(
        fitted.model,
        observations,
        noise,
        fitted.estimate,
        reweight_first_step=True,
        tolerance=tolerance,
    )


def _search_until_settled(
    context: _Context, subset: FittedSubset, start: _SearchRound
) -> Evidence:
    """Search about one model, and again about the model found while that, or its noise,
    is far from the one before.

    As in `_settle_rows`, a round releases its statistics before the next one starts.
    """
    state: _SearchRound | Evidence = start
    while isinstance(state, _SearchRound):
        state = _run_search_round(context, subset, state)
    return state


def _run_search_round(
    context: _Context, subset: FittedSubset, start: _SearchRound
) -> _SearchRound | Evidence:
    """Linearise about a model, search, and fit the model found; the evidence if the
    search has settled or has had its rounds, and the start of the next round if not.

    An error common to the measurements of a pose that is larger than robots repeat to
    must be random. If the residual is a function of the joints, no larger pose error
    than that is considered from then on, and the search goes on.

    A search that returns to a model would alternate for ever, so it settles on the more
    probable of the models between which it alternates.
    """
    settings = context.settings
    evidence = _search(context, subset, start)
    fitted = evidence.fitted
    named = evidence.conclusion.best.named
    is_linear = _is_linear(start, evidence, settings)
    # A residual that depends on the joint angles is not random pose error. Test for it
    # again whenever the model has changed.
    pose_error_rad = evidence.named_model.pose_error_rad
    has_large_pose_error = pose_error_rad > settings.pose_repeatability_rad
    tested = start.tested
    remains = False
    if has_large_pose_error or (is_linear and named not in (start.named, ())):
        repeatable = detect_repeatable_residual(
            fitted, subset.search_sample, context.seed
        )
        tested = (fitted, repeatable)
        remains = repeatable is not None and repeatable.remains
    max_pose_error_rad = start.max_pose_error_rad
    if remains:
        max_pose_error_rad = settings.pose_repeatability_rad
        if has_large_pose_error:
            fitted = _limit_pose_error(fitted, subset, max_pose_error_rad)
    following = _SearchRound(
        start.number + 1,
        fitted,
        named,
        max_pose_error_rad,
        tested,
        _list_visits(start, evidence, max_pose_error_rad),
    )
    preferred = _choose_from_cycle(following, settings)
    closes_cycle = start.closes_cycle or preferred == named
    settled = (is_linear and not remains) or closes_cycle
    if settled or following.number >= settings.linearizations:
        return replace(
            evidence,
            expected_to_help=_is_expected_to_help(evidence),
            settled=settled,
            fitted=fitted,
            tested=tested,
        )
    return replace(following, closes_cycle=preferred is not None)


def _limit_pose_error(fitted: Fit, subset: FittedSubset, limit_rad: float) -> Fit:
    """Fit again with a pose error of no more than a limit."""
    noise = refit.limit_pose_error(fitted, subset.search_sample, limit_rad)
    return _refit_from(fitted, subset.search_sample, noise, subset.search_tolerance)


def _is_expected_to_help(evidence: Evidence) -> bool:
    """Whether the effects found are expected to make predictions better."""
    return bool(evidence.conclusion.best.named) and model_averaging.is_expected_to_help(
        evidence.design.problem, evidence.posterior, evidence.named_model
    )


def _list_visits(
    start: _SearchRound, evidence: Evidence, max_pose_error_rad: float
) -> tuple[_Visit, ...]:
    """List the models about which a search was linearised, with the present one; none
    if the next problem has another limit of the pose error, since no model returns to
    it."""
    if max_pose_error_rad != start.max_pose_error_rad:
        return ()
    probabilities: dict[tuple[str, ...], float] = defaultdict(float)
    for hypothesis in evidence.conclusion.hypotheses:
        probabilities[hypothesis.named] += hypothesis.probability
    noise_m = start.reference.noise.position_m
    return (*start.visits, _Visit(start.named, noise_m, probabilities))


def _choose_from_cycle(
    following: _SearchRound, settings: Settings
) -> tuple[str, ...] | None:
    """Choose the most probable one of the models between which a search alternates.

    Each problem prefers another of them, because it is exact at another one. Their log
    probabilities are therefore averaged over the problems: the geometric mean of
    posteriors that approximate the same one about different points.

    Parameters
    ----------
    following
        The next round, which would start at the model found.
    settings
        Settings of the diagnosis.

    Returns
    -------
    tuple of str or None
        Mechanisms of the model; None if the search has not returned to a model, under
        about the same noise.
    """
    noise_m = following.reference.noise.position_m
    largest_ratio = np.log(settings.relinearize_noise)
    for number, visit in enumerate(following.visits[:-1]):
        has_same_noise = abs(np.log(noise_m / visit.noise_m)) <= largest_ratio
        if visit.named == following.named and has_same_noise:
            cycle = following.visits[number:]
            members = [member.named for member in cycle if member.named is not None]
            return max(members, key=lambda named: _sum_log_probabilities(named, cycle))
    return None


def _sum_log_probabilities(named: tuple[str, ...], cycle: Sequence[_Visit]) -> float:
    """Sum the log probabilities of a set of mechanisms by several problems. A set that
    a problem does not list is there at most as probable as the least that are."""
    probabilities = [
        max(visit.probabilities.get(named, 0.0), MIN_REPORTED_PROBABILITY)
        for visit in cycle
    ]
    return float(np.log(probabilities).sum())


def _is_linear(start: _SearchRound, evidence: Evidence, settings: Settings) -> bool:
    """Whether the problem was linear enough at the point of linearisation.

    The noise must not be far above the one by which the problem was whitened, because
    plausible sizes are in units of that noise. Then it is enough that little or nothing
    is missing, that the same effects were named before, or that the exact fit keeps
    what the linear problem promised. Laws that are not linear in the torque are compared
    about a model that has the leading one, because its fit moves masses and springs.
    """
    largest_m = settings.relinearize_noise * start.reference.noise.position_m
    named = evidence.conclusion.best.named
    if evidence.fitted.noise.position_m > largest_m:
        return False
    if named in ((), start.named):
        return True
    if _depends_on_torque(evidence):
        return False
    if evidence.alarm.statistic < settings.relinearize_above:
        return True
    misfit = abs(refit.compute_reduced_chi_square(evidence.fitted) - 1.0)
    return misfit < settings.linear_misfit


def _depends_on_torque(evidence: Evidence) -> bool:
    """Whether one of the two most probable sets of mechanisms has a law that is not
    linear in the load."""
    term_indices: set[int] = set()
    # The most probable hypotheses come first.
    for hypothesis in evidence.conclusion.hypotheses[:2]:
        if hypothesis.mechanisms:
            model = evidence.posterior.models[hypothesis.model]
            term_indices.update(model.term_indices)
    terms = evidence.design.problem.terms
    candidates = [terms[index].candidate for index in term_indices]
    return any(
        candidate is not None and candidate.nonlinear_in_load
        for candidate in candidates
    )


def _search(context: _Context, subset: FittedSubset, start: _SearchRound) -> Evidence:
    """Linearise about a model, test whether anything is missing, search, and fit the
    model found under the noise that it leaves."""
    settings = context.settings
    design = build_candidate_design(
        start.reference,
        subset.search_sample,
        list(subset.case.candidates.values()),
        settings,
        start.max_pose_error_rad,
    )
    empty_model, log_bayes_factors = screen_terms(design.problem)
    stream = open_stream(
        context.seed, subset.case.campaign.name, "null distribution", start.number
    )
    alarm = run_alarm_test(
        design.problem, design.products, empty_model.pose_error_rad, stream
    )
    # The alarm comes before the measurements choose the shapes that are refined; after
    # that choice it would no longer be exact.
    if alarm.raised:
        design = refine_shapes(design, log_bayes_factors)
    reference_keys = {effect.key for effect in start.reference.model.effects}
    posterior = search_models(design.problem, reference_keys)
    # Release the rows before the fit allocates its own.
    design = design.without_rows
    conclusion = verdict.conclude(design.problem, posterior, alarm)
    evidence = Evidence(design, posterior, alarm, conclusion, start.reference)
    _report_leading(context, start.number, conclusion.best.mechanisms)
    noise = refit.estimate_residual_noise(
        design.problem,
        evidence.named_model,
        start.reference.noise,
        subset.declared.noise,
    )
    declared = subset.declared
    if any(
        design.problem.terms[index].at_declared_masses
        for index in evidence.named_model.term_indices
    ):
        declared = refit.reset_declared_masses(declared)
    fitted = refit.fit_selected_effects(
        declared,
        subset.search_sample,
        noise,
        refit.select_effects(design, evidence.named_model),
        start.reference if start.named else None,
        tolerance=subset.search_tolerance,
    )
    return replace(evidence, fitted=fitted)


def _report_leading(
    context: _Context, number: int, mechanisms: tuple[str, ...]
) -> None:
    """Report the mechanisms that lead so far. This is no verdict yet: a later search,
    or the poses left out, may say otherwise."""
    names = [
        getattr(list_effects().get(mechanism), "words", "an unknown mechanism")
        for mechanism in mechanisms
    ]
    leading = " with ".join(names) or "nothing is missing"
    limit = context.settings.linearizations
    context.report(f"search {number + 1} of at most {limit}: leading so far, {leading}")


def _choose_model(
    context: _Context, rows: _SettledRows, data_faults: Sequence[Fault]
) -> TrainingResult:
    """Fit the frames, the declared model and the effects found, and choose the model
    that is kept."""
    subset = rows.subset
    declared = subset.fit_to_all(subset.declared)
    frames = fit_model(
        build_nominal_model(subset.case.model),
        subset.case.observations,
        subset.noise,
        tolerance=INTERMEDIATE_TOLERANCE,
    )
    outliers = replace(rows.outliers, gross=~subset.kept)
    gross_errors = describe_gross_errors(
        outliers, context.case.campaign, held_out=False
    )
    result = TrainingResult(
        case=subset.case,
        noise=subset.noise,
        steps=(
            Step("frames and targets", "frames", frames),
            Step("declared model", "declared", declared),
        ),
        full_model=declared,
        evidence=None,
        faults=data_faults,
        warnings=(
            *compare_target_distances(context.case.campaign),
            *subset.warnings,
        ),
        contradictions=(),
        repeatable=None,
        gross_errors=tuple(gross_errors),
    )
    if rows.evidence is None:
        return result
    return _add_effects(context, rows, rows.evidence, result)


def _add_effects(
    context: _Context, rows: _SettledRows, evidence: Evidence, result: TrainingResult
) -> TrainingResult:
    """Keep the effects found, the declared model, or frames and targets alone,
    whichever predicts best."""
    subset = rows.subset
    observations = subset.case.observations
    frames, declared = (step.fitted for step in result.steps)
    full_model = rows.fitted
    if full_model is not evidence.fitted or subset.search_sample is not observations:
        full_model = subset.fit_to_all(full_model)
    conclusion = verdict.allow_related_mechanisms(
        evidence.conclusion,
        find_oversized_effects(full_model, evidence.conclusion.best.named),
    )
    models = (declared, full_model)
    refusal, kept_in_sample = _refuse_adoption(
        rows, evidence, full_model, context.settings
    )
    evidence = replace(
        evidence,
        conclusion=conclusion,
        adopted=evidence.expected_to_help and not refusal,
    )
    if subset.search_sample is not observations:
        kept_in_sample = None
    compared = _list_compared(
        evidence, models, observations, kept_in_sample, context.settings
    )
    losses = adoption.describe_losses(frames, compared, observations, context.settings)
    evidence = replace(evidence, adopted=evidence.adopted and not losses)
    steps = [result.steps[0], Step("declared model", "declared", compared[0])]
    if evidence.adopted:
        steps += _effect_steps(subset, full_model, evidence)
    elif losses and losses[0]:
        kept = fit_model(frames.model, observations, compared[0].noise, frames.estimate)
        steps.append(Step("frames and targets, kept", "kept", kept))
    result = replace(
        result,
        steps=tuple(steps),
        full_model=full_model,
        warnings=(*result.warnings, *refusal, *filter(None, losses)),
        repeatable=_test_residual(context, evidence, steps[-1].fitted, observations),
    )
    return _contradict(context, result, evidence, rows.standing_out)


def _test_residual(
    context: _Context, evidence: Evidence, kept: Fit, observations: Observations
) -> RepeatableResidual | None:
    """Test the residual of the model that is kept, unless the search has tested it."""
    tested_fit, repeatable = evidence.tested
    if tested_fit is kept:
        return repeatable
    return detect_repeatable_residual(kept, observations, context.seed)


def _list_compared(
    evidence: Evidence,
    models: tuple[Fit, Fit],
    observations: Observations,
    kept: Fit | None,
    settings: Settings,
) -> list[Fit]:
    """List the models to compare with frames alone: the declared one, and the one with
    the effects found if these are adopted.

    `models`: without and with the effects. `kept`: result of `_fit_kept` for the same
    observations, if it is known.
    """
    declared, full_model = models
    if evidence.adopted:
        return [declared, full_model]
    if evidence.conclusion.verdict in (verdict.ADEQUATE, verdict.NOT_TESTABLE):
        return [full_model]
    return [kept or _fit_kept(evidence, declared, observations, settings)]


def _refuse_adoption(
    rows: _SettledRows,
    evidence: Evidence,
    full_model: Fit,
    settings: Settings,
) -> tuple[list[str], Fit | None]:
    """Say why the effects found do not enter the model; nothing if they do, or if there
    are none. The fit to the search sample with which they are compared comes second.

    `full_model`: with the effects, fitted to all observations.
    """
    if not evidence.conclusion.best.named:
        return [], None
    if not evidence.expected_to_help:
        return [adoption.TOO_UNCERTAIN], None
    subset = rows.subset
    sample = subset.search_sample
    if sample is not subset.case.observations:
        full_model = rows.fitted
    kept = _fit_kept(evidence, subset.declared, sample, settings)
    predicted = model_averaging.predict_gain(
        evidence.design.problem, evidence.posterior, evidence.named_model
    )
    refusal = adoption.describe_missing_gain(
        (kept, full_model), sample, predicted, settings
    )
    return refusal, kept


def _fit_kept(
    evidence: Evidence,
    declared: Fit,
    observations: Observations,
    settings: Settings,
) -> Fit:
    """Fit the declared model that is kept because no effect is adopted, under the noise
    that it leaves: shared out between sensor, joints and poses, or all of it from the
    sensor.

    `declared`: fitted to the observations.
    """
    shared_out = refit.estimate_residual_noise(
        evidence.design.problem,
        evidence.posterior.empty_model,
        evidence.design.reference_fit.noise,
        declared.noise,
    )
    fits = [
        _refit_from(declared, observations, noise, CONVERGENCE_TOLERANCE)
        for noise in (shared_out, refit.estimate_sensor_noise(declared, observations))
    ]
    return adoption.choose_kept_fit(fits, observations, settings)


def _contradict(
    context: _Context,
    result: TrainingResult,
    evidence: Evidence,
    rows_standing_out: np.ndarray,
) -> TrainingResult:
    """Withdraw a verdict of adequacy if something contradicts it, and warn.

    `rows_standing_out`: (N,) of bool, rows that are far from the model and stay.
    """
    settings = context.settings
    standing_out = describe_standing_out(rows_standing_out, context.case.campaign)
    repeatable_warnings = verdict.describe_repeatable_residual(result.repeatable)
    conclusion = evidence.conclusion
    contradictions: list[str] = []
    if conclusion.verdict in (verdict.ADEQUATE, verdict.NOT_TESTABLE):
        contradictions = [*repeatable_warnings, *standing_out]
    if conclusion.verdict == verdict.ADEQUATE and not contradictions:
        contradictions = verdict.find_contradictions(
            result.full_model, result.noise, settings
        )
    if contradictions:
        conclusion = replace(conclusion, verdict=verdict.UNEXPLAINED)
    warnings = [*contradictions, *result.warnings]
    warnings += [sentence for sentence in standing_out if sentence not in warnings]
    if not repeatable_warnings:
        warnings += verdict.warn_of_pose_error(
            result.steps[-1].fitted.noise, evidence.design.pose_std_error_rad
        )
    warnings += warn_of_grid_ends(result.full_model, evidence)
    return replace(
        result,
        evidence=replace(evidence, conclusion=conclusion),
        warnings=tuple(warnings),
        contradictions=tuple(contradictions),
    )


def _effect_steps(subset: FittedSubset, final: Fit, evidence: Evidence) -> list[Step]:
    """Add the mechanisms one at a time, the one that explains most first; of many, add
    only the first alone, and the others together.

    All steps but the last are fits to the search sample, because only their errors are
    shown.
    """
    model = evidence.named_model
    effects = [
        (effect, final.effect_values(effect.key)[1])
        for effect, _ in refit.select_effects(evidence.design, model)
    ]
    explained = model_averaging.compute_explained_squares(
        evidence.design.problem, model
    )
    names = sorted(evidence.conclusion.best.named, key=lambda name: -explained[name])
    single = names[:-1] if len(names) <= _MAX_STEPS else names[:1]
    together = names[len(single) :]
    last = together[0] if len(together) == 1 else f"{len(together)} further effects"
    steps = [Step(f"with {last}", "effect", final)]
    for count in range(len(single), 0, -1):
        included = tuple(
            entry for entry in effects if entry[0].effect in single[:count]
        )
        # Intermediate models need no tight convergence: a tenth of a standard error
        # does not change the errors that are shown.
        fitted = refit.fit_selected_effects(
            subset.declared,
            subset.search_sample,
            final.noise,
            included,
            steps[0].fitted,
            tolerance=INTERMEDIATE_TOLERANCE,
        )
        steps.insert(0, Step(f"with {single[count - 1]}", "effect", fitted))
    return steps
