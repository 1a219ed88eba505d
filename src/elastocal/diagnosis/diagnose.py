"""The two calls: `diagnose` looks at training poses alone, `judge` opens the held-out
ones, once, at the end."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.counting import format_count
from elastocal.data_checks.faults import faults
from elastocal.diagnosis import model_averaging, refit, verdict
from elastocal.diagnosis.alarm import run_alarm_test
from elastocal.diagnosis.candidate_design import build_candidate_design, refine_shapes
from elastocal.diagnosis.centre_prior import choose_centre_prior
from elastocal.diagnosis.effect_estimates import find_oversized_effects
from elastocal.diagnosis.fitted_subset import (
    FittedSubset,
    fit_subset,
    sample_for_search,
    select_initial_subset,
)
from elastocal.diagnosis.gross_errors import (
    OutlierTest,
    describe_gross_errors,
    find_gross_errors,
)
from elastocal.diagnosis.search import screen_terms, search_models
from elastocal.diagnosis.training_verdict import TrainingResult, state_training_verdict
from elastocal.diagnosis.verdict import Evidence
from elastocal.effects.catalogue import list_effects
from elastocal.fitting.least_squares import (
    CONVERGENCE_TOLERANCE,
    INTERMEDIATE_TOLERANCE,
    fit_model,
)
from elastocal.fitting.model import Case, get_parameter_values
from elastocal.fitting.noise import count_effective_parameters, serialize_noise
from elastocal.fitting.observations import Observations
from elastocal.io.typed_json import to_document
from elastocal.random_streams import open_stream
from elastocal.remainder.repeatable import repeatable_part
from elastocal.validation.held_out import predict_left_out_squares

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from elastocal.campaigns.campaign import Measurements
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.verdict import RepeatableResidual, TrainingVerdict

# Mechanisms that are added one at a time, each by a fit; of more, only the first.
_MOST_STEPS = 4
# Standard errors by which parameters move where nothing else is found: they change a
# log likelihood by 0.03 each.
_HARDLY = 0.25


@dataclass(frozen=True)
class Step:
    """One model on the way from the nominal robot to all effects found, fitted to the
    training poses.

    `kind`: of the last, "kept" where frames alone predict training poses better than
    what was fitted.
    """

    name: str
    kind: str
    fitted: Fit


@dataclass(frozen=True)
class Diagnosis:
    """What training poses say of a campaign.

    `steps`: the last is the final model. `verdict`: the part of the verdict that the
    training poses decide. `left_out`: gross errors, which are no part of the case.
    """

    case: Case
    steps: tuple[Step, ...]
    evidence: Evidence | None
    verdict: TrainingVerdict = field(repr=False)
    left_out: Measurements

    @cached_property
    def document(self) -> dict[str, Any]:
        """The verdict as a JSON document."""
        document: dict[str, Any] = to_document(self.verdict)
        return document

    @property
    def declared(self) -> Fit:
        """Fit of the declared model."""
        return next(step.fitted for step in self.steps if step.kind == "declared")

    @property
    def final(self) -> Fit:
        """Fit with all effects that were adopted."""
        return self.steps[-1].fitted


def diagnose(
    case: Case,
    settings: Settings,
    seed: int,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Find what the declared model of a campaign lacks.

    `case`: of training poses. `seed`: of the simulated null distribution. `progress`:
    gets a line after each stage.
    """
    whole = case.campaign
    tell = progress or (lambda line: None)
    part = select_initial_subset(case, settings)
    known = faults(part.case.campaign)
    if known:
        # Where all measurements mean something else, no single row is wrong.
        part = fit_subset(
            case, np.ones(len(case.campaign.measurements), bool), settings
        )
    else:
        part = choose_centre_prior(part, settings)
        case = replace(case, model=part.case.model)
    tell(
        f"declared model fitted to {format_count(len(part.case.observations), 'measurement')}"
    )
    found: Evidence | None = None
    about = part.declared
    start = None
    most_pose_error_rad = np.inf
    measurements = case.campaign.measurements
    errors = OutlierTest.none(len(part.kept), case.model.rows)
    good = np.zeros(len(part.kept), bool)
    for number in range(0 if known else settings.gross_error_rounds):
        if not found:
            found = _explained(part, settings, seed, tell, start, most_pose_error_rad)
            about = found.fitted
        errors = find_gross_errors(about, part.noise, measurements, part.kept, settings)
        # A row that a model without it explains stays, whatever the next model says of
        # it: no set of rows comes back.
        good |= ~part.kept & ~errors.gross
        remaining = ~errors.gross | good
        if (remaining == part.kept).all() or number + 1 == settings.gross_error_rounds:
            break
        # The model found looks at all rows once more, without these, before another
        # search is made.
        some = sample_for_search(case, case.select(remaining), settings)
        about = fit_model(
            about.model,
            some,
            about.noise,
            about.estimate,
            reweight_first_step=True,
            tolerance=INTERMEDIATE_TOLERANCE,
        )
        errors = find_gross_errors(about, part.noise, measurements, remaining, settings)
        good |= ~remaining & ~errors.gross
        last = part
        part = fit_subset(case, ~errors.gross | good, settings, part)
        if part is last:
            break
        tell(
            f"{format_count((~part.kept).sum(), 'gross error')} in {format_count(len(good), 'row')}: once more without"
        )
        if serialize_noise(part.noise) == serialize_noise(last.noise):
            again = about
            if (part.kept != remaining).any():
                again = fit_model(
                    about.model,
                    part.search_sample,
                    about.noise,
                    about.estimate,
                    reweight_first_step=True,
                    tolerance=INTERMEDIATE_TOLERANCE,
                )
            moved = np.subtract(
                *(
                    get_parameter_values(each.model, each.estimate)
                    for each in (again, found.fitted)
                )
            )
            if (
                np.abs(moved) <= _HARDLY * np.sqrt(np.diag(found.fitted.covariance))
            ).all():
                # Rows of so little weight that the search would find the same.
                about = again
                continue
        # What was linearised about a model found is so again: from the declared one the
        # way is the same and twice as long.
        relinearized = len(found.linearized.reference_fit.model.effects) > len(
            part.declared.model.effects
        )
        start = (about, found.conclusion.best.named) if relinearized else None
        most_pose_error_rad = found.linearized.max_pose_error_rad
        # Its statistics make room for those of the next search.
        found = None
    errors = replace(errors, gross=~part.kept)
    case = part.case
    noise = part.noise
    declared = part.fit_to_all(part.declared)
    bare = fit_model(
        replace(case.model, effects=()),
        case.observations,
        noise,
        tolerance=INTERMEDIATE_TOLERANCE,
    )
    steps = [
        Step("frames and targets", "frames", bare),
        Step("declared model", "declared", declared),
    ]
    final = declared
    lost = list[str]()
    contradicting = list[str]()
    repeatable = None
    warnings = [*part.warnings]
    if found:
        final = about
        if about is not found.fitted or part.search_sample is not case.observations:
            final = part.fit_to_all(about)
        named = found.conclusion.best.named
        word = found.conclusion.verdict
        found = replace(
            found,
            conclusion=verdict.allow_related_mechanisms(
                found.conclusion, find_oversized_effects(final, named)
            ),
        )
        if not found.adopted:
            # Under the noise that it leaves itself, for nothing else enters the model
            # that is kept.
            line = found.linearized
            left = refit.estimate_residual_noise(
                line.problem,
                found.posterior.empty_model,
                line.reference_fit.noise,
                declared.noise,
            )
            alone = (
                fit_model(
                    declared.model,
                    case.observations,
                    left,
                    declared.estimate,
                    reweight_first_step=True,
                )
                if named
                else final
            )
            steps[-1] = replace(steps[-1], fitted=alone)
        lost = _losses(
            bare,
            [steps[-1].fitted, *([final] if found.adopted else [])],
            case.observations,
            settings,
        )
        found = replace(found, adopted=found.adopted and not lost)
        if found.adopted:
            steps += _effect_steps(part, final, found)
        elif lost and lost[0]:
            kept = fit_model(
                bare.model, case.observations, steps[-1].fitted.noise, bare.estimate
            )
            steps.append(Step("frames and targets, kept", "kept", kept))
        kept, (asked, repeatable) = steps[-1].fitted, found.tested or (None, None)
        if asked is not kept:
            repeatable = repeatable_part(kept, case.observations, seed)
        unnamed = verdict.describe_repeatable_residual(repeatable)
        if word in (verdict.ADEQUATE, verdict.NOT_TESTABLE):
            contradicting = unnamed or (
                verdict.find_contradictions(final, noise, settings)
                if word == verdict.ADEQUATE
                else []
            )
        if contradicting:
            found = replace(
                found, conclusion=replace(found.conclusion, verdict=verdict.UNEXPLAINED)
            )
        warnings = [*contradicting, *warnings, *filter(None, lost)]
        warnings += (
            []
            if unnamed
            else verdict.warn_of_pose_error(
                kept.noise, found.linearized.pose_std_error_rad
            )
        )
    stated = state_training_verdict(
        TrainingResult(
            case=case,
            noise=noise,
            steps=tuple(steps),
            full_model=final,
            evidence=found,
            faults=known,
            warnings=tuple(warnings),
            contradictions=tuple(contradicting),
            repeatable=repeatable,
            gross_errors=tuple(describe_gross_errors(errors, whole, held_out=False)),
        ),
        settings,
    )
    return Diagnosis(
        case, tuple(steps), found, stated, whole.measurements.select(errors.gross)
    )


