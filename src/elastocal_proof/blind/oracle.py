"""Reference of a diagnosis: the oracle, a fit that knows the true effects.

The oracle has the same data as the diagnosis and knows which effects of the catalogue
there are and at which joints. Among variants of an effect (axes, by time or by
temperature) it takes the one that the residual of the declared model supports most. It
is a reference and not an upper bound: a diagnosis that selects another model may have
smaller errors by chance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from elastocal.diagnosis.diagnose import Step
from elastocal.diagnosis.judge import compare_held_out_errors
from elastocal.fitting.noise import fit_declared_model, parse_noise
from elastocal.io.json_files import read_json, write_json
from elastocal.io.typed_json import to_document
from elastocal.loop.whole import read_cases
from elastocal.validation.transfer import find_extrapolated_poses
from elastocal_proof.blind.alternatives import find_alternatives
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.blind.known_effects import (
    LEVEL,
    ScoredCandidate,
    compute_wald_p_value,
    fit_scored_candidates,
    score_candidates,
)
from elastocal_proof.plant.kinds import OUTSIDE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.fitting.noise import Noise


@dataclass(frozen=True)
class OracleFit:
    """The declared model with the true effects, fitted by an analyst who knows them.

    Attributes
    ----------
    fitted
        The fit.
    candidates
        Candidates of the true effects in it.
    p_value
        Of all their coefficients at once; 1 if the data identify none of them.
    alternatives
        Other mechanisms beside which the true one is not significant; None if it is not
        detected or if there are several.
    """

    fitted: Fit
    candidates: list[Candidate]
    p_value: float
    alternatives: list[str] | None

    @property
    def detected(self) -> bool:
        """Whether the true effects are significant."""
        return self.p_value < LEVEL

    @property
    def excludes_others(self) -> bool:
        """Whether the measurements exclude every other mechanism as the only cause."""
        return self.alternatives == []


def fit_oracle(
    truth: Mapping[str, Any],
    verdict: Mapping[str, Any],
    folder: str | Path,
    robots_folder: str | Path,
    seed: int,
) -> dict[str, Any] | None:
    """Fit the true effects of one case and test them.

    The test is a Wald test of all their coefficients at once. Its p-value is multiplied
    by the number of variants, a Bonferroni correction [1]_.

    Parameters
    ----------
    truth, verdict : mapping
        Sealed document and verdict of the case; the noise of the verdict is used again.
    folder, robots_folder : path
        Folder of the campaign, and of robot files.
    seed : int
        Seed of the bootstrap over held-out poses.

    Returns
    -------
    dict or None
        ``candidates`` in the model; ``p_value``, 1 if the data identify none of them;
        ``detected`` at the level of 5 %; ``alternatives``, other mechanisms beside which the
        true one is not significant, None if it is not detected or if there are several;
        ``heldout``, errors of the held-out poses as in verdict.json. None if an effect
        is outside of the catalogue, because no model has that effect.

    References
    ----------
    .. [1] Dunn, O. J., Multiple comparisons among means, Journal of the American
       Statistical Association 56, 1961.
    """
    defects = truth["defects"]
    if any(defect["effect"].startswith(OUTSIDE) for defect in defects):
        return None
    if not defects:
        # Without an effect the declared model is the right one, and the verdict has its
        # errors.
        return _describe_outcome([], 1.0, None, verdict["heldout"]["declared"])
    case, held_out = read_cases(folder, robots_folder)
    noise = parse_noise(verdict).without_pose_error
    oracle = fit_true_effects(case, noise, defects)
    outside = find_extrapolated_poses(oracle.fitted, case, held_out)
    _, heldout, _ = compare_held_out_errors(
        [Step("oracle", "declared", oracle.fitted)],
        (case, held_out),
        outside,
        noise,
        seed,
    )
    return _describe_outcome(
        oracle.candidates,
        oracle.p_value,
        oracle.alternatives,
        to_document(heldout.declared),
    )


def fit_true_effects(
    case: Case, noise: Noise, defects: Sequence[Mapping[str, Any]]
) -> OracleFit:
    """Fit the true effects to the fitted measurements of one case, test them, and find
    the mechanisms that these measurements do not exclude.

    Parameters
    ----------
    case
        The fitted measurements.
    noise
        Noise that the verdict states.
    defects
        The true effects, each with ``effect`` and ``joints``; all are in the catalogue.
    """
    declared = fit_declared_model(case.model, case.observations, noise)
    selected: list[ScoredCandidate] = []
    variants = 1
    for defect in defects:
        scored_variants = _score_variants(
            declared, case, defect["effect"], defect["joints"]
        )
        if scored_variants:
            variants *= len(scored_variants)
            selected += max(scored_variants, key=_sum_log_bayes_factors)
    fitted = fit_scored_candidates(declared, case.observations, selected)
    candidates = [scored.candidate for scored in selected]
    p_value = min(variants * compute_wald_p_value(fitted, candidates), 1.0)
    alternatives = None
    if p_value < LEVEL and len({defect["effect"] for defect in defects}) == 1:
        alternatives = find_alternatives(
            declared, case.observations, case.candidates.values(), selected
        )
    return OracleFit(fitted, candidates, p_value, alternatives)


def list_variants(
    effect: str, joints: Sequence[int], candidates: Iterable[Candidate]
) -> list[list[Candidate]]:
    """List the variants of an effect at some joints, counted from 1, each as the
    candidates that it consists of, such as bands of orders."""
    members = [
        candidate
        for candidate in candidates
        if candidate.effect == effect
        and bool(candidate.joints) == bool(joints)
        and set(candidate.joints) <= set(joints)
    ]
    if joints:
        return [members] if members else []
    return [[candidate] for candidate in members]


def _score_variants(
    declared: Fit, case: Case, effect: str, joints: Sequence[int]
) -> list[list[ScoredCandidate]]:
    """Score the variants of an effect that the data can test, each of their candidates
    at its best shapes."""
    variants = list_variants(effect, joints, case.candidates.values())
    candidates = [candidate for variant in variants for candidate in variant]
    best = score_candidates(declared, case.observations, candidates)
    scored_variants = []
    for variant in variants:
        scored = [best[member.key] for member in variant if member.key in best]
        if scored:
            scored_variants.append(scored)
    return scored_variants


def _sum_log_bayes_factors(variant: Iterable[ScoredCandidate]) -> float:
    return sum(scored.log_bayes_factor for scored in variant)


def _describe_outcome(
    candidates: Iterable[Candidate],
    p_value: float,
    alternatives: list[str] | None,
    heldout: Mapping[str, Any],
) -> dict[str, Any]:
    """Describe the result of the oracle as its file does."""
    return {
        "candidates": [candidate.key for candidate in candidates],
        "p_value": p_value,
        "detected": p_value < LEVEL,
        "alternatives": alternatives,
        "heldout": heldout,
    }


def oracle_cases(job: Any) -> None:
    """Run the oracle on a block of diagnosed blind cases."""
    verdicts = {
        verdict["campaign"]: verdict for verdict in read_json(job.input.verdicts)
    }
    truths = load_ground_truth([job.input.sealed], job.input.manifest)
    robots = job.params.robots
    outcomes = {}
    for name, truth in truths.items():
        folder = f"{job.input.blind}/{name}"
        outcomes[name] = fit_oracle(
            truth, verdicts[name], folder, robots, job.params.seed
        )
    write_json(job.output.oracle, outcomes, allow_nan=False)
