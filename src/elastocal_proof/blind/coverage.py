"""How often 95 % intervals of parameters contain the true value."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.stats import norm
from scipy.stats import t as t_distribution

from elastocal_proof.blind.rates import rate
from elastocal_proof.blind.scores import NONE, kind_of

if TYPE_CHECKING:
    from collections.abc import Mapping

COMPLIANCE = "joint_compliance"
EXACT, FIRST_ORDER, OTHER_LAW = "exact", "to first order", "by another law"
# How far a parameter of the plant is the catalogue's own; what is in neither list is it exactly.
_FIRST_ORDER = (
    "link_geometry",
    "payload",
    "force_misalignment",
    "force_bias",
    "application_point",
    "base_compliance",
    "flange_flexibility",
    "tracker_scale",
)
_KEYS = ("kind", "effect", "comparable", "parameter", "level")
_OTHER_LAW = ("lost_motion", "hysteresis")


def intervals_of(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Every interval of a verdict that has a true value to hold.

    Wald intervals, with quantiles of Student's t where the noise has degrees of freedom.

    `truth`: a sealed document. `verdict`: as verdict.json. Returns joint compliances, whatever was found; parameters of an
    effect that was found at the right joints, whatever was found beside it. A parameter that the data do not identify has no
    interval.
    """
    case, found = truth["case"], verdict["effects"]
    right = sorted(effect["name"] for effect in found) == sorted(case["effects"])
    freedom = verdict["noise"]["degrees_of_freedom"]
    width = t_distribution.ppf(0.975, freedom) if freedom else norm.ppf(0.975)
    head = {
        "robots": kind_of(case["robot"]),
        "setting": case["setting"],
        "truth": " + ".join(case["effects"]) or NONE,
        "right": right,
        "level": max(case["levels"], default=0.0),
    }
    springs = verdict["compliance_urad_per_Nm"]
    of_springs = zip(truth["compliance_urad_per_Nm"], springs["after"], springs["std_error"], strict=True)
    values = [
        (COMPLIANCE, f"c{joint}", EXACT, true, value, error)
        for joint, (true, value, error) in enumerate(of_springs, 1)
        if error > 0
    ]
    for defect in truth["defects"]:
        for effect in found:
            if effect["name"] == defect["effect"]:
                values += _comparable(defect, effect)
    return [
        head
        | {"effect": effect, "parameter": name, "comparable": how, "true": true, "value": value, "std_error": error}
        | {"holds": bool(abs(value - true) <= width * error)}
        for effect, name, how, true, value, error in values
    ]


def covered(intervals: pd.DataFrame) -> pd.DataFrame:
    """Shares of intervals that contain the true value.

    `intervals`: rows of `intervals_of`. Returns one row for each kind of robots, effect, parameter and level, with ``all`` for
    parameters and levels together. Joint compliances are apart: of cases without an effect in the usual setting, of those in
    which the right one was found, and of those in which it was not.
    """
    columns = ["robots", *_KEYS, *rate([])]
    if not len(intervals):
        return pd.DataFrame(columns=columns)
    of_springs = intervals.effect == COMPLIANCE
    fitted = np.where(intervals.right, "compliance, effect found", "compliance, effect not found")
    kind = np.where(~of_springs, "effect", np.where(intervals.truth == NONE, "compliance, no effect", fitted))
    rows = intervals.assign(kind=kind)[intervals.setting == "usual"]
    whole = rows.assign(parameter="all")
    everything = whole[whole.kind == "effect"].assign(level="all", effect="all", comparable="all")
    together = pd.concat([rows.assign(level="all"), whole, whole.assign(level="all"), everything])
    together["level"] = [level if level == "all" else f"{level:g}" for level in together.level]
    found = []
    for keys, part in together.groupby(["robots", *_KEYS]):
        found.append(dict(zip(("robots", *_KEYS), keys, strict=True)) | rate(part.holds))
    return pd.DataFrame(found, columns=columns)


def _joints_of(key: str) -> list[int]:
    """Joints in the key of a candidate such as ``cross_compliance@2+5[variant]``, list of int."""
    where = key.partition("[")[0].partition("@")[2]
    return [int(joint) for joint in where.split("+")] if where else []


def _comparable(defect: Mapping[str, Any], effect: Mapping[str, Any]) -> list[tuple[str, str, str, float, float, float]]:
    how = OTHER_LAW if defect["effect"] in _OTHER_LAW else FIRST_ORDER if defect["effect"] in _FIRST_ORDER else EXACT
    found = []
    for parameter in effect["parameters"]:
        key, _, name = parameter["name"].rpartition(" ")
        mine = _joints_of(key) == defect["joints"]
        if mine and name in defect["parameters"] and not parameter["held"]:
            found.append((defect["effect"], name, how, defect["parameters"][name], parameter["value"], parameter["std_error"]))
    return found
