"""What the verdict on a case is worth, given its ground truth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from elastocal.diagnosis.verdict import ADEQUATE, CLASS, NAMED, NOT_TESTABLE, SEVERAL
from elastocal.effects.protocol import effect_of
from elastocal_proof.blind.cases import TUNED as TUNED_ON

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

NONE = "none"
# The two kinds of robots: those on which it is proved, and those on which the method was tuned.
PROOF, TUNED = "proof", "tuned"
SILENT = (ADEQUATE, NOT_TESTABLE)
# The effect by which a diagnosis says that the base is not where it is declared.
_MISPLACED = "base_placement"


def outcome(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> dict[str, Any]:
    """What a verdict is worth, given the ground truth.

    Whether each true effect is held by another one of those found is an assignment problem [1].

    `truth`: a sealed document. `verdict`: as verdict.json. Returns of the case: where it belongs, what was true, what the
    verdict was. ``exact``: the names found are the true ones; ``named_right``: so, and the verdict states no other name beside
    it; ``holds_truth``: as many effects were found as were made, and each true one is the name of another of them or among its
    alternatives; ``wrong_name``: one wrong name is stated alone.

    [1] Kuhn, H. W., The Hungarian method for the assignment problem, Naval Research Logistics Quarterly 2, 1955.
    """
    kind, effects = judged_apart_from_setup(truth, verdict)
    names, true = [effect["name"] for effect in effects], list(truth["case"]["effects"])
    stated = bool(true) and kind in (NAMED, CLASS, SEVERAL)
    right = stated and sorted(names) == sorted(true)
    return head_of(truth) | {
        "verdict": kind,
        "found": " + ".join(names) or NONE,
        "detected": kind not in SILENT,
        "exact": right,
        "named_right": right and kind == NAMED,
        "holds_truth": stated and _each_is_held(true, effects),
        "wrong_name": kind == NAMED and names != true,
    }


def head_of(truth: Mapping[str, Any]) -> dict[str, Any]:
    """Where a case belongs and what is true of it; `truth`: a sealed document."""
    case = truth["case"]
    head = {"case": truth["campaign"], "group": case["group"], "robot": case["robot"], "robots": kind_of(case["robot"])}
    head |= {"setting": case["setting"], "truth": " + ".join(case["effects"]) or NONE}
    return head | {"level": max(case["levels"], default=0.0)}


def wrong_setup(truth: Mapping[str, Any]) -> set[str]:
    """Mechanisms of the set-up that a case has beside what it is about: right to find, and no fault not to name."""
    return {_MISPLACED} if "misplaced" in truth else set()


def judged_apart_from_setup(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> tuple[str, list[Mapping[str, Any]]]:
    """Verdict and effects without those of `wrong_setup`."""
    kind, effects = verdict["verdict"], list(verdict["effects"])
    kept = [effect for effect in effects if effect["name"] not in wrong_setup(truth)]
    if len(kept) == len(effects):
        return kind, effects
    one = CLASS if kept and kept[0]["alternatives"] else NAMED
    return (ADEQUATE, one, SEVERAL)[min(len(kept), 2)], kept


def kind_of(robot: str) -> str:
    """Whether a robot belongs to the proof or was tuned on."""
    return TUNED if robot in TUNED_ON else PROOF


def leading(kinds: Iterable[str]) -> str:
    """Which kind of robots a figure shows: that of the proof, or where there is none the one that was tuned on."""
    return PROOF if PROOF in set(kinds) else TUNED


def _each_is_held(true: Sequence[str], effects: Sequence[Mapping[str, Any]]) -> bool:
    if len(true) != len(effects):
        return False
    meant = [{effect["name"], *map(effect_of, effect["alternatives"])} for effect in effects]
    held = np.array([[name in names for names in meant] for name in true], bool)
    return bool(held[linear_sum_assignment(~held)].all())
