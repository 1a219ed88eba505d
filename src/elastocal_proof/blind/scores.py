"""Scores of the verdict on a blind case, given its ground truth: one row for each case,
and the intervals of its parameters.

The figures of the plan are counted from these rows; see `summary`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import norm
from scipy.stats import t as t_distribution
from statsmodels.stats.proportion import proportion_confint

from elastocal.diagnosis.verdict import ADEQUATE, CLASS, NAMED, NOT_TESTABLE, SEVERAL
from elastocal.effects.protocol import effect_of
from elastocal_proof.blind.cases import Plan, find_absent_effects
from elastocal_proof.plant.kinds import OUTSIDE

# A sealed document, or a part of it or of verdict.json.
Document = Mapping[str, Any]

NONE = "none"
# Name that a diagnosis gives mechanisms outside of the catalogue.
OTHER = "other"
COMPLIANCE = "joint_compliance"
# Effect by which a diagnosis says that the base is not where it is declared.
_MISPLACED_BASE = "base_placement"
# A scale of the forces is an alias of the compliances. With weights that are known to a
# tenth, almost nothing of it is identifiable.
_FORCE_SCALE = "force_scale"
# Effects that lie within the span of another effect or of the joint compliances, by
# effect and joints of the ground truth, with the mechanism from which they are
# not distinguishable. Other aliases are resolved by a known frame, known targets and points at the
# elbow and the wrist: offset of joint 1 and base, last link and tool, tilt of joint 1
# and base, coupling of joints 2 and 3 and upper arm.
EXACT_ALIASES: dict[tuple[str, tuple[int, ...]], str] = {
    (_FORCE_SCALE, ()): COMPLIANCE,
    ("compensator_torque", (2,)): "transmission_harmonic",
    ("transmission_harmonic", (2,)): "compensator_torque",
    ("link_weight", (2,)): "compensator_torque",
}
# Results of a case without an oracle.
_NO_ORACLE: Document = {
    "detected": np.nan,
    "alternatives": None,
    "heldout": {"rms_m": np.nan},
}
# Errors got worse if their increase is beyond this many standard errors.
_STD_ERRORS = 2.0
# Probability of a credible set.
_CREDIBLE = 0.95


def compute_rate(
    hits: Iterable[bool], clusters: Iterable[Any] | None = None
) -> dict[str, float]:
    """Compute a share with its Clopper-Pearson interval [1]_ of 95 %.

    Outcomes of one cluster, such as the parameters of one campaign or the cases of one
    effect, resemble each other. With clusters the interval is therefore that of the
    effective number of cases [2]_. Without cases the share is not a number and the
    interval is [0, 1].

    Parameters
    ----------
    hits : iterable of bool
        Outcomes.
    clusters : iterable, optional
        Cluster of each outcome; without them all outcomes are independent.

    References
    ----------
    .. [1] Clopper, C. J. and Pearson, E. S., The use of confidence or fiducial limits
       illustrated in the case of the binomial, Biometrika 26, 1934.
    .. [2] Korn, E. L. and Graubard, B. I., Confidence intervals for proportions with
       small expected number of positive counts estimated from survey data, Survey
       Methodology 24, 1998.
    """
    outcomes = np.array([bool(hit) for hit in hits])
    cases = len(outcomes)
    if not cases:
        return {"hits": 0, "cases": 0, "rate": np.nan, "low": 0.0, "high": 1.0}
    count = int(outcomes.sum())
    effective_cases = float(cases)
    if clusters is not None:
        effective_cases = _count_effective_cases(outcomes, list(clusters))
    rate = count / cases
    low, high = proportion_confint(
        rate * effective_cases, effective_cases, 0.05, "beta"
    )
    return {
        "hits": count,
        "cases": cases,
        "rate": rate,
        "low": 0.0 if count == 0 else float(low),
        "high": 1.0 if count == cases else float(high),
    }


def _count_effective_cases(outcomes: np.ndarray, clusters: Sequence[Any]) -> float:
    """Number of independent outcomes whose share is as uncertain as that of outcomes in
    clusters, at most the number of outcomes.

    The variance is that between the sums of the clusters. If all outcomes are equal, it
    cannot be estimated, and each cluster counts once.
    """
    cases = len(outcomes)
    rate = outcomes.mean()
    indices = np.unique(np.array(clusters, str), return_inverse=True)[1]
    deviations = np.bincount(indices, outcomes - rate)
    count = len(deviations)
    if count == 1 or rate in (0.0, 1.0):
        return float(count)
    variance = count / (count - 1) * (deviations @ deviations) / cases**2
    if variance == 0.0:
        return float(cases)
    # The variance is estimated from few clusters, which widens the interval.
    of_cases = float(t_distribution.ppf(0.975, cases - 1))
    of_clusters = float(t_distribution.ppf(0.975, count - 1))
    correction = (of_cases / of_clusters) ** 2
    return float(min(cases, correction * rate * (1.0 - rate) / variance))


def build_case_row(
    plan: Plan,
    truth: Document,
    verdict: Document,
    oracle: Document | None = None,
) -> dict[str, Any]:
    """Build one row of cases.csv.

    Parameters
    ----------
    plan : mapping
        Contents of config/blind.yaml.
    truth, verdict : mapping
        Sealed document of a case, and its verdict as in verdict.json.
    oracle : mapping, optional
        Result of `oracle.fit_oracle`.

    Returns
    -------
    dict
        Besides facts of the case and of its verdict: ``exact``, the names of the
        verdict are the true ones; ``named_right``, so and the verdict states no other
        name; ``located``, so and every effect that acts at joints has the true joints;
        ``holds_truth``, the verdict has as many effects as the truth, and each
        true one is the name or an alternative of a different effect of the verdict;
        ``wrong_name``, a single wrong name is stated; ``false_mechanism``, the verdict
        has an effect for which it names no true mechanism; ``remains``, a repeatable
        residual is reported; ``exact_alias``, the effect lies within the span of
        another effect that the robot can have, by the ground truth alone;
        ``distinguishable``, the oracle detects the effect and excludes every other
        mechanism.
    """
    case = truth["case"]
    defects = truth["defects"]
    kind, effects = _remove_setup_effects(truth, verdict)
    names = [effect["name"] for effect in effects]
    true_names = list(case["effects"])
    claims = bool(true_names) and kind in (NAMED, CLASS, SEVERAL)
    exact = claims and sorted(names) == sorted(true_names)
    repeatable = verdict["repeatable"]
    joints = ["-".join(map(str, defect["joints"])) for defect in defects]
    aliases = {
        EXACT_ALIASES.get((defect["effect"], tuple(defect["joints"])))
        for defect in defects
    }
    return {
        "case": truth["campaign"],
        "group": case["group"],
        "robot": case["robot"],
        "robots": case["robots"],
        "setting": case["setting"],
        "hard": bool(plan["settings"][case["setting"]].get("hard")),
        "truth": _join(true_names),
        "level": max(case["levels"], default=0.0),
        "verdict": kind,
        "found": _join(names),
        "detected": kind not in (ADEQUATE, NOT_TESTABLE),
        "exact": exact,
        "named_right": exact and kind == NAMED,
        "located": exact and kind == NAMED and _has_true_joints(truth, effects),
        "holds_truth": claims and _can_match(true_names, effects),
        "wrong_name": kind == NAMED and names != true_names,
        "false_mechanism": kind in (NAMED, CLASS, SEVERAL)
        and any(_list_names(effect).isdisjoint(true_names) for effect in effects),
        "remains": bool(repeatable and repeatable["remains"]),
        "joints": " + ".join(joints),
        "exact_alias": bool(
            aliases - {None, *find_absent_effects(plan, case["robot"])}
        ),
        **_describe_size(truth),
        **_describe_errors(verdict),
        **_describe_oracle(oracle or _NO_ORACLE),
        **score_probabilities(truth, verdict, _find_hidden_effects(plan, case)),
    }


def _join(names: Iterable[str]) -> str:
    return " + ".join(names) or NONE


def _list_names(effect: Document) -> set[str]:
    """Mechanisms that a verdict states for one effect: its name and alternatives."""
    return {effect["name"], *map(effect_of, effect["alternatives"])}


def _has_true_joints(truth: Document, effects: Iterable[Document]) -> bool:
    """Check whether each effect of a verdict is at the true joints, if the mechanism
    acts at joints."""
    true_joints: dict[str, set[int]] = {}
    for defect in truth["defects"]:
        true_joints.setdefault(defect["effect"], set()).update(defect["joints"])
    return all(
        set(effect["joints"]) == true_joints[effect["name"]]
        for effect in effects
        if true_joints[effect["name"]]
    )


def _can_match(true_names: list[str], effects: list[Document]) -> bool:
    """Check whether each true name can be assigned to an effect of its own that has it
    as its name or among its alternatives, by the Hungarian method [1]_.

    References
    ----------
    .. [1] Kuhn, H. W., The Hungarian method for the assignment problem, Naval Research
       Logistics Quarterly 2, 1955.
    """
    if len(true_names) != len(effects):
        return False
    cost = np.ones((len(effects), len(true_names)))
    for effect, row in zip(effects, cost, strict=True):
        possible = _list_names(effect)
        row[[name in possible for name in true_names]] = 0.0
    return not cost[linear_sum_assignment(cost)].any()


def _find_setup_mechanisms(truth: Document) -> set[str]:
    """Find the mechanisms of the set-up that a case has in addition to its effects.
    Reporting them is correct, and not reporting them is no error."""
    return {_MISPLACED_BASE} if "misplaced" in truth else set()


def _remove_setup_effects(
    truth: Document, verdict: Document
) -> tuple[str, list[Document]]:
    """Return the kind of the verdict and its effects without those of the set-up."""
    effects = list(verdict["effects"])
    setup = _find_setup_mechanisms(truth)
    remaining = [effect for effect in effects if effect["name"] not in setup]
    if len(remaining) == len(effects):
        return verdict["verdict"], effects
    if not remaining:
        return ADEQUATE, remaining
    if len(remaining) > 1:
        return SEVERAL, remaining
    return CLASS if remaining[0]["alternatives"] else NAMED, remaining


def _describe_size(truth: Document) -> dict[str, Any]:
    """Describe how large the effects are; the squares of several effects add up."""
    defects = truth["defects"]
    by_raw = any(defect["of"] == "raw" for defect in defects)
    return {
        # The non-centrality that all levels of these effects refer to.
        "level_of": "raw" if by_raw else "retained",
        # Effects that the model absorbs at any size are not counted by level.
        "absorbed": by_raw
        or [defect["effect"] for defect in defects] == [_FORCE_SCALE],
        "raw": sum(defect["signal"]["raw"] for defect in defects),
        "retained": sum(defect["signal"]["retained"] for defect in defects),
    }


def _describe_errors(verdict: Document) -> dict[str, Any]:
    """Describe the held-out errors, and whether an effect was adopted although they grew
    by more than chance."""
    heldout = verdict["heldout"]
    if not heldout:
        # A fault of the data ends a diagnosis before any model is fitted.
        return {
            "before_rms_m": np.nan,
            "after_rms_m": np.nan,
            "adopted": False,
            "worse": False,
        }
    declared = heldout["declared"]["rms_m"]
    after = heldout["after"]["rms_m"]
    std_error = heldout["reduction_std_error"]
    return {
        "before_rms_m": declared,
        "after_rms_m": after,
        "adopted": any(effect["adopted"] for effect in verdict["effects"]),
        "worse": bool(1.0 - after / declared + _STD_ERRORS * std_error < 0.0),
    }


def _describe_oracle(oracle: Document) -> dict[str, Any]:
    """Describe what the oracle detects, and which other mechanisms it cannot exclude."""
    alternatives = oracle["alternatives"]
    return {
        "oracle_detected": float(oracle["detected"]),
        "oracle_rms_m": oracle["heldout"]["rms_m"],
        "distinguishable": alternatives == [],
        "oracle_alternatives": " + ".join(alternatives or ()),
    }


def _find_hidden_effects(plan: Plan, case: Document) -> Collection[str]:
    """Find the effects that no analyst of a case can test, because its setting omits the
    covariates that their laws need."""
    hidden: Collection[str] = plan["settings"][case["setting"]].get("hides", ())
    return hidden


def score_probabilities(
    truth: Document, verdict: Document, hidden: Collection[str] = ()
) -> dict[str, Any]:
    """Compare the stated probabilities with the truth.

    A hypothesis is a set of mechanisms, as in verdict.json; the empty set is "nothing".

    Parameters
    ----------
    truth, verdict : mapping
        As of `build_case_row`.
    hidden : collection of str
        Effects that cannot be tested in this case.

    Returns
    -------
    dict
        ``stated``, probability of the most probable set; ``top``, this set;
        ``correct``, whether it is the true one; ``held``, whether the true one is in
        the smallest set of hypotheses that reaches 95 %, or in all of them if they do
        not reach it. All are not a number if nothing was stated, as with faulty data.
    """
    probabilities = verdict["probabilities"]
    hypotheses = probabilities["sets"] if probabilities else []
    ranked = sorted(hypotheses, key=lambda hypothesis: -hypothesis["probability"])
    if not ranked:
        return dict.fromkeys(("stated", "top", "correct", "held"), np.nan)
    cumulated = np.cumsum([hypothesis["probability"] for hypothesis in ranked])
    credible = ranked[: int(np.searchsorted(cumulated, _CREDIBLE)) + 1]
    top = ranked[0]
    return {
        "stated": top["probability"],
        "top": _join(sorted(top["mechanisms"])),
        "correct": is_true(top["mechanisms"], truth, hidden),
        "held": any(
            is_true(hypothesis["mechanisms"], truth, hidden) for hypothesis in credible
        ),
    }


def is_true(
    mechanisms: Collection[str], truth: Document, hidden: Collection[str] = ()
) -> bool:
    """Check whether a set of mechanisms is the true one of a case.

    If the true mechanism is not in the catalogue, or if the case does not allow to test it
    (`hidden`), every set with "other" is true, because no set can name it. A
    mechanism that the joint compliances absorb at any size counts as nothing, because
    no measurement can distinguish the two.
    """
    effects = truth["case"]["effects"]
    if any(effect.startswith(OUTSIDE) or effect in hidden for effect in effects):
        return OTHER in mechanisms
    absorbed = {
        defect["effect"] for defect in truth["defects"] if defect["of"] == "raw"
    }
    setup = _find_setup_mechanisms(truth)
    return set(mechanisms) - setup == set(effects) - absorbed


class _Estimate(NamedTuple):
    """An estimated parameter that has a true value."""

    effect: str
    parameter: str
    true: float
    value: float
    std_error: float


def list_intervals(truth: Document, verdict: Document) -> list[dict[str, Any]]:
    """List the 95 % intervals of a verdict for which there is a true value.

    These are Wald intervals of the joint compliances, and of the parameters of effects
    that were found at the right joints. Their quantiles are those of Student's t if the
    noise has degrees of freedom. A parameter that the data do not identify has no
    interval, and cases of unusual settings have none either.
    """
    case = truth["case"]
    if case["setting"] != "usual":
        return []
    degrees_of_freedom = verdict["noise"]["degrees_of_freedom"]
    width = norm.ppf(0.975)
    if degrees_of_freedom:
        width = t_distribution.ppf(0.975, degrees_of_freedom)
    compliances = verdict["compliance_urad_per_Nm"]
    values = zip(
        truth["compliance_urad_per_Nm"],
        compliances["after"],
        compliances["std_error"],
        strict=True,
    )
    estimates = [
        _Estimate(COMPLIANCE, f"c{joint}", true, value, std_error)
        for joint, (true, value, std_error) in enumerate(values, 1)
        if std_error > 0
    ]
    for defect, effect in product(truth["defects"], verdict["effects"]):
        if effect["name"] == defect["effect"]:
            estimates += _list_comparable_parameters(defect, effect)
    facts = {
        "case": truth["campaign"],
        "truth": _join(case["effects"]),
        "foreign": any(effect.startswith(OUTSIDE) for effect in case["effects"]),
        "level": max(case["levels"], default=0.0),
    }
    rows = []
    for estimate in estimates:
        error = abs(estimate.value - estimate.true)
        holds = bool(error <= width * estimate.std_error)
        rows.append(facts | estimate._asdict() | {"holds": holds})
    return rows


def _list_comparable_parameters(defect: Document, effect: Document) -> list[_Estimate]:
    """List the parameters of an effect at the true joints that the law of the simulated
    robot has too."""
    true_values = defect["parameters"]
    true_location = "+".join(map(str, defect["joints"]))
    estimates = []
    for parameter in effect["parameters"]:
        # The key of a candidate is such as ``cross_compliance@2+5[variant]``.
        key, _, name = parameter["name"].rpartition(" ")
        location = key.partition("[")[0].partition("@")[2]
        if location == true_location and name in true_values and not parameter["held"]:
            estimates.append(
                _Estimate(
                    defect["effect"],
                    name,
                    true_values[name],
                    parameter["value"],
                    parameter["std_error"],
                )
            )
    return estimates
