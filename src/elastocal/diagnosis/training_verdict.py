"""State what the training poses say of a campaign, as it stands in verdict.json."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.data_checks.faults import warn_of_compliances
from elastocal.diagnosis import refit
from elastocal.diagnosis.effect_estimates import (
    format_location,
    state_effects,
    state_fault,
    warn_of_implausible_values,
)
from elastocal.diagnosis.gross_errors import format_gross_error_warnings
from elastocal.diagnosis.hypotheses import OTHER, RELATED
from elastocal.diagnosis.model_averaging import (
    ModelAverage,
    allow_for_laws,
    average_models,
    compute_between_model_squares,
)
from elastocal.diagnosis.verdict import (
    MIN_REPORTED_PROBABILITY,
    NAMED,
    SEVERAL,
    list_locations,
    warn_of_excess_scatter,
)
from elastocal.effects.catalogue import list_effects
from elastocal.fitting.model import get_joint_compliances
from elastocal.fitting.sensor_noise import compute_target_std_m
from elastocal.validation.held_out import compute_scatter
from elastocal.verdict import (
    Compliances,
    Convergence,
    Effect,
    MechanismSet,
    Misfit,
    NoiseEstimate,
    Probabilities,
    Setting,
    TrainingVerdict,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal.data_checks.protocol import Fault
    from elastocal.diagnosis.diagnose import Step
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.verdict import Evidence
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.fitting.noise import Noise
    from elastocal.verdict import GrossError, RepeatableResidual


@dataclass(frozen=True)
class TrainingResult:
    """Everything that a diagnosis of the training poses found.

    Attributes
    ----------
    case : Case
        Training poses without their gross errors.
    noise : Noise
        Noise as repeats show it or as the campaign declares it.
    steps : tuple of Step
        Models from the frames to the model that is kept; the second is the declared one.
    full_model : Fit
        Fit of the most probable model, whether or not its effects were adopted.
    evidence : Evidence or None
        Result of the search; None if the data are at fault.
    faults : sequence of Fault
        Faults of the data.
    warnings : tuple of str
        Warnings that come before those of this module.
    contradictions : tuple of str
        Reasons why the declared model is not called adequate.
    repeatable : RepeatableResidual or None
        Part of the residual of the kept model that is a function of the joints.
    gross_errors : tuple of GrossError
        Rows that were left out.
    """

    case: Case
    noise: Noise
    steps: tuple[Step, ...]
    full_model: Fit
    evidence: Evidence | None
    faults: Sequence[Fault]
    warnings: tuple[str, ...]
    contradictions: tuple[str, ...]
    repeatable: RepeatableResidual | None
    gross_errors: tuple[GrossError, ...]


def state_training_verdict(
    result: TrainingResult, settings: Settings
) -> TrainingVerdict:
    """State the part of a verdict that the training poses decide."""
    declared = result.steps[1].fitted
    final = result.steps[-1].fitted
    scatter = compute_scatter(final, result.noise, result.case.observations)
    held = {
        f"{owner} {parameter.name}"
        for (owner, parameter), is_held in zip(
            final.parameters, final.unidentifiable, strict=True
        )
        if is_held
    }
    stated = TrainingVerdict(
        verdict=NAMED if len(result.faults) == 1 else SEVERAL,
        effects=tuple(state_fault(fault) for fault in result.faults),
        probabilities=None,
        misfit=None,
        other_models_m=None,
        campaign=result.case.campaign.name,
        noise=_state_noise(result.noise, final.noise.pose_rad, scatter),
        heldout=None,
        kept=result.steps[-1].kind.replace("kept", "frames"),
        compliance_urad_per_Nm=_state_compliances(
            declared, final, ModelAverage({}, {}), settings.prior_share
        ),
        held=tuple(sorted(held)),
        candidates_tested=0,
        untestable={},
        converged=Convergence(declared.converged, final.converged),
        warnings=(),
        settings={
            name: Setting(**entry) for name, entry in settings.document().items()
        },
        contradictions=result.contradictions,
        gross_errors=result.gross_errors,
        repeatable=result.repeatable,
    )
    if result.evidence:
        stated = _state_evidence(stated, result, result.evidence, settings)
    warnings = [
        *result.warnings,
        *stated.warnings,
        *warn_of_compliances(final),
        *warn_of_excess_scatter(final, result.noise, scatter, settings.scatter_level),
    ]
    for name, fitted in (("declared", declared), ("final", final)):
        if not fitted.converged:
            warnings.append(
                f"the fit of the {name} model did not converge:"
                " its parameters are not to be relied on"
            )
    return replace(
        stated,
        warnings=(
            *dict.fromkeys(warnings),
            *format_gross_error_warnings(list(result.gross_errors)),
        ),
    )


def _state_evidence(
    stated: TrainingVerdict,
    result: TrainingResult,
    evidence: Evidence,
    settings: Settings,
) -> TrainingVerdict:
    """State the result of the search, with warnings that concern the search alone."""
    design = evidence.design
    posterior = evidence.posterior
    best = evidence.conclusion.best
    declared = result.steps[1].fitted
    best_model = (
        posterior.models[best.model] if best.mechanisms else posterior.empty_model
    )
    # The competitor alone predicts nothing that could be kept.
    named_model = evidence.named_model
    kept_model = named_model if evidence.adopted else posterior.empty_model
    owners = [(owner, parameter.name) for owner, parameter in declared.parameters]
    average = average_models(design, posterior, named_model, owners)
    kept_average = average
    if kept_model is not named_model:
        kept_average = average_models(design, posterior, kept_model, owners)
    effects = _state_widened_effects(result, evidence, average)
    between_models = compute_between_model_squares(
        design.problem, posterior, kept_model
    )
    other_models = float(
        np.sqrt(3.0 * between_models / design.products.degrees_of_freedom)
    )
    tested = {term.candidate.key for term in design.problem.terms if term.candidate}
    return replace(
        stated,
        verdict=evidence.conclusion.verdict,
        effects=effects,
        probabilities=_state_probabilities(evidence),
        misfit=Misfit(
            refit.predict_reduced_chi_square(design.problem, posterior.empty_model),
            refit.predict_reduced_chi_square(design.problem, best_model),
        ),
        other_models_m=other_models * _compute_target_noise_m(result),
        compliance_urad_per_Nm=_state_compliances(
            declared, result.steps[-1].fitted, kept_average, settings.prior_share
        ),
        candidates_tested=len(tested),
        untestable=design.untestable,
        warnings=(
            *warn_of_more_probable_causes(effects, evidence.conclusion.mechanisms),
            *_warn_of_search(evidence, result.full_model, effects, settings),
        ),
    )


def _compute_target_noise_m(result: TrainingResult) -> float:
    """Noise of a coordinate of the target, m, as shown or declared."""
    final = result.steps[-1].fitted
    return compute_target_std_m(
        final.model, final.estimate, result.case.observations, result.noise
    )


def _state_widened_effects(
    result: TrainingResult, evidence: Evidence, average: ModelAverage
) -> tuple[Effect, ...]:
    """State the effects with intervals that allow for laws which are only nearly
    true."""
    observations = result.case.observations
    poses = int(observations.cluster.max()) + 1
    widened = allow_for_laws(
        evidence.design.problem, evidence.named_model, average, poses
    )
    return state_effects(evidence, result.full_model, widened, observations)


def warn_of_more_probable_causes(
    effects: Sequence[Effect], mechanisms: Mapping[str, float]
) -> list[str]:
    """Warn of a mechanism that is more probable than a stated one, but not stated.

    The evidence as it is chooses the model; probabilities allow for laws that are only
    nearly true, and can order the mechanisms differently.

    Parameters
    ----------
    effects : stated effects.
    mechanisms : probability that a mechanism acts, by its name.
    """
    words = {name: effect.words for name, effect in list_effects().items()}
    words[OTHER] = RELATED
    stated = {effect.name for effect in effects}
    others = {
        name: probability
        for name, probability in mechanisms.items()
        if name in words and name not in stated
    }
    if not others:
        return []
    best = max(others, key=lambda name: others[name])
    less_probable = [
        f"{words[effect.name]} ({100 * effect.probability:.0f} %)"
        for effect in effects
        if effect.name in words and effect.probability < others[best]
    ]
    if not less_probable:
        return []
    verb = "is" if len(less_probable) == 1 else "are"
    return [
        f"{words[best]} ({100 * others[best]:.0f} %) is more probable than"
        f" {' and '.join(less_probable)}, which {verb} in the model: these measurements"
        " do not decide between them"
    ]


def _warn_of_search(
    evidence: Evidence,
    full_model: Fit,
    effects: tuple[Effect, ...],
    settings: Settings,
) -> tuple[str, ...]:
    """Return warnings of effects that are implausible, and of a search that did not
    settle."""
    keys = [key for effect in effects for key in effect.members]
    warnings = [
        *warn_of_implausible_values(full_model, keys),
        *warn_of_unknown_times(full_model, keys),
    ]
    if not evidence.settled:
        warnings.append(
            f"the problem was linearised {settings.linearizations} times, "
            "and each time another model was found: more may be missing"
        )
    return tuple(warnings)


def warn_of_unknown_times(full_model: Fit, keys: Sequence[str]) -> list[str]:
    """Warn of effects of time that the order of the rows alone shows."""
    words = {
        list_effects()[effect.effect].words
        for effect in full_model.model.effects
        if effect.key in keys and "order" in effect.needs
    }
    if not words:
        return []
    return [
        f"times are not recorded: {' and '.join(sorted(words))} is what the order of the"
        " rows shows if they followed each other at an even pace"
    ]


def _state_probabilities(evidence: Evidence) -> Probabilities:
    """State the probabilities that are worth reporting; each set of mechanisms has the
    locations of its most probable model."""
    conclusion = evidence.conclusion
    sets = []
    nothing = 0.0
    for hypothesis in conclusion.hypotheses:
        if not hypothesis.mechanisms:
            nothing = hypothesis.probability
        if hypothesis.probability < MIN_REPORTED_PROBABILITY:
            continue
        model = evidence.posterior.models[hypothesis.model]
        locations = {}
        for name in hypothesis.mechanisms:
            model_locations = list_locations(evidence.design.problem, model, name)
            locations[name] = tuple(
                format_location(name, location) for location in model_locations
            )
        sets.append(
            MechanismSet(hypothesis.mechanisms, hypothesis.probability, locations)
        )
    return Probabilities(
        nothing=nothing,
        stated=conclusion.probability,
        alarm_p_value=evidence.alarm.p_value,
        mechanisms={
            name: probability
            for name, probability in conclusion.mechanisms.items()
            if probability >= MIN_REPORTED_PROBABILITY
        },
        sets=tuple(sets),
    )


def _state_noise(measured: Noise, pose_rad: float, scatter: float) -> NoiseEstimate:
    """State the noise of the measurements, with the pose error and the scatter of the
    final model."""
    return NoiseEstimate(
        source=measured.source,
        position_m=measured.position_m,
        orientation_rad=measured.orientation_rad,
        joint_rad=tuple(measured.joint_rad.tolist()),
        degrees_of_freedom=measured.degrees_of_freedom,
        pose_rad=pose_rad,
        factor=scatter,
    )


def _state_compliances(
    declared: Fit, final: Fit, average: ModelAverage, prior_share: float
) -> Compliances:
    """State the joint compliances, averaged over models where they are identified.

    Parameters
    ----------
    declared, final : Fit
        Fits of the declared and of the final model.
    average : ModelAverage
        Corrections by the other models.
    prior_share : float
        Largest share of the prior variance that an identifiable compliance keeps.
    """
    joints = final.model.sites.joints
    after = get_joint_compliances(final.model, final.estimate).copy()
    std_error = np.zeros(joints)
    identifiable = np.zeros(joints, bool)
    if final.model.identifies_compliance:
        indices = final.parameter_indices("joint_compliance")
        parameters = [final.parameters[index][1] for index in indices]
        keys = [("joint_compliance", parameter.name) for parameter in parameters]
        after += [average.shift.get(key, 0.0) for key in keys]
        # Averages are of normal approximations; no spring is negative.
        after = np.maximum(after, 0.0)
        fit_errors = np.sqrt(np.diag(final.covariance))[indices]
        std_error = np.array(
            [
                average.std_error.get(key, fit_error)
                for key, fit_error in zip(keys, fit_errors, strict=True)
            ]
        )
        identifiable = ~final.unidentifiable[indices] & (
            std_error**2 < prior_share * final.prior_std[indices] ** 2
        )
        std_error = np.where(identifiable, std_error, 0.0)
    before = get_joint_compliances(declared.model, declared.estimate)
    return Compliances(
        before=tuple((1e6 * before).tolist()),
        after=tuple((1e6 * after).tolist()),
        std_error=tuple((1e6 * std_error).tolist()),
        identifiable=tuple(identifiable.tolist()),
    )
