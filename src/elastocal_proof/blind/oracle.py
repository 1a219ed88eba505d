"""The oracle and the limit: what the same fit does when it is given the effects, and
what the best analyst finds.

The oracle has all that the diagnosis has, and is given which effects of the catalogue
there are and at which joints; of their variants (axes, by time or by temperature) it
takes the one that the residual of the declared model speaks for.

The best analyst knows the plant's laws, how often each mechanism occurs, and how large
it is. Of each mechanism at each location some defects are drawn as the plant draws
them. With S (M, m) what their measurements show after absorption, each of the
non-centrality of the case, the residual under an unknown defect of that kind is taken
for normal with covariance I + S S'/m, and the most probable mechanism is the Bayes rule
of linear Gaussian models [1]. An alarm is the likelihood-ratio test of the average over
all of them, which no test exceeds on average [2], with its null distribution simulated.

[1] Bishop, C. M., Pattern Recognition and Machine Learning, chapter 3, Springer, 2006.
[2] Lehmann, E. L. and Romano, J. P., Testing Statistical Hypotheses, section 3.8,
Springer, 2005.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import chi2

from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.diagnose import Step
from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.judge import compare_held_out_errors
from elastocal.diagnosis.refit import fit_selected_effects
from elastocal.diagnosis.search import screen_terms
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.model import Case
from elastocal.fitting.noise import fit_declared_model, parse_noise
from elastocal.io.json_files import read_json, write_json
from elastocal.io.typed_json import to_document
from elastocal.loop.whole import read_cases
from elastocal.validation.transfer import find_extrapolated_poses
from elastocal_proof.blind.cases import (
    CATALOGUE_EFFECTS,
    build_yardstick,
    find_absent_effects,
    size_defects,
)
from elastocal_proof.blind.cases import BlindCase as BlindCase
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.plant.kinds import KINDS, OUTSIDE, Defect, apply_defects
from elastocal_proof.plant.simulated_robot import open_simulation_stream

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal_proof.blind.cases import Plan
    from elastocal_proof.plant.simulated_robot import SimulatedRobot
    from elastocal_proof.plant.sizing import NoncentralityModel

    _Chosen = tuple[float, Candidate, tuple[float, ...]]

LEVEL = 0.05
# Of each kind at each location: as many as its details have directions, within a factor
# of two.
_DRAWS = 8
# Of the null distribution.
_NULL_DRAWS = 2000
# Part of the squares of a signal below which the declared model absorbs it whatever its
# size.
_ABSORBED = 1e-4


def fit_oracle(
    truth: Mapping[str, Any],
    verdict: Mapping[str, Any],
    folder: str | Path,
    robots_folder: str | Path,
    seed: int,
) -> dict[str, Any] | None:
    """What knowing the effects is worth in one case, by its sealed document and its
    verdict, whose noise is used again.

    Returns ``candidates`` that the model was given; ``p_value`` of a Wald test [1] of
    all their coefficients at once (chi-squared, with the covariance of the fit at its
    shapes; a fitted shape counts as one more degree of freedom, and the p-value is
    multiplied by the number of variants, a Bonferroni correction [2]), 1 where these
    data identify none of them; ``detected`` at 5 %; ``heldout``, errors on the held-out
    poses as in verdict.json. None where an effect is outside of the catalogue: no model
    of it has that effect.

    [1] Wald, A., Tests of statistical hypotheses concerning several parameters when the number of observations is large,
        Transactions of the American Mathematical Society 54, 1943.
    [2] Dunn, O. J., Multiple comparisons among means, Journal of the American Statistical Association 56, 1961.
    """
    effects = [
        (defect["effect"], tuple(defect["joints"])) for defect in truth["defects"]
    ]
    if any(effect.startswith(OUTSIDE) for effect, _ in effects):
        return None
    if not effects:
        # Without an effect the declared model is the right one, and has been judged
        # already.
        return _outcome((), 1.0, verdict["heldout"]["before"])
    case, unseen = read_cases(folder, robots_folder)
    declared = fit_declared_model(
        case.model, case.observations, parse_noise(verdict).without_pose_error
    )
    fitted, members, variants = _with_effects(declared, case, effects)
    p_value = min(variants * _wald(fitted, members), 1.0)
    outside = find_extrapolated_poses(fitted, case, unseen)
    _, heldout, _ = compare_held_out_errors(
        [Step("oracle", "declared", fitted)], case, unseen, outside, seed
    )
    return _outcome(members, p_value, to_document(heldout.before))


def list_variants(
    effect: str, joints: Sequence[int], candidates: Iterable[Candidate]
) -> list[list[Candidate]]:
    """Candidates that an effect at some joints, from 1, consists of, for each of its
    variants; bands of orders are parts."""
    mine = [
        c
        for c in candidates
        if c.effect == effect
        and bool(c.joints) == bool(joints)
        and set(c.joints) <= set(joints)
    ]
    return [mine] * bool(mine) if joints else [[candidate] for candidate in mine]


def _with_effects(
    declared: Fit, case: Case, effects: Iterable[tuple[str, tuple[int, ...]]]
) -> tuple[Fit, tuple[Candidate, ...], int]:
    """Fit with the effects, their candidates, and among how many variants these were
    chosen."""
    chosen: list[_Chosen] = []
    variants = 1
    settings = Settings()
    for effect, joints in effects:
        listed = [
            member
            for members in list_variants(effect, joints, case.candidates.values())
            for member in members
        ]
        problem = build_candidate_design(
            declared, case.observations, listed, settings
        ).problem
        factors = screen_terms(problem)[1]
        # Each at the shape that fits best.
        best: dict[str, _Chosen] = {}
        for number, unit in enumerate(problem.terms):
            if (
                unit.candidate
                and factors[number] > best.get(unit.candidate.key, (-np.inf,))[0]
            ):
                best[unit.candidate.key] = factors[number], unit.candidate, unit.shapes
        alternatives = [
            [best[m.key] for m in members if m.key in best]
            for members in list_variants(effect, joints, listed)
        ]
        alternatives = [members for members in alternatives if members]
        if alternatives:
            variants *= len(alternatives)
            chosen += max(
                alternatives,
                key=lambda members: sum(factor for factor, _, _ in members),
            )
    members = tuple(candidate for _, candidate, _ in chosen)
    effects_at = tuple(
        (candidate, np.array(shapes, float)) for _, candidate, shapes in chosen
    )
    return (
        fit_selected_effects(declared, case.observations, declared.noise, effects_at),
        members,
        variants,
    )


def _wald(fitted: Fit, members: Sequence[Candidate]) -> float:
    """Of all coefficients at once, given the shapes."""
    places = [
        np.split(fitted.parameter_indices(member.key), [len(member.parameters)])
        for member in members
    ]
    linear, shapes = (
        np.concatenate([place[part] for place in places] or [np.empty(0)])
        for part in (0, 1)
    )
    free = np.flatnonzero(~fitted.unidentifiable)
    tested = np.isin(free, linear)
    kept = ~np.isin(free, shapes)
    if not tested.any():
        return 1.0
    values = np.concatenate(
        [fitted.effect_values(member.key)[0] for member in members]
    )[np.isin(linear, free)]
    information = np.linalg.inv(fitted.covariance[np.ix_(free, free)])
    covariance = np.linalg.inv(information[np.ix_(kept, kept)])[
        np.ix_(tested[kept], tested[kept])
    ]
    return float(
        chi2.sf(
            values @ np.linalg.solve(covariance, values), tested.sum() + (~kept).sum()
        )
    )


def _outcome(
    members: Iterable[Candidate], p_value: float, heldout: Mapping[str, Any]
) -> dict[str, Any]:
    keys = [member.key for member in members]
    return {
        "candidates": keys,
        "p_value": p_value,
        "detected": p_value < LEVEL,
        "heldout": heldout,
    }


def assess_sampled_case(
    plan: Plan, truth: Mapping[str, Any], robots_folder: str | Path
) -> dict[str, Any] | None:
    """As `limit`, of a case that is in the sample; None of others."""
    stated = truth["case"]
    asked = plan["limit"]
    case = BlindCase(
        **stated | {name: tuple(stated[name]) for name in ("effects", "levels")}
    )
    drawn = (
        open_simulation_stream(case.seed, "sample of the limit").random()
        < 1 / asked["one_in"]
    )
    absorbed = any(defect["of"] == "raw" for defect in truth["defects"])
    compared = [case.group, *case.levels[:1]] in asked["of"]
    return (
        assess_best_analyst(plan, case, robots_folder)
        if drawn and compared and not absorbed
        else None
    )


def assess_best_analyst(
    plan: Plan, case: BlindCase, robots_folder: str | Path
) -> dict[str, Any]:
    """What the best analyst says of one case with one effect of the catalogue, or with
    two.

    Returns ``detected`` at the level of the diagnosis, ``mechanisms`` that are most
    probable, their ``probability``, ``right``. Sets of mechanisms are equally probable,
    and so are the locations of each.
    """
    robot = case.specimen(robots_folder)
    yardstick = build_yardstick(case, robot)
    bad = apply_defects(
        robot, [defect for defect, _ in size_defects(case, robot, yardstick)]
    )
    kinds = [
        kind
        for kind in CATALOGUE_EFFECTS
        if kind not in find_absent_effects(plan, case.robot)
    ]
    located, units = draw_unit_signals(yardstick, robot, kinds, case.seed)
    sets, columns = _hypotheses(located, len(case.effects))
    residual = yardstick.compute_measured_residual(bad)
    flat = units.reshape(len(residual), -1)
    gram = flat.T @ flat
    along = flat.T @ residual
    draws = open_simulation_stream(case.seed, "null distribution of the limit")
    # Of noise alone, the products with all signals.
    values, vectors = np.linalg.eigh(gram)
    noise = (vectors * np.sqrt(np.clip(values, 0.0, None))) @ draws.standard_normal(
        (len(gram), _NULL_DRAWS)
    )
    names, number, count = np.unique(
        sets, axis=0, return_inverse=True, return_counts=True
    )
    shares = -np.log(count[number] * len(names))
    factors = (
        compute_log_bayes_factors(
            gram, np.column_stack([along, noise]), columns, case.levels[0]
        )
        + shares[:, None]
    )
    statistic = log_sum_exp(factors, axis=0)
    probability = np.bincount(number, np.exp(factors[:, 0] - statistic[0]))
    best = int(np.argmax(probability))
    exceeding = int((statistic[1:] >= statistic[0]).sum())
    return {
        "detected": (1 + exceeding) / (1 + _NULL_DRAWS) <= Settings().alarm_level,
        "mechanisms": names[best].tolist(),
        "probability": float(probability[best]),
        "right": names[best].tolist() == sorted(case.effects),
    }


def draw_unit_signals(
    yardstick: NoncentralityModel,
    robot: SimulatedRobot,
    kinds: Iterable[str],
    seed: int,
) -> tuple[tuple[str, ...], np.ndarray]:
    """What drawn defects of each kind show at each of its locations.

    Returns the kind of each location that anything can be seen of, and (M, locations,
    draws) of length one, after absorption.
    """
    named = []
    units = []
    for kind in kinds:
        size = KINDS[kind].scale_plausible_size(robot.arm)
        for location in KINDS[kind].locations(robot.arm):
            drawn = open_simulation_stream(seed, f"limit {kind} {location}").integers(
                2**31, size=_DRAWS
            )
            shown = [
                apply_defects(robot, [Defect(kind, location, size, int(number))])
                for number in drawn
            ]
            seen, left = zip(
                *(yardstick.project_change(one) for one in shown), strict=True
            )
            remaining = np.linalg.norm(left, axis=1)
            visible = remaining**2 > _ABSORBED * np.linalg.norm(seen, axis=1) ** 2
            if visible.any():
                named.append(kind)
                # Gears that no torque of this campaign brings to where they yield show
                # nothing: the others stand for these.
                some = np.resize(np.flatnonzero(visible), _DRAWS)
                units.append((np.array(left)[some] / remaining[some, None]).T)
    return tuple(named), np.stack(units, axis=1)


def compute_log_bayes_factors(
    gram: np.ndarray, along: np.ndarray, columns: np.ndarray, level: float
) -> np.ndarray:
    """Log Bayes factors (H, N) against nothing of normal vectors with the second
    moments of some columns.

    `gram` (K, K): of all columns, of length one. `along` (K, N): products with N
    residuals. `columns` (H, m) of int: of each hypothesis, as many for each of its
    defects. `level`: mean square length of what a defect shows.
    """
    share = level / _DRAWS
    found = np.empty((len(columns), along.shape[1]))
    for part in np.array_split(np.arange(len(columns)), max(len(columns) // 1000, 1)):
        at = columns[part]
        inner = np.eye(at.shape[1]) + share * gram[at[:, :, None], at[:, None, :]]
        mine = along[at]
        gains = share * (mine * np.linalg.solve(inner, mine)).sum(axis=1)
        found[part] = 0.5 * gains - 0.5 * np.linalg.slogdet(inner)[1][:, None]
    return found


def _hypotheses(located: Sequence[str], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Sets of as many mechanisms, one for each location of each, and the columns of
    each."""
    locations = np.arange(len(located) * _DRAWS).reshape(-1, _DRAWS)
    chosen = np.array(list(combinations(range(len(located)), count)))
    sets = np.sort(np.array(located)[chosen], axis=1)
    distinct = [len(set(names)) == len(names) for names in sets]
    return sets[distinct], locations[chosen[distinct]].reshape(sum(distinct), -1)


def oracle_cases(job: Any) -> None:
    """What the oracle and the best analyst do on a block of blind cases, once they are
    diagnosed."""
    verdicts = {
        verdict["campaign"]: verdict for verdict in read_json(job.input.verdicts)
    }
    robots = job.params.robots
    found = {}
    for name, truth in load_ground_truth(
        [job.input.sealed], job.input.manifest
    ).items():
        informed = fit_oracle(
            truth, verdicts[name], f"{job.input.blind}/{name}", robots, job.params.seed
        )
        found[name] = {
            "oracle": informed,
            "limit": assess_sampled_case(job.params.plan, truth, robots),
        }
    write_json(job.output.oracle, found, allow_nan=False)
