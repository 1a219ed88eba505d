"""What the verdict on a case is worth, given its ground truth: one row a case, and its
intervals of parameters.

Everything is counted from these rows, by the figures of the plan; see `summary`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import norm
from scipy.stats import t as t_distribution
from statsmodels.stats.proportion import proportion_confint

from elastocal.diagnosis.verdict import ADEQUATE, CLASS, NAMED, NOT_TESTABLE, SEVERAL
from elastocal.effects.protocol import effect_of
from elastocal_proof.blind.cases import Plan, find_absent_effects
from elastocal_proof.plant.kinds import OUTSIDE

Document = Mapping[str, Any]

NONE = "none"
# What a diagnosis calls mechanisms that the catalogue does not have.
OTHER = "other"
COMPLIANCE = "joint_compliance"
# The effect by which a diagnosis says that the base is not where it is declared.
_MISPLACED = "base_placement"
# A scale of the forces is an alias of the compliances, of which weights that are known
# to a tenth leave next to nothing.
_SCALE = "force_scale"
# Effects that lie wholly within another effect or the joint compliances, by effect and
# joints of the ground truth, with what it is not distinguishable from. Left out are
# aliases that a known frame, known targets and points at the elbow and wrist resolve:
# offset of joint 1 and base, last link and tool, tilt of joint 1 and base, coupling of
# joints 2 and 3 and upper arm.
EXACT_ALIASES: dict[tuple[str, tuple[int, ...]], str] = {
    (_SCALE, ()): COMPLIANCE,
    ("compensator_torque", (2,)): "transmission_harmonic",
    ("transmission_harmonic", (2,)): "compensator_torque",
    ("link_weight", (2,)): "compensator_torque",
}
_STD_ERRORS = 2.0
_CREDIBLE = 0.95


def compute_rate(hits: Iterable[bool]) -> dict[str, float]:
    """A share with its Clopper-Pearson interval [1] of 95 %; without cases not a
    number, and the interval all there is.

    [1] Clopper, C. J. and Pearson, E. S., The use of confidence or fiducial limits illustrated in the case of the binomial,
        Biometrika 26, 1934.
    """
    hits = [bool(hit) for hit in hits]
    count = sum(hits)
    cases = len(hits)
    low, high = proportion_confint(count, cases, 0.05, "beta") if cases else (0.0, 1.0)
    share = count / cases if cases else float("nan")
    low = 0.0 if count == 0 else float(low)
    high = 1.0 if count == cases else float(high)
    return {"hits": count, "cases": cases, "rate": share, "low": low, "high": high}


def build_case_row(
    plan: Plan,
    truth: Document,
    verdict: Document,
    oracle: Document | None = None,
    limit: Document | None = None,
) -> dict[str, Any]:
    """One row of cases.csv: where a case belongs, what was true and found, sizes,
    errors that were left, what was stated.

    `truth`: a sealed document. `verdict`: as verdict.json. `oracle`, `limit`: of
    `oracle.fit_oracle` and `limit.limit`, where the case has one. ``exact``: the names
    found are the true ones; ``named_right``: so, and the verdict states no other name
    beside it; ``holds_truth``: as many effects were found as were made, and each true
    one is the name of another of them or among its alternatives, which is an assignment
    problem [1]; ``wrong_name``: one wrong name is stated alone; ``remains``: something
    repeatable is said to remain; ``exact_alias``: within another effect that the robot
    can have, by the ground truth alone.

    [1] Kuhn, H. W., The Hungarian method for the assignment problem, Naval Research
    Logistics Quarterly 2, 1955.
    """
    case, defects, (kind, effects) = (
        truth["case"],
        truth["defects"],
        _apart_from_setup(truth, verdict),
    )
    names = [effect["name"] for effect in effects]
    true = list(case["effects"])
    claims = bool(true) and kind in (NAMED, CLASS, SEVERAL)
    right = claims and sorted(names) == sorted(true)
    meant = [
        {effect["name"], *map(effect_of, effect["alternatives"])} for effect in effects
    ]
    held = np.array([[name in each for each in meant] for name in true], bool)
    aliases = [
        EXACT_ALIASES.get((defect["effect"], tuple(defect["joints"])))
        for defect in defects
    ]
    return (
        {
            "case": truth["campaign"],
            "group": case["group"],
            "robot": case["robot"],
            "robots": case["robots"],
            "setting": case["setting"],
            "truth": " + ".join(true) or NONE,
            "level": max(case["levels"], default=0.0),
            "verdict": kind,
            "found": " + ".join(names) or NONE,
            "detected": kind not in (ADEQUATE, NOT_TESTABLE),
            "exact": right,
            "named_right": right and kind == NAMED,
            "holds_truth": claims
            and len(true) == len(names)
            and bool(held[linear_sum_assignment(~held)].all()),
            "wrong_name": kind == NAMED and names != true,
            "remains": bool((verdict.get("repeatable") or {}).get("remains")),
            "joints": " + ".join(
                "-".join(map(str, defect["joints"])) for defect in defects
            ),
            "exact_alias": any(
                alias and alias not in find_absent_effects(plan, case["robot"])
                for alias in aliases
            ),
        }
        | _size(truth)
        | _errors(verdict)
        | {
            "oracle_detected": np.nan if oracle is None else float(oracle["detected"]),
            "oracle_rms_m": np.nan if oracle is None else oracle["heldout"]["rms_m"],
        }
        | {
            f"limit_{name}": np.nan if limit is None else float(limit[name])
            for name in ("detected", "right")
        }
        | score_probabilities(truth, verdict)
    )


def _wrong_setup(truth: Document) -> set[str]:
    """Mechanisms of the set-up that a case has beside what it is about: right to find,
    and no fault not to name."""
    return {_MISPLACED} if "misplaced" in truth else set()


def _apart_from_setup(truth: Document, verdict: Document) -> tuple[str, list[Document]]:
    """Verdict and effects without those of the set-up."""
    kind = verdict["verdict"]
    effects = list(verdict["effects"])
    kept = [effect for effect in effects if effect["name"] not in _wrong_setup(truth)]
    if len(kept) == len(effects):
        return kind, effects
    one = CLASS if kept and kept[0]["alternatives"] else NAMED
    return (ADEQUATE, one, SEVERAL)[min(len(kept), 2)], kept


def _size(truth: Document) -> dict[str, Any]:
    """How large the effects are; for several the squares add up."""
    defects = truth["defects"]
    by_raw = any(defect["of"] == "raw" for defect in truth["defects"])
    return {
        # Of what all these effects' levels are the non-centrality.
        "level_of": "raw" if by_raw else "retained",
        # What the model absorbs whatever its size is no question of level.
        "absorbed": by_raw or [defect["effect"] for defect in defects] == [_SCALE],
        "raw": sum(defect["signal"]["raw"] for defect in defects),
        "retained": sum(defect["signal"]["retained"] for defect in defects),
    }


def _errors(verdict: Document) -> dict[str, Any]:
    """Held-out errors, and whether they got worse by more than chance with an effect
    that was adopted."""
    # A fault of the data ends a diagnosis before any model is fitted.
    held = verdict["heldout"] or {
        "before": {"rms_m": np.nan},
        "after": {"rms_m": np.nan},
    }
    before = held["before"]["rms_m"]
    after = held["after"]["rms_m"]
    return {
        "before_rms_m": before,
        "after_rms_m": after,
        "adopted": bool(verdict["heldout"])
        and any(effect.get("adopted", False) for effect in verdict["effects"]),
        "worse": bool(
            1.0 - after / before + _STD_ERRORS * held.get("reduction_std_error", np.nan)
            < 0.0
        ),
    }


def score_probabilities(truth: Document, verdict: Document) -> dict[str, Any]:
    """What was stated of a case in probabilities, and whether it is so; not a number
    where nothing was, as with faulty data.

    A hypothesis is a set of mechanisms, as in ``verdict.json``; the empty set is
    "nothing". ``stated``: probability of the most probable set, ``top``; ``correct``:
    whether that is the true one; ``held``: whether the smallest set of hypotheses that
    reaches 95 %, or all of them where they do not, holds the true one.
    """
    ranked = sorted(
        (verdict.get("probabilities") or {"sets": []})["sets"],
        key=lambda entry: -entry["probability"],
    )
    if not ranked:
        return dict.fromkeys(("stated", "top", "correct", "held"), np.nan)
    reached = np.cumsum([entry["probability"] for entry in ranked])
    top = ranked[0]
    believed = ranked[: int(np.searchsorted(reached, _CREDIBLE)) + 1]
    return {
        "stated": top["probability"],
        "top": " + ".join(sorted(top["mechanisms"])) or NONE,
        "correct": is_true(top["mechanisms"], truth),
        "held": any(is_true(entry["mechanisms"], truth) for entry in believed),
    }


def is_true(mechanisms: Collection[str], truth: Document) -> bool:
    """Whether a set of mechanisms is what is true of a case.

    Of a mechanism that the catalogue does not have every set that holds "other" is
    true; one that the joint compliances absorb at any size is as good as nothing, and
    no measurement could distinguish the two.
    """
    effects = truth["case"]["effects"]
    if any(effect.startswith(OUTSIDE) for effect in effects):
        return OTHER in mechanisms
    absorbed = {
        defect["effect"] for defect in truth["defects"] if defect["of"] == "raw"
    }
    return set(mechanisms) - _wrong_setup(truth) == set(effects) - absorbed


def list_intervals(
    plan: Plan, truth: Document, verdict: Document
) -> list[dict[str, Any]]:
    """Every interval of 95 % of a verdict that has a true value to hold, in the usual
    setting.

    Wald intervals, with quantiles of Student's t where the noise has degrees of
    freedom: of joint compliances, and of parameters of an effect that was found at the
    right joints. A parameter that the data do not identify has no interval.
    """
    case = truth["case"]
    if case["setting"] != "usual":
        return []
    freedom = verdict["noise"]["degrees_of_freedom"]
    width = t_distribution.ppf(0.975, freedom) if freedom else norm.ppf(0.975)
    springs = verdict["compliance_urad_per_Nm"]
    of_springs = zip(
        truth["compliance_urad_per_Nm"],
        springs["after"],
        springs["std_error"],
        strict=True,
    )
    values = [
        (COMPLIANCE, f"c{j}", true, value, error)
        for j, (true, value, error) in enumerate(of_springs, 1)
        if error > 0
    ]
    for defect in truth["defects"]:
        for effect in verdict["effects"]:
            if effect["name"] == defect["effect"]:
                values += _comparable(defect, effect)
    head: dict[str, Any] = {"truth": " + ".join(case["effects"]) or NONE}
    head |= {"foreign": any(effect.startswith(OUTSIDE) for effect in case["effects"])}
    head |= {"level": max(case["levels"], default=0.0)}
    return [
        head
        | {
            "effect": effect,
            "parameter": name,
            "true": true,
            "value": value,
            "std_error": error,
        }
        | {"holds": bool(abs(value - true) <= width * error)}
        for effect, name, true, value, error in values
    ]


def _comparable(
    defect: Document, effect: Document
) -> list[tuple[str, str, float, float, float]]:
    """Parameters of an effect that the plant's law has too, where it was found at the
    right joints."""
    found = []
    for parameter in effect["parameters"]:
        key, _, name = parameter["name"].rpartition(" ")
        # Such as ``cross_compliance@2+5[variant]``.
        where = key.partition("[")[0].partition("@")[2]
        joints: Sequence[int] = (
            [int(joint) for joint in where.split("+")] if where else []
        )
        if (
            list(joints) == defect["joints"]
            and name in defect["parameters"]
            and not parameter["held"]
        ):
            found.append(
                (
                    defect["effect"],
                    name,
                    defect["parameters"][name],
                    parameter["value"],
                    parameter["std_error"],
                )
            )
    return found
