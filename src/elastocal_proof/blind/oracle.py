"""Upper bounds of what a diagnosis can achieve: the oracle, which knows the effects,
and the best analyst, who knows the laws of the simulated robot.

The oracle has the same data as the diagnosis and knows which effects of the catalogue
there are and at which joints. Among variants of an effect (axes, by time or by
temperature) it takes the one that the residual of the declared model supports most.

The best analyst knows the laws of the simulated robot, how often each mechanism occurs
and how large it is. For each mechanism at each location some defects are drawn as the
simulation draws them. Let S (M, m) be their signals after absorption, each of the
non-centrality of the case. The residual under an unknown defect of that kind is assumed
normal with covariance I + S S'/m, and choosing the most probable mechanism is the Bayes
rule of linear Gaussian models [1]_. The alarm is the likelihood-ratio test of the
average over all of them, whose average power no other test exceeds [2]_; its null
distribution is simulated.

References
----------
.. [1] Bishop, C. M., Pattern Recognition and Machine Learning, chapter 3, Springer,
   2006.
.. [2] Lehmann, E. L. and Romano, J. P., Testing Statistical Hypotheses, section 3.8,
   Springer, 2005.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.stats import chi2

from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.diagnose import Step
from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.judge import compare_held_out_errors
from elastocal.diagnosis.refit import fit_selected_effects
from elastocal.diagnosis.search import screen_terms
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.noise import fit_declared_model, parse_noise
from elastocal.io.json_files import read_json, write_json
from elastocal.io.typed_json import to_document
from elastocal.loop.whole import read_cases
from elastocal.validation.transfer import find_extrapolated_poses
from elastocal_proof.blind.cases import (
    CATALOGUE_EFFECTS,
    BlindCase,
    build_noncentrality_model,
    find_absent_effects,
    size_defects,
)
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.plant.kinds import KINDS, OUTSIDE, Defect, apply_defects
from elastocal_proof.plant.simulated_robot import open_simulation_stream

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal_proof.blind.cases import Plan
    from elastocal_proof.plant.sizing import NoncentralityModel

LEVEL = 0.05
# Drawn defects of each kind at each location: as many as the details of a defect have
# dimensions, within a factor of two.
_DRAWS = 8
_NULL_DRAWS = 2000
# If a smaller share of a signal's squares remains, the declared model absorbs the
# defect at any size.
_ABSORBED = 1e-4
# Block size: this many hypotheses are evaluated at once, which bounds the memory.
_HYPOTHESES_AT_ONCE = 1000


class _ScoredCandidate(NamedTuple):
    """A candidate at its best shapes, with its log Bayes factor against the declared
    model."""

    log_bayes_factor: float
    candidate: Candidate
    shapes: tuple[float, ...]


def fit_oracle(
    truth: Mapping[str, Any],
    verdict: Mapping[str, Any],
    folder: str | Path,
    robots_folder: str | Path,
    seed: int,
) -> dict[str, Any] | None:
    """Fit the true effects of one case and test them.

    The test is a Wald test [1]_ of all their coefficients at once: chi-squared, with
    the covariance of the fit at its shapes. A fitted shape counts as one more degree of
    freedom, and the p-value is multiplied by the number of variants, a Bonferroni
    correction [2]_.

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
        ``detected`` at the level of 5 %; ``heldout``, errors of the held-out poses as
        in verdict.json. None if an effect is outside of the catalogue, because no model
        has that effect.

    References
    ----------
    .. [1] Wald, A., Tests of statistical hypotheses concerning several parameters when
       the number of observations is large, Transactions of the American Mathematical
       Society 54, 1943.
    .. [2] Dunn, O. J., Multiple comparisons among means, Journal of the American
       Statistical Association 56, 1961.
    """
    defects = truth["defects"]
    if any(defect["effect"].startswith(OUTSIDE) for defect in defects):
        return None
    if not defects:
        # Without an effect the declared model is the right one, and the verdict has its
        # errors.
        return _describe_outcome([], 1.0, verdict["heldout"]["declared"])
    case, held_out = read_cases(folder, robots_folder)
    noise = parse_noise(verdict).without_pose_error
    declared = fit_declared_model(case.model, case.observations, noise)
    selected: list[_ScoredCandidate] = []
    variants = 1
    for defect in defects:
        alternatives = _score_variants(
            declared, case, defect["effect"], defect["joints"]
        )
        if alternatives:
            variants *= len(alternatives)
            selected += max(alternatives, key=_sum_log_bayes_factors)
    fitted = fit_selected_effects(
        declared,
        case.observations,
        declared.noise,
        tuple(
            (scored.candidate, np.array(scored.shapes, float)) for scored in selected
        ),
    )
    candidates = [scored.candidate for scored in selected]
    p_value = min(variants * _compute_wald_p_value(fitted, candidates), 1.0)
    outside = find_extrapolated_poses(fitted, case, held_out)
    _, heldout, _ = compare_held_out_errors(
        [Step("oracle", "declared", fitted)], (case, held_out), outside, noise, seed
    )
    return _describe_outcome(candidates, p_value, to_document(heldout.declared))


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
) -> list[list[_ScoredCandidate]]:
    """Score the variants of an effect that the data can test, each of their candidates
    at its best shapes."""
    variants = list_variants(effect, joints, case.candidates.values())
    candidates = [candidate for variant in variants for candidate in variant]
    problem = build_candidate_design(
        declared, case.observations, candidates, Settings()
    ).problem
    best: dict[str, _ScoredCandidate] = {}
    _, log_bayes_factors = screen_terms(problem)
    for term, log_factor in zip(problem.terms, log_bayes_factors, strict=True):
        if term.candidate is None:
            continue
        key = term.candidate.key
        if key not in best or log_factor > best[key].log_bayes_factor:
            best[key] = _ScoredCandidate(log_factor, term.candidate, term.shapes)
    scored_variants = []
    for variant in variants:
        scored = [best[member.key] for member in variant if member.key in best]
        if scored:
            scored_variants.append(scored)
    return scored_variants


def _sum_log_bayes_factors(variant: Iterable[_ScoredCandidate]) -> float:
    return sum(scored.log_bayes_factor for scored in variant)


def _compute_wald_p_value(fitted: Fit, candidates: Sequence[Candidate]) -> float:
    """Compute the p-value of all coefficients at once, at the fitted shapes."""
    linear: list[int] = []
    shapes: list[int] = []
    for candidate in candidates:
        indices = fitted.parameter_indices(candidate.key).tolist()
        linear += indices[: len(candidate.parameters)]
        shapes += indices[len(candidate.parameters) :]
    identified = np.flatnonzero(~fitted.unidentifiable)
    tested = np.isin(identified, linear)
    if not tested.any():
        return 1.0
    values = np.concatenate(
        [fitted.effect_values(candidate.key)[0] for candidate in candidates]
    )[np.isin(linear, identified)]
    information = np.linalg.inv(fitted.covariance[np.ix_(identified, identified)])
    is_shape = np.isin(identified, shapes)
    covariance = np.linalg.inv(information[np.ix_(~is_shape, ~is_shape)])
    is_tested = tested[~is_shape]
    statistic = values @ np.linalg.solve(
        covariance[np.ix_(is_tested, is_tested)], values
    )
    return float(chi2.sf(statistic, tested.sum() + is_shape.sum()))


def _describe_outcome(
    candidates: Iterable[Candidate], p_value: float, heldout: Mapping[str, Any]
) -> dict[str, Any]:
    """Describe the result of the oracle as its file does."""
    return {
        "candidates": [candidate.key for candidate in candidates],
        "p_value": p_value,
        "detected": p_value < LEVEL,
        "heldout": heldout,
    }


def assess_sampled_case(
    plan: Plan, truth: Mapping[str, Any], robots_folder: str | Path
) -> dict[str, Any] | None:
    """Call `assess_best_analyst` if the case is in the sample that the plan asks for;
    return None for other cases."""
    fields = truth["case"]
    levels = tuple(fields["levels"])
    effects = tuple(fields["effects"])
    case = BlindCase(**fields | {"effects": effects, "levels": levels})
    sample = plan["limit"]
    draw = open_simulation_stream(case.seed, "sample of the limit").random()
    is_absorbed = any(defect["of"] == "raw" for defect in truth["defects"])
    is_compared = [case.group, *case.levels[:1]] in sample["of"]
    if draw >= 1 / sample["one_in"] or is_absorbed or not is_compared:
        return None
    return assess_best_analyst(plan, case, robots_folder)


def assess_best_analyst(
    plan: Plan, case: BlindCase, robots_folder: str | Path
) -> dict[str, Any]:
    """Find what the best analyst concludes from one case with one or two effects of the
    catalogue.

    Sets of mechanisms are equally probable a priori, and so are the locations of each
    set.

    Returns
    -------
    dict
        ``detected`` at the level of the diagnosis; ``mechanisms`` of the most probable
        set; their ``probability``; ``right``, whether they are the true ones.
    """
    robot = case.build_specimen(robots_folder)
    noncentrality = build_noncentrality_model(case, robot)
    defects = [sized.defect for sized in size_defects(case, noncentrality)]
    residual = noncentrality.compute_measured_residual(apply_defects(robot, defects))
    absent = find_absent_effects(plan, case.robot)
    possible = [effect for effect in CATALOGUE_EFFECTS if effect not in absent]
    located, units = draw_unit_signals(noncentrality, possible, case.seed)
    signals = units.reshape(len(residual), -1)
    gram = signals.T @ signals
    products = np.column_stack(
        [signals.T @ residual, _simulate_noise_products(gram, case.seed)]
    )
    sets, columns = _list_hypotheses(located, len(case.effects))
    log_factors = compute_log_bayes_factors(gram, products, columns, case.levels[0])
    return _choose_mechanisms(case, sets, log_factors)


def _choose_mechanisms(
    case: BlindCase, sets: np.ndarray, log_factors: np.ndarray
) -> dict[str, Any]:
    """Test for any defect, and choose the most probable set of mechanisms.

    `sets` (H, number of effects): mechanisms of each hypothesis. `log_factors` (H, 1 +
    null draws): log Bayes factors for the residual of the case, then for noise alone.
    """
    distinct, indices, locations = np.unique(
        sets, axis=0, return_inverse=True, return_counts=True
    )
    log_priors = -np.log(locations[indices] * len(distinct))
    log_weights = log_factors + log_priors[:, None]
    statistic = log_sum_exp(log_weights, axis=0)
    probability = np.bincount(indices, np.exp(log_weights[:, 0] - statistic[0]))
    best = int(np.argmax(probability))
    mechanisms = distinct[best].tolist()
    exceeding = int((statistic[1:] >= statistic[0]).sum())
    p_value = (1 + exceeding) / (1 + _NULL_DRAWS)
    return {
        "detected": p_value <= Settings().alarm_level,
        "mechanisms": mechanisms,
        "probability": float(probability[best]),
        "right": mechanisms == sorted(case.effects),
    }


def _simulate_noise_products(gram: np.ndarray, seed: int) -> np.ndarray:
    """Simulate the products of all signals with residuals of noise alone, (K, draws):
    normal, with the Gram matrix of the signals as their covariance."""
    values, vectors = np.linalg.eigh(gram)
    draws = open_simulation_stream(seed, "null distribution of the limit")
    normal = draws.standard_normal((len(gram), _NULL_DRAWS))
    products: np.ndarray = (vectors * np.sqrt(np.clip(values, 0.0, None))) @ normal
    return products


def draw_unit_signals(
    noncentrality: NoncentralityModel, kinds: Iterable[str], seed: int
) -> tuple[tuple[str, ...], np.ndarray]:
    """Draw defects of each kind at each of its locations, and scale their signals after
    absorption to length one.

    Parameters
    ----------
    noncentrality : NoncentralityModel
        Measure of signals, with the faultless robot.
    kinds : iterable of str
        Keys of `KINDS`.
    seed : int
        Seed of the draws.

    Returns
    -------
    tuple of str
        Kind of each location that has any signal.
    (M, locations, draws) array
        Signals.
    """
    robot = noncentrality.robot
    located = []
    units = []
    for kind in kinds:
        size = KINDS[kind].scale_plausible_size(robot.arm)
        for location in KINDS[kind].locations(robot.arm):
            draws = open_simulation_stream(seed, f"limit {kind} {location}")
            defects = [
                Defect(kind, location, size, int(detail_seed))
                for detail_seed in draws.integers(2**31, size=_DRAWS)
            ]
            visible_units = _compute_visible_units(noncentrality, defects)
            if len(visible_units):
                located.append(kind)
                # Gears without a signal are those whose torque stays below the one at
                # which they yield. The visible draws replace them.
                indices = np.resize(np.arange(len(visible_units)), _DRAWS)
                units.append(visible_units[indices].T)
    return tuple(located), np.stack(units, axis=1)


def _compute_visible_units(
    noncentrality: NoncentralityModel, defects: Iterable[Defect]
) -> np.ndarray:
    """Signals of defects after absorption, scaled to length one; one row for each defect
    of which enough is left."""
    projections = [
        noncentrality.project_change(apply_defects(noncentrality.robot, [defect]))
        for defect in defects
    ]
    signals = np.array([signal for signal, _ in projections])
    residuals = np.array([residual for _, residual in projections])
    lengths = np.linalg.norm(residuals, axis=1)
    visible = lengths**2 > _ABSORBED * np.linalg.norm(signals, axis=1) ** 2
    units: np.ndarray = residuals[visible] / lengths[visible, None]
    return units


def compute_log_bayes_factors(
    gram: np.ndarray, products: np.ndarray, columns: np.ndarray, level: float
) -> np.ndarray:
    """Compute log Bayes factors of normal residuals with signals against noise alone.

    Parameters
    ----------
    gram : (K, K) array
        Gram matrix of all signals, each of length one.
    products : (K, N) array
        Products of the signals with N residuals.
    columns : (H, m) array of int
        Signals of each hypothesis, the same number for each of its defects.
    level : float
        Mean square length of the signal of a defect.

    Returns
    -------
    (H, N) array
    """
    variance = level / _DRAWS
    log_factors = np.empty((len(columns), products.shape[1]))
    block_count = max(len(columns) // _HYPOTHESES_AT_ONCE, 1)
    for block in np.array_split(np.arange(len(columns)), block_count):
        signals = columns[block]
        covariance = (
            np.eye(signals.shape[1])
            + variance * gram[signals[:, :, None], signals[:, None, :]]
        )
        right = products[signals]
        gains = variance * (right * np.linalg.solve(covariance, right)).sum(axis=1)
        log_determinants = np.linalg.slogdet(covariance)[1][:, None]
        log_factors[block] = 0.5 * gains - 0.5 * log_determinants
    return log_factors


def _list_hypotheses(
    located: Sequence[str], count: int
) -> tuple[np.ndarray, np.ndarray]:
    """List sets of `count` different mechanisms, once for each combination of their
    locations, and the signals of each set."""
    signals = np.arange(len(located) * _DRAWS).reshape(-1, _DRAWS)
    chosen = np.array(list(combinations(range(len(located)), count)))
    sets = np.sort(np.array(located)[chosen], axis=1)
    distinct = [len(set(names)) == len(names) for names in sets]
    return sets[distinct], signals[chosen[distinct]].reshape(sum(distinct), -1)


def oracle_cases(job: Any) -> None:
    """Run the oracle and the best analyst on a block of diagnosed blind cases."""
    verdicts = {
        verdict["campaign"]: verdict for verdict in read_json(job.input.verdicts)
    }
    truths = load_ground_truth([job.input.sealed], job.input.manifest)
    robots = job.params.robots
    outcomes = {}
    for name, truth in truths.items():
        folder = f"{job.input.blind}/{name}"
        outcomes[name] = {
            "oracle": fit_oracle(
                truth, verdicts[name], folder, robots, job.params.seed
            ),
            "limit": assess_sampled_case(job.params.plan, truth, robots),
        }
    write_json(job.output.oracle, outcomes, allow_nan=False)
