"""The oracle: what the same fit does when it is given which effects there are and at which joints.

It has the measurements, the noise and the held-out poses of the diagnosis, so that what it does better is worth what the search
for the effect has cost. It gets the effect by its name in the catalogue, not the plant's law; nor which variant of it (axes,
by time or by temperature): of these it takes the one that the residual of the declared model speaks for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import chi2

from elastocal.diagnosis.diagnose import Step
from elastocal.diagnosis.judge import heldout_errors
from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.refit import fit_with_sizes
from elastocal.diagnosis.search import initial_screening
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.case import Case, noise_from
from elastocal.fitting.tolerances import fit_declared
from elastocal.io.json_files import read_json, write_json
from elastocal.loop.whole import cases_in
from elastocal.validation.fitted_range import outside_poses
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.blind.limit import limit_of_sample
from elastocal_proof.plant.kinds import OUTSIDE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.fit_result import Fit

    _Chosen = tuple[float, Candidate, tuple[float, ...]]

LEVEL = 0.05


def oracle(
    truth: Mapping[str, Any], verdict: Mapping[str, Any], folder: str | Path, robots_folder: str | Path, seed: int
) -> dict[str, Any] | None:
    """What knowing the effects is worth in one case.

    `truth`: a sealed document. `verdict`: of the same case; its noise is used again. `folder`, `robots_folder`: as in
    `reading.read_campaign`. Returns ``candidates`` that the model was given; ``p_value`` of a Wald test [1] of all their
    coefficients at once (chi-squared, with the covariance of the fit at its shapes; a fitted shape counts as one more degree of
    freedom, and the p-value is multiplied by the number of variants, a Bonferroni correction [2]), 1 where these data identify
    none of them; ``detected`` at 5 %; ``heldout``, errors on the held-out poses as in verdict.json. None where an effect is
    outside of the catalogue: no model of it has that effect.

    [1] Wald, A., Tests of statistical hypotheses concerning several parameters when the number of observations is large,
        Transactions of the American Mathematical Society 54, 1943.
    [2] Dunn, O. J., Multiple comparisons among means, Journal of the American Statistical Association 56, 1961.
    """
    effects = [(defect["effect"], tuple(defect["joints"])) for defect in truth["defects"]]
    if any(effect.startswith(OUTSIDE) for effect, _ in effects):
        return None
    if not effects:
        # Without an effect the declared model is the right one, and has been judged already.
        return _outcome((), 1.0, verdict["heldout"]["before"])
    case, unseen = cases_in(folder, robots_folder)
    declared = fit_declared(case.model, case.observations, noise_from(verdict).of_measurements)
    fitted, members, variants = _with_effects(declared, case, effects)
    p_value = min(variants * _wald(fitted, members), 1.0)
    outside = outside_poses(fitted, case, unseen)
    _, heldout, _ = heldout_errors([Step("oracle", "declared", fitted)], case, unseen, outside, seed)
    return _outcome(members, p_value, heldout["before"])


def members_of(effect: str, joints: Sequence[int], candidates: Iterable[Candidate]) -> list[list[Candidate]]:
    """Candidates that an effect at some joints consists of, for each of its variants.

    `joints`: from 1; empty where the effect is no joint's. Returns one variant each. Bands of orders of one joint are no
    variants but parts.
    """
    mine = [c for c in candidates if c.effect == effect and bool(c.joints) == bool(joints) and set(c.joints) <= set(joints)]
    if joints:
        return [mine] if mine else []
    return [[candidate] for candidate in mine]


def _with_effects(
    declared: Fit, case: Case, effects: Iterable[tuple[str, tuple[int, ...]]]
) -> tuple[Fit, tuple[Candidate, ...], int]:
    """Fit with the effects, their candidates, and among how many variants these were chosen."""
    chosen: list[_Chosen] = []
    variants = 1
    settings = Settings()
    for effect, joints in effects:
        listed = [member for members in members_of(effect, joints, case.candidates.values()) for member in members]
        problem = linearized(declared, case.observations, listed, settings).problem
        factors = initial_screening(problem)[1]
        # Each at the shape that fits best.
        best: dict[str, _Chosen] = {}
        for number, unit in enumerate(problem.units):
            if unit.candidate and factors[number] > best.get(unit.candidate.key, (-np.inf,))[0]:
                best[unit.candidate.key] = factors[number], unit.candidate, unit.shapes
        alternatives = [[best[m.key] for m in members if m.key in best] for members in members_of(effect, joints, listed)]
        alternatives = [members for members in alternatives if members]
        if alternatives:
            variants *= len(alternatives)
            chosen += max(alternatives, key=lambda members: sum(factor for factor, _, _ in members))
    members = tuple(candidate for _, candidate, _ in chosen)
    effects_at = tuple((candidate, np.array(shapes, float)) for _, candidate, shapes in chosen)
    return fit_with_sizes(declared, case.observations, declared.noise, effects_at), members, variants


def _wald(fitted: Fit, members: Sequence[Candidate]) -> float:
    """Of all coefficients at once, given the shapes."""
    places = [np.split(fitted.places_of(member.key), [len(member.parameters)]) for member in members]
    linear, shapes = (np.concatenate([place[part] for place in places] or [np.empty(0)]) for part in (0, 1))
    free = np.flatnonzero(~fitted.held)
    tested, kept = np.isin(free, linear), ~np.isin(free, shapes)
    if not tested.any():
        return 1.0
    values = np.concatenate([fitted.values_of(member.key)[0] for member in members])[np.isin(linear, free)]
    information = np.linalg.inv(fitted.covariance[np.ix_(free, free)])
    covariance = np.linalg.inv(information[np.ix_(kept, kept)])[np.ix_(tested[kept], tested[kept])]
    return float(chi2.sf(values @ np.linalg.solve(covariance, values), tested.sum() + (~kept).sum()))


def _outcome(members: Iterable[Candidate], p_value: float, heldout: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "candidates": [member.key for member in members],
        "p_value": p_value,
        "detected": p_value < LEVEL,
        "heldout": heldout,
    }


def oracle_cases(job: Any) -> None:
    """What the oracle and the best analyst do on a block of blind cases, once they are diagnosed."""
    verdicts, robots = {verdict["campaign"]: verdict for verdict in read_json(job.input.verdicts)}, job.params.robots
    found = {}
    for name, truth in load_ground_truth([job.input.sealed], job.input.manifest).items():
        informed = oracle(truth, verdicts[name], f"{job.input.blind}/{name}", robots, job.params.seed)
        found[name] = {"oracle": informed, "limit": limit_of_sample(job.params.plan, truth, robots)}
    write_json(job.output.oracle, found, allow_nan=False)
