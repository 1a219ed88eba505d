"""Scores of blind cases: what was sealed against what was said."""

import pandas as pd
from statsmodels.stats.proportion import proportion_confint

SILENT = ("adequate", "not_testable")
# As the issue sets them, by what is counted and the non-centrality.
_TARGETS = {
    ("detected", 25.0): ">= 0.80",
    ("detected", 50.0): ">= 0.97",
    ("class", 50.0): ">= 0.95",
    ("name", 200.0): ">= 0.95",
    ("outside", 200.0): "<= 0.15",
    ("pair", 200.0): ">= 0.85",
}


def outcome(truth, verdict):
    """What a verdict is worth, given the truth.

    Parameters
    ----------
    truth : dict
        A sealed document.
    verdict : dict
        As verdict.json.

    Returns
    -------
    dict
        One row of cases.csv.
    """
    case = truth["case"]
    names = [effect["name"] for effect in verdict["effects"]]
    alternatives = {key.split("@")[0].split("[")[0] for effect in verdict["effects"] for key in effect["alternatives"]}
    true = set(case["effects"])
    held = verdict["heldout"]
    return {
        "case": truth["campaign"],
        "group": case["group"],
        "robot": case["robot"],
        "setting": case["setting"],
        "truth": " + ".join(case["effects"]) or "none",
        "level": max(case["levels"], default=0.0),
        "verdict": verdict["verdict"],
        "found": " + ".join(names) or "none",
        "detected": verdict["verdict"] not in SILENT,
        "exact": verdict["verdict"] in ("named", "class", "several") and set(names) == true,
        "named_right": verdict["verdict"] == "named" and set(names) == true,
        "holds_truth": bool(true) and true <= set(names) | alternatives,
        "wrong_name": verdict["verdict"] == "named" and set(names) != true,
        "worse_unwarned": held["after"]["rms_m"] > held["before"]["rms_m"] and not verdict["warnings"],
    }


def summarized(cases):
    """Rates with Clopper-Pearson intervals.

    Parameters
    ----------
    cases : pandas.DataFrame
        Of `outcome`.

    Returns
    -------
    pandas.DataFrame
    """
    single = cases[(cases.group == "single") & (cases.truth != "force_scale")]
    rows = [_rate("false alarms with no effect", cases[cases.truth.eq("none")], "detected", "upper limit < 0.08")]
    for level, part in single.groupby("level"):
        at, found = f"at non-centrality {level:g}", part[part.detected]
        rows.append(_rate(f"detected {at}", part, "detected", _TARGETS.get(("detected", level), "")))
        rows.append(
            _rate(f"right name or class, given detection, {at}", found, "holds_truth", _TARGETS.get(("class", level), ""))
        )
        rows.append(_rate(f"right name alone {at}", part, "named_right", _TARGETS.get(("name", level), "")))
    for level, part in cases[cases.group == "outside"].groupby("level"):
        target = _TARGETS.get(("outside", level), "")
        rows.append(_rate(f"wrong single name, truth outside, at {level:g}", part, "wrong_name", target))
    for level, part in cases[cases.group == "pair"].groupby("level"):
        rows.append(_rate(f"both of two effects at {level:g} each", part, "exact", _TARGETS.get(("pair", level), "")))
    rows.append(_rate("held-out error worse without a warning", cases, "worse_unwarned", "none"))
    return pd.DataFrame(rows)


def confused(cases):
    """Truth against what was said, as counts.

    Returns
    -------
    pandas.DataFrame
        One row a truth, one column a word of the verdict with what was found.
    """
    said = cases.verdict.where(~cases.verdict.isin(("named", "class")), cases.verdict + " " + cases.found)
    truth = cases.truth.where(cases.group != "pair", "pair")
    return pd.crosstab(truth, said).reset_index()


def _rate(name, part, column, target):
    hits, trials = int(part[column].sum()), len(part)
    low, high = proportion_confint(hits, trials, 0.05, "beta") if trials else (0.0, 1.0)
    return {
        "quantity": name,
        "hits": hits,
        "cases": trials,
        "rate": hits / trials if trials else float("nan"),
        "low": 0.0 if hits == 0 else low,
        "high": 1.0 if hits == trials else high,
        "target": target,
    }
