"""State what the training poses say of a campaign, as it stands in verdict.json."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.data_checks.faults import compliance_warnings
from elastocal.diagnosis import model_averaging, refit, verdict
from elastocal.diagnosis.gross_errors import format_gross_error_warnings
from elastocal.fitting.model import get_joint_compliances
from elastocal.fitting.noise import serialize_noise
from elastocal.io.typed_json import to_document

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.data_checks.protocol import Fault
    from elastocal.diagnosis.diagnose import Step
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.verdict import Evidence
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.fitting.noise import Noise
    from elastocal.remainder.repeatable import Repeatable
    from elastocal.verdict import GrossError


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
    repeatable : Repeatable or None
        What the kept model leaves that is a function of the joints.
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
    repeatable: Repeatable | None
    gross_errors: tuple[GrossError, ...]


def state_training_verdict(
    result: TrainingResult, settings: Settings
) -> dict[str, Any]:
    """Return the contents of verdict.json, without what validation poses add."""
    document = _document(
        result.case,
        result.noise,
        result.steps,
        result.full_model,
        result.evidence,
        result.faults,
        settings,
        result.warnings,
    )
    document |= {
        "contradictions": list(result.contradictions),
        "gross_errors": [to_document(error) for error in result.gross_errors],
        "repeatable": result.repeatable and asdict(result.repeatable),
    }
    document["warnings"] += format_gross_error_warnings(list(result.gross_errors))
    return document


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
    declared = steps[1].fitted
    final = steps[-1].fitted
    springs = model_averaging.ModelAverage({}, {})
    tested = set[str]()
    stated: dict[str, Any] = {
        "verdict": verdict.NAMED if len(known) == 1 else verdict.SEVERAL,
        "effects": [verdict.fault_entry(fault) for fault in known],
    } | dict.fromkeys(("probabilities", "misfit", "other_models_m"))
    untestable: dict[str, str] = {}
    remarks = [*warnings]
    if found:
        problem = found.linearized.problem
        conclusion = found.conclusion
        models = found.posterior.models
        nothing = found.posterior.empty_model
        best = models[conclusion.best.model] if conclusion.best.mechanisms else nothing
        chosen = best if conclusion.best.named else nothing
        kept = chosen if found.adopted else nothing
        owners = [(owner, parameter.name) for owner, parameter in declared.parameters]
        averages = model_averaging.average_models(
            found.linearized, found.posterior, chosen, owners
        )
        springs = (
            averages
            if kept is chosen
            else model_averaging.average_models(
                found.linearized, found.posterior, nothing, owners
            )
        )
        entries = verdict.effect_entries(
            found, with_effects, averages, case.observations
        )
        untestable = found.linearized.untestable
        other = model_averaging.compute_between_model_squares(
            problem, found.posterior, kept
        )
        tested = {unit.candidate.key for unit in problem.terms if unit.candidate}
        stated = {
            "verdict": conclusion.verdict,
            "effects": entries,
            "probabilities": verdict.probability_facts(found),
            "misfit": {
                "before": refit.predict_reduced_chi_square(problem, nothing),
                "after": refit.predict_reduced_chi_square(problem, best),
            },
            # Root mean square by which positions may be elsewhere by other models than
            # the one that is kept.
            "other_models_m": float(
                np.sqrt(3.0 * other / found.linearized.products.degrees_of_freedom)
            )
            * noise.position_m,
        }
        if entries and not found.adopted:
            remarks.append(
                "what was found is too uncertain to make predictions better: the model stays as declared"
            )
        remarks += verdict.implausible(with_effects, entries)
        if not found.settled:
            words = f"the problem was linearised {settings.linearizations} times, and each time another model was found"
            remarks.append(f"{words}: more may be missing")
    remarks += compliance_warnings(final) + verdict.scatter_warnings(
        final.noise, noise, settings.relinearize_noise
    )
    for name, fitted in (("declared", declared), ("final", final)):
        if not fitted.converged:
            remarks.append(
                f"the fit of the {name} model did not converge: its parameters are not to be relied on"
            )
    return stated | {
        "campaign": case.campaign.name,
        "noise": serialize_noise(noise)
        | {
            "pose_rad": final.noise.pose_rad,
            "factor": final.noise.position_m / noise.position_m,
        },
        "heldout": None,
        "kept": steps[-1].kind.replace("kept", "frames"),
        "compliance_urad_per_Nm": _compliances(
            declared, final, springs, settings.prior_share
        ),
        "held": sorted(
            {
                f"{o} {p.name}"
                for (o, p), held in zip(
                    final.parameters, final.unidentifiable, strict=True
                )
                if held
            }
        ),
        "candidates_tested": len(tested),
        "untestable": untestable,
        "converged": {"declared": declared.converged, "final": final.converged},
        "warnings": list(dict.fromkeys(remarks)),
        "settings": settings.document(),
    }


def _compliances(
    declared: Fit, final: Fit, springs: model_averaging.ModelAverage, prior_share: float
) -> dict[str, list[float]]:
    joints = final.model.sites.joints
    after = get_joint_compliances(final.model, final.estimate).copy()
    deviations = np.zeros(joints)
    identified = np.zeros(joints, bool)
    if final.model.identifies_compliance:
        mine = final.parameter_indices("joint_compliance")
        names = [
            ("joint_compliance", final.parameters[index][1].name) for index in mine
        ]
        alone = np.sqrt(np.diag(final.covariance))[mine]
        after += [springs.shift.get(name, 0.0) for name in names]
        deviations = np.array(
            [
                springs.std_error.get(name, error)
                for name, error in zip(names, alone, strict=True)
            ]
        )
        # With a prior of the size that such a spring reaches, of which that share would
        # be left.
        plausible = np.array([final.parameters[index][1].plausible for index in mine])
        identified = ~final.unidentifiable[mine] & (
            deviations**2 < prior_share * (deviations**2 + plausible**2)
        )
    found = {
        "before": get_joint_compliances(declared.model, declared.estimate),
        "after": after,
        "std_error": deviations,
    }
    return {name: (1e6 * values).tolist() for name, values in found.items()} | {
        "identifiable": identified.tolist()
    }