def _losses(
    bare: Fit, models: Sequence[Fit], observations: Observations, settings: Settings
) -> list[str]:
    """A sentence for each model that predicts left-out training poses worse than frames
    alone, empty for one that does not.

    Of the declared model and, if it is given, that with effects; nothing where the last
    holds.
    """
    found = []
    for fitted, name in zip(
        models, ("declared model", "model with the effects found"), strict=False
    ):
        effective = count_effective_parameters(fitted)
        words = ""
        if fitted.residual.size < settings.numbers_a_parameter * effective:
            mine, others = (
                predict_left_out_squares(each, observations) for each in (fitted, bare)
            )
            off = mine - others
            if off.mean() > off.std(ddof=1) / np.sqrt(len(off)):
                rms = [
                    f"{1e3 * np.sqrt(each.mean()):.2f} mm" for each in (mine, others)
                ]
                words = (
                    f"training poses left out in turn are off by {rms[0]} RMS by the {name}, by {rms[1]} with frames and"
                    f" targets alone: {len(mine)} poses are too few for {effective:.0f} parameters, and the {name} is not kept"
                )
        found.append(words)
    return found if found[-1] else []


def _explained(
    part: FittedSubset,
    settings: Settings,
    seed: int,
    tell: Callable[[str], None],
    start: tuple[Fit, tuple[str, ...]] | None,
    most_pose_error_rad: float,
) -> Evidence:
    """Evidence about the declared model, and again about the model found where that, or
    its noise, is far from it.

    At once about a model, with the mechanisms that it has beyond the declared one,
    where the search is to ``start``. What an error common to the measurements of a pose
    takes beyond what robots repeat to must be chance: where it is a function of the
    joints no more of it is thought of. And where what is left is one, the search goes
    on about each model that is new.
    """
    candidates = list(part.case.candidates.values())
    searched = part.search_sample
    declared = part.declared
    about, before = start or (declared, None)
    tested: tuple[Fit, RepeatableResidual | None] | None = None
    # The fit to all measurements starts where that to some ends.
    enough = (
        CONVERGENCE_TOLERANCE
        if searched is part.case.observations
        else INTERMEDIATE_TOLERANCE
    )
    if start:
        about = fit_model(
            about.model,
            searched,
            about.noise,
            about.estimate,
            reweight_first_step=True,
            tolerance=INTERMEDIATE_TOLERANCE,
        )
    for round_number in range(1 if start else 0, settings.linearizations):
        problem = build_candidate_design(
            about, searched, candidates, settings, most_pose_error_rad
        )
        near = about if before else None
        nothing, alone = screen_terms(problem.problem)
        draws = open_stream(
            seed, part.case.campaign.name, "null distribution", round_number
        )
        alarm = run_alarm_test(
            problem.problem, problem.products, nothing.pose_error_rad, draws
        )
        # The alarm comes before the measurements choose at which shapes to look more
        # closely: it would no longer be exact.
        if alarm.raised:
            problem = refine_shapes(problem, alone)
        found = search_models(
            problem.problem, {effect.key for effect in about.model.effects}
        )
        conclusion = verdict.conclude(problem.problem, found, alarm)
        # Rows of a long campaign make room for the fit, and for those of the next
        # linearisation.
        problem = problem.without_rows
        named = conclusion.best.named
        taken = about.noise
        model = found.models[conclusion.best.model] if named else found.empty_model
        # No verdict yet, and no probability: a later search, or the poses left out, may
        # say otherwise.
        words = [
            getattr(list_effects().get(name), "words", "an unknown mechanism")
            for name in conclusion.best.mechanisms
        ]
        leading = " with ".join(words) or "nothing is missing"
        tell(
            f"search {round_number + 1} of at most {settings.linearizations}: leading so far, {leading}"
        )
        noise = refit.estimate_residual_noise(
            problem.problem, model, taken, declared.noise
        )
        about = refit.fit_selected_effects(
            declared,
            searched,
            noise,
            refit.select_effects(problem, model),
            near,
            tolerance=enough,
        )
        off = noise.position_m > settings.relinearize_noise * taken.position_m
        small = not named or alarm.statistic < settings.relinearize_above
        ends = not off and (
            small
            or named == before
            or abs(refit.compute_reduced_chi_square(about) - 1.0)
            < settings.linear_misfit
        )
        # What is a function of the joints is no error of poses, and about a model that
        # is new the problem is another one.
        large = model.pose_error_rad > settings.pose_repeatability_rad
        left = None
        if large or (ends and named not in (before, ())):
            left = repeatable_part(about, searched, seed)
            tested = about, left
        remains = left is not None and left.remains
        settled = ends and not remains
        adopted = bool(named) and model_averaging.is_expected_to_help(
            problem.problem, found, model
        )
        evidence = Evidence(
            problem, found, alarm, conclusion, adopted, settled, about, tested
        )
        if settled:
            break
        if remains:
            most_pose_error_rad = settings.pose_repeatability_rad
            if large:
                noise = refit.limit_pose_error(about, searched, most_pose_error_rad)
                about = fit_model(
                    about.model,
                    searched,
                    noise,
                    about.estimate,
                    reweight_first_step=True,
                    tolerance=enough,
                )
        before = named
        if round_number + 1 < settings.linearizations:
            # The next problem takes the room of this one.
            del problem, found, conclusion, evidence
    return replace(evidence, fitted=about)


