"""The two calls: `diagnose` looks at training poses alone, `judge` opens the held-out ones, once, at the end."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.counting import counted
from elastocal.data_checks.protocol import faults
from elastocal.data_checks.warnings import fitted_compliance_warnings
from elastocal.diagnosis import findings
from elastocal.diagnosis.alarm import alarm_of
from elastocal.diagnosis.averaging import Averaged, averaged, expected_to_help, other_predictions, squares_explained
from elastocal.diagnosis.centres import with_probable_centres
from elastocal.diagnosis.findings import Evidence
from elastocal.diagnosis.gross_errors import Deviations, entries_of, gross_errors, warnings_of
from elastocal.diagnosis.kept_rows import first_kept, fitted_to
from elastocal.diagnosis.linearize import linearized, shapes_looked_at_closely
from elastocal.diagnosis.refit import (
    fit_with_sizes,
    mean_square,
    mean_square_left,
    noise_beside,
    remaining_noise,
    selected,
    with_shapes_of,
)
from elastocal.diagnosis.search import initial_screening, posterior
from elastocal.diagnosis.verdict import (
    ADEQUATE,
    NAMED,
    NOT_TESTABLE,
    SEVERAL,
    UNEXPLAINED,
    concluded,
    contradictions,
    pose_error_warnings,
    remainder_sentences,
    scatter_warnings,
    with_related,
)
from elastocal.effects.catalogue import effects
from elastocal.fitting.least_squares import ON_THE_WAY, SETTLED, fit
from elastocal.fitting.model import joint_compliances, parameter_values
from elastocal.fitting.noise import noise_facts
from elastocal.fitting.observations import sample_of
from elastocal.fitting.tolerances import effective_parameters
from elastocal.random_streams import stream
from elastocal.remainder.repeatable import repeatable_part
from elastocal.validation.held_out import left_out_squares

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from elastocal.campaigns.campaign import Measurements
    from elastocal.data_checks.protocol import Fault
    from elastocal.diagnosis.gross_errors import Yardstick
    from elastocal.diagnosis.kept_rows import Kept
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.verdict import Hypothesis
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations
    from elastocal.remainder.repeatable import Repeatable

# Mechanisms that are added one at a time, each by a fit; of more, only the first.
_MOST_STEPS = 4
# Standard errors by which parameters move where nothing else is found: they change a log likelihood by 0.03 each.
_HARDLY = 0.25


@dataclass(frozen=True)
class Step:
    """One model on the way from the nominal robot to all effects found.

    `kind`: of the last, "kept" where frames alone predict training poses better than what was fitted. `fitted`: to the training
    poses.
    """

    name: str
    kind: str
    fitted: Fit


@dataclass(frozen=True)
class Diagnosis:
    """What training poses say of a campaign.

    `steps`: the last is the final model. `document`: contents of verdict.json, but for what held-out poses say. `left_out`:
    gross errors, which are no part of the case. `yardstick`: by which the training rows were judged; None where they were not
    all judged by the final model.
    """

    case: Case
    steps: tuple[Step, ...]
    evidence: Evidence | None
    document: dict[str, Any] = field(repr=False)
    left_out: Measurements
    yardstick: Yardstick | None = None

    @property
    def declared(self) -> Fit:
        """Fit of the declared model."""
        return next(step.fitted for step in self.steps if step.kind == "declared")

    @property
    def final(self) -> Fit:
        """Fit with all effects that were adopted."""
        return self.steps[-1].fitted


def diagnose(case: Case, settings: Settings, seed: int, progress: Callable[[str], None] | None = None) -> Diagnosis:
    """Find what the declared model of a campaign lacks.

    Parameters
    ----------
    case : Case
        Of training poses.
    settings : Settings
    seed : int
        Of the simulated null distribution.
    progress : callable, optional
        Gets a line after each stage.

    Returns
    -------
    Diagnosis
    """
    whole = case.campaign
    tell = progress or (lambda line: None)
    part = first_kept(case, settings)
    known = faults(part.case.campaign, part.case.campaign.measurements)
    decisive = [fault for fault in known if fault.decisive]
    if decisive:
        # Where all measurements mean something else, no single row is wrong.
        part = fitted_to(case, np.ones(len(case.campaign.measurements), bool), settings)
    elif not known:
        part = with_probable_centres(part, settings)
        case = replace(case, model=part.case.model)
    tell(f"declared model fitted to {counted(len(part.case.observations), 'measurement')}")
    found: Evidence | None = None
    about, near, most_pose_error_rad = part.declared, None, np.inf
    explained: Fit | None = None
    tested: tuple[Fit, Repeatable | None] | None = None
    errors = Deviations.none(len(part.kept), case.model.rows)
    good = np.zeros(len(part.kept), bool)
    for number in range(0 if decisive else settings.gross_error_rounds):
        if not found:
            found, about, tested = _explained(part, settings, seed, tell, near, most_pose_error_rad)
            explained = about
        errors = gross_errors(about, part.noise, case.campaign.measurements, part.kept, settings)
        # A row that a model without it explains stays, whatever the next model says of it: no set of rows comes back.
        good |= ~part.kept & ~errors.gross
        remaining = ~errors.gross | good
        if (remaining == part.kept).all() or number + 1 == settings.gross_error_rounds:
            break
        # The model found looks at all rows once more, without these, before another search is made.
        like = None if (remaining & ~part.kept).any() else part.searched
        some = sample_of(case.select(remaining).observations, settings.searched_observations, like)
        about = fit(about.model, some, about.noise, about.estimate, True, ON_THE_WAY)
        errors = gross_errors(about, part.noise, case.campaign.measurements, remaining, settings)
        good |= ~remaining & ~errors.gross
        last, part = part, fitted_to(case, ~errors.gross | good, settings, part)
        if part is last:
            break
        tell(f"{counted((~part.kept).sum(), 'gross error')} in {counted(len(good), 'row')}: once more without")
        if noise_facts(part.noise) == noise_facts(last.noise) and explained:
            again = fit(explained.model, part.searched, about.noise, about.estimate, True, ON_THE_WAY)
            if _near(again, explained):
                # Rows of so little weight that the search would find the same.
                about = again
                continue
        # What was linearised about a model found is so again: from the declared one the way is the same and twice as long.
        relinearized = len(found.linearized.about.model.effects) > len(part.declared.model.effects)
        near = (about, found.conclusion.best.named) if relinearized else None
        most_pose_error_rad = found.linearized.most_pose_error_rad
        # Its statistics make room for those of the next search.
        found = None
    yardstick = errors.yardstick if part.kept.all() else None
    errors = replace(errors, gross=~part.kept)
    case, noise, declared = part.case, part.noise, part.declared_to_all()
    final = about if found else declared
    if found and (about is not explained or part.searched is not case.observations):
        final = fit(about.model, case.observations, about.noise, about.estimate, reweighted=True)
    bare = fit(replace(case.model, effects=()), case.observations, noise, settled=ON_THE_WAY)
    steps = [Step("frames and targets", "frames", bare), Step("declared model", "declared", declared)]
    lost: list[str] = []
    if found:
        doubted = findings.oversized(final, found.conclusion.best.named)
        found = replace(found, conclusion=with_related(found.conclusion, doubted))
        if not found.adopted:
            named = found.conclusion.best.named
            steps[-1] = replace(steps[-1], fitted=_with_noise_left(case, declared, found) if named else final)
        lost = _losses(bare, [steps[-1].fitted, *([final] if found.adopted else [])], case.observations, settings)
        found = replace(found, adopted=found.adopted and not lost)
        if found.adopted:
            steps += _effect_steps(case, declared, final, found)
        elif lost and lost[0]:
            kept = fit(bare.model, case.observations, steps[-1].fitted.noise, bare.estimate)
            steps.append(Step("frames and targets, kept", "kept", kept))
    kept = steps[-1].fitted
    repeatable = (
        tested[1] if tested and tested[0] is kept else repeatable_part(kept, case.observations, seed) if found else None
    )
    unnamed, contradicting = remainder_sentences(repeatable), list[str]()
    if found and found.conclusion.verdict == ADEQUATE:
        contradicting = unnamed or contradictions(final, noise, settings)
    elif found and found.conclusion.verdict == NOT_TESTABLE:
        contradicting = unnamed
    if found and contradicting:
        found = replace(found, conclusion=replace(found.conclusion, verdict=UNEXPLAINED))
    warnings = [*contradicting, *part.warnings, *filter(None, lost)]
    if found and not unnamed:
        warnings += pose_error_warnings(kept.noise, found.linearized.pose_std_error_rad)
    document = _document(case, noise, steps, final, found, known, settings, warnings)
    left_out = entries_of(errors, whole, held_out=False)
    warnings = [*document["warnings"], *warnings_of(left_out)]
    document |= {"contradictions": contradicting, "gross_errors": left_out, "warnings": warnings}
    document["repeatable"] = repeatable and asdict(repeatable)
    yardstick = yardstick if kept is about else None
    return Diagnosis(case, tuple(steps), found, document, whole.measurements.select(errors.gross), yardstick)


def _with_noise_left(case: Case, declared: Fit, found: Evidence) -> Fit:
    """The declared model under the noise that it leaves itself, for nothing else enters the model that is kept."""
    noise = remaining_noise(found.linearized.problem, found.posterior.nothing, found.linearized.about.noise, declared.noise)
    return fit(declared.model, case.observations, noise, declared.estimate, reweighted=True)


def _losses(bare: Fit, models: Sequence[Fit], observations: Observations, settings: Settings) -> list[str]:
    """A sentence for each model that predicts left-out training poses worse than frames alone, empty for one that does not.

    Of the declared model and, if it is given, that with effects; nothing where the last holds.
    """
    found: list[str] = []
    for fitted, name in zip(models, ("declared model", "model with the effects found"), strict=False):
        numbers, words = fitted.residual.size, ""
        if numbers < settings.numbers_a_parameter * effective_parameters(fitted):
            mine, others = (left_out_squares(each, observations) for each in (fitted, bare))
            off = mine - others
            if off.mean() > off.std(ddof=1) / np.sqrt(len(off)):
                rms = [f"{1e3 * np.sqrt(each.mean()):.2f} mm" for each in (mine, others)]
                words = (
                    f"training poses left out in turn are off by {rms[0]} RMS by the {name}, by {rms[1]} with frames and"
                    f" targets alone: {len(mine)} poses are too few for {effective_parameters(fitted):.0f} parameters, and the"
                    f" {name} is not kept"
                )
        found.append(words)
    return found if found[-1] else []


def _explained(
    part: Kept,
    settings: Settings,
    seed: int,
    tell: Callable[[str], None],
    start: tuple[Fit, tuple[str, ...]] | None,
    most_pose_error_rad: float,
) -> tuple[Evidence, Fit, tuple[Fit, Repeatable | None] | None]:
    """Evidence about the declared model, and again about the model found where that, or its noise, is far from it.

    At once about a model, with the mechanisms that it has beyond the declared one, where the search is to ``start``. With it
    the fit of the model found to what the search looks at; and the last fit of which it was asked what it leaves, with that.
    What an error common to the measurements of a pose takes beyond what robots repeat to must be chance: where it is a function
    of the joints no more of it is thought of. And where what is left is one, the search goes on about each model that is new.
    """
    candidates, searched = list(part.case.candidates.values()), part.searched
    about = declared = part.declared
    before, settled = None, True
    tested: tuple[Fit, Repeatable | None] | None = None
    # The fit to all measurements starts where that to some ends.
    enough = SETTLED if searched is part.case.observations else ON_THE_WAY
    if start:
        found_before, before = start
        about = fit(found_before.model, searched, found_before.noise, found_before.estimate, True, ON_THE_WAY)
    for round_number in range(1 if start else 0, settings.linearizations):
        problem, near = linearized(about, searched, candidates, settings, most_pose_error_rad), about if before else None
        nothing, alone = initial_screening(problem.problem)
        draws = stream(seed, part.case.campaign.name, "null distribution", round_number)
        alarm = alarm_of(problem.problem, problem.products, nothing.pose_error_rad, draws)
        # The alarm comes before the measurements choose at which shapes to look more closely: it would no longer be exact.
        if alarm.raised:
            problem = problem.with_shapes(shapes_looked_at_closely(problem.problem, alone))
        found = posterior(problem.problem, {effect.key for effect in about.model.effects})
        conclusion = concluded(problem.problem, found, alarm)
        # Rows of a long campaign make room for the fit, and for those of the next linearisation.
        problem = problem.without_rows
        named, taken = conclusion.best.named, about.noise
        model = found.models[conclusion.best.model] if named else found.nothing
        # No verdict yet, and no probability: a later search, or the poses left out, may say otherwise.
        words = [getattr(effects().get(name), "words", "an unknown mechanism") for name in conclusion.best.mechanisms]
        leading = " with ".join(words) or "nothing is missing"
        tell(f"search {round_number + 1} of at most {settings.linearizations}: leading so far, {leading}")
        noise = remaining_noise(problem.problem, model, taken, declared.noise)
        about = fit_with_sizes(declared, searched, noise, selected(problem, model), near, settled=enough)
        off = noise.position_m > settings.relinearize_noise * taken.position_m
        small = not named or alarm.statistic < settings.relinearize_above
        ends = not off and (small or named == before or abs(mean_square(about) - 1.0) < settings.linear_misfit)
        # What is a function of the joints is no error of poses, and about a model that is new the problem is another one.
        large = model.pose_error_rad > settings.pose_repeatability_rad
        if large or (ends and named not in (before, ())):
            tested = about, repeatable_part(about, searched, seed)
        remains = tested is not None and tested[0] is about and tested[1] is not None and tested[1].remains
        if ends and not remains:
            break
        if remains:
            most_pose_error_rad = settings.pose_repeatability_rad
            if large:
                noise = noise_beside(about, searched, most_pose_error_rad)
                about = fit(about.model, searched, noise, about.estimate, True, enough)
        before = named
        if round_number + 1 < settings.linearizations:
            # The next problem takes the room of this one.
            del problem, found, conclusion
    else:
        settled = False
    adopted = bool(named) and expected_to_help(problem.problem, found, model)
    return Evidence(problem, found, alarm, conclusion, adopted, settled), about, tested


def _near(fitted: Fit, other: Fit) -> bool:
    """Whether no parameter of a model moved by more than `_HARDLY` from one fit to another."""
    moved = parameter_values(fitted.model, fitted.estimate) - parameter_values(other.model, other.estimate)
    return bool((np.abs(moved) <= _HARDLY * np.sqrt(np.diag(other.covariance))).all())


def _effect_steps(case: Case, declared: Fit, final: Fit, found: Evidence) -> list[Step]:
    """One step for each mechanism, that which explains most first, each with those before it; of many, the rest together."""
    model = found.posterior.models[found.conclusion.best.model]
    chosen = with_shapes_of(selected(found.linearized, model), final)
    explained = squares_explained(found.linearized.problem, model)
    names = sorted(found.conclusion.best.named, key=lambda name: -explained[name])
    alone = names[:-1] if len(names) <= _MOST_STEPS else names[:1]
    rest = names[len(alone) :]
    steps = [Step(f"with {rest[0] if len(rest) == 1 else f'{len(rest)} further effects'}", "effect", final)]
    for number in range(len(alone), 0, -1):
        some = tuple(entry for entry in chosen if entry[0].effect in alone[:number])
        # Only its errors are shown, which a tenth of a standard error in a parameter hardly moves.
        fitted = fit_with_sizes(declared, case.observations, final.noise, some, steps[0].fitted, settled=ON_THE_WAY)
        steps.insert(0, Step(f"with {alone[number - 1]}", "effect", fitted))
    return steps


def _document(
    case: Case,
    noise: Noise,
    steps: Sequence[Step],
    with_effects: Fit,
    found: Evidence | None,
    known: Sequence[Fault],
    settings: Settings,
    warnings: Sequence[str],
) -> dict[str, Any]:
    declared, final = steps[1].fitted, steps[-1].fitted
    decisive = [fault for fault in known if fault.decisive]
    springs = Averaged({}, {})
    entries = [findings.fault_entry(fault) for fault in decisive]
    probabilities: dict[str, Any] | None = None
    untestable: dict[str, str] = {}
    misfit: dict[str, float] | None = None
    other_m: float | None = None
    verdict = NAMED if len(decisive) == 1 else SEVERAL
    remarks = [*warnings, *(f"{fault.name}: {fault.detail}" for fault in known if not fault.decisive)]
    if found:
        problem, conclusion = found.linearized.problem, found.conclusion
        verdict, untestable = conclusion.verdict, found.linearized.untestable
        probabilities = findings.probability_facts(found)
        named = conclusion.best if conclusion.best.named else None
        averages = _averages(declared, found, named)
        springs = _averages(declared, found, None) if named and not found.adopted else averages
        entries = findings.effect_entries(found, with_effects, averages, case.observations)
        if entries and not found.adopted:
            remarks.append("what was found is too uncertain to make predictions better: the model stays as declared")
        remarks += findings.implausible(with_effects, entries, case.campaign.robot.payload_kg)
        if not found.settled:
            often = f"linearised {settings.linearizations} times"
            remarks.append(f"the problem was {often}, and each time another model was found: more may be missing")
        misfit = _misfit(found)
        kept = found.posterior.models[conclusion.best.model] if found.adopted else found.posterior.nothing
        numbers = found.linearized.products.freedom
        other_m = float(np.sqrt(3.0 * other_predictions(problem, found.posterior, kept) / numbers)) * noise.position_m
    remarks += fitted_compliance_warnings(final) + scatter_warnings(final.noise, noise, settings.relinearize_noise)
    for name, fitted in (("declared", declared), ("final", final)):
        if not fitted.converged:
            remarks.append(f"the fit of the {name} model did not converge: its parameters are not to be relied on")
    tested = {unit.candidate.key for unit in found.linearized.problem.units if unit.candidate} if found else set()
    return {
        "campaign": case.campaign.name,
        "verdict": verdict,
        "effects": entries,
        "probabilities": probabilities,
        "noise": noise_facts(noise) | {"pose_rad": final.noise.pose_rad, "factor": final.noise.position_m / noise.position_m},
        "misfit": misfit,
        # Root mean square by which positions may be elsewhere by other models than the one that is kept.
        "other_models_m": other_m,
        "heldout": None,
        "kept": steps[-1].kind.replace("kept", "frames"),
        "compliance_urad_per_Nm": _compliances(declared, final, springs, settings.prior_share),
        "held": sorted({f"{o} {p.name}" for (o, p), held in zip(final.parameters, final.held, strict=True) if held}),
        "candidates_tested": len(tested),
        "untestable": untestable,
        "converged": {"declared": declared.converged, "final": final.converged},
        "warnings": list(dict.fromkeys(remarks)),
        "settings": settings.document(),
    }


def _misfit(found: Evidence) -> dict[str, float]:
    """Mean square of the residual over that of the noise: declared, and with the most probable model."""
    problem, models = found.linearized.problem, found.posterior.models
    best = models[found.conclusion.best.model] if found.conclusion.best.mechanisms else found.posterior.nothing
    return {"before": mean_square_left(problem, found.posterior.nothing), "after": mean_square_left(problem, best)}


def _averages(declared: Fit, found: Evidence, best: Hypothesis | None) -> Averaged:
    """Averages beside the exact fit of a hypothesis, or of the declared model."""
    model = found.posterior.models[best.model] if best else found.posterior.nothing
    owners = [(owner, parameter.name) for owner, parameter in declared.parameters]
    return averaged(found.linearized, found.posterior, model, owners)


def _compliances(declared: Fit, final: Fit, springs: Averaged, prior_share: float) -> dict[str, list[float]]:
    joints = final.model.sites.joints
    after, deviations = joint_compliances(final.model, final.estimate).copy(), np.zeros(joints)
    identified = np.zeros(joints, bool)
    if final.model.identifies_compliance:
        mine = final.places_of("joint_compliance")
        names = [("joint_compliance", final.parameters[index][1].name) for index in mine]
        alone = np.sqrt(np.diag(final.covariance))[mine]
        after += [springs.shift.get(name, 0.0) for name in names]
        deviations = np.array([springs.std_error.get(name, error) for name, error in zip(names, alone, strict=True)])
        # With a prior of the size that such a spring reaches, of which that share would be left.
        plausible = np.array([final.parameters[index][1].plausible for index in mine])
        identified = ~final.held[mine] & (deviations**2 < prior_share * (deviations**2 + plausible**2))
    found = {"before": joint_compliances(declared.model, declared.estimate), "after": after, "std_error": deviations}
    return {name: (1e6 * values).tolist() for name, values in found.items()} | {"identifiable": identified.tolist()}