def _effect_steps(part: FittedSubset, final: Fit, found: Evidence) -> list[Step]:
    """One step for each mechanism, that which explains most first, each with those
    before it; of many, the rest together.

    All but the last come from what a search looks at: only their errors are shown.
    """
    model = found.posterior.models[found.conclusion.best.model]
    chosen = [
        (effect, final.effect_values(effect.key)[1])
        for effect, _ in refit.select_effects(found.linearized, model)
    ]
    explained = model_averaging.compute_explained_squares(
        found.linearized.problem, model
    )
    names = sorted(found.conclusion.best.named, key=lambda name: -explained[name])
    alone = names[:-1] if len(names) <= _MOST_STEPS else names[:1]
    rest = names[len(alone) :]
    steps = [
        Step(
            f"with {rest[0] if len(rest) == 1 else f'{len(rest)} further effects'}",
            "effect",
            final,
        )
    ]
    for number in range(len(alone), 0, -1):
        some = tuple(entry for entry in chosen if entry[0].effect in alone[:number])
        # Errors that a tenth of a standard error in a parameter hardly moves.
        fitted = refit.fit_selected_effects(
            part.declared,
            part.search_sample,
            final.noise,
            some,
            steps[0].fitted,
            tolerance=INTERMEDIATE_TOLERANCE,
        )
        steps.insert(0, Step(f"with {alone[number - 1]}", "effect", fitted))
    return steps
