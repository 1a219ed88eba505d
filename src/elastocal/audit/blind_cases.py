"""Cases of the blind proof: seals, and what each verdict is worth, from the sealed ground truths and the verdicts."""

from __future__ import annotations

import hashlib
import json
import re
from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import stats

from elastocal.audit.findings import Finding, compared, held

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from elastocal.audit.audited import Audited

# Arms that nobody had looked at before the engine was frozen; all others were tuned on.
_PROOF = ("iiwa14", "gp180")
# What no measurement can distinguish from an effect, by effect and joints; and robots that cannot have the other.
_ALIASES = {
    ("force_scale", ()): "joint_compliance",
    ("compensator_torque", (2,)): "transmission_harmonic",
    ("transmission_harmonic", (2,)): "compensator_torque",
    ("link_weight", (2,)): "compensator_torque",
}
_IMPOSSIBLE = {"iiwa14": ("compensator_torque", "compensator_stiffness")}
# What must be recorded for an effect to be seen.
_NEEDS = {
    "hysteresis": "approach",
    "frame_drift": "time",
    "thermal_growth": "temperature",
    "temperature_gradient": "temperature",
}
_DIGITS = 1e-8
_SILENT = ("adequate", "not_testable")
# Effects of which the plant's parameter is the catalogue's to first order, or by another law; of all others it is the same.
_COMPARABLE = dict.fromkeys(
    (
        *("link_geometry", "payload", "force_misalignment", "force_bias", "application_point", "base_compliance"),
        *("flange_flexibility", "tracker_scale"),
    ),
    "to first order",
) | dict.fromkeys(("lost_motion", "hysteresis"), "by another law")


@dataclass(frozen=True)
class Proof:
    """A finished blind proof.

    `truths`, `verdicts`, `oracles`: by the name of the case; verdicts and oracles of those that are sealed.
    """

    truths: dict[str, Mapping[str, Any]]
    verdicts: dict[str, Mapping[str, Any]]
    oracles: dict[str, Mapping[str, Any] | None]


@lru_cache(1)
def proof_of(run: Audited) -> Proof:
    """Ground truths that the manifest lists, with their verdicts and oracles; kept for the next table of the same run."""
    names = {file.removesuffix(".json") for _, file in _manifest(run)}
    truths = {
        path.stem: json.loads(path.read_text("utf-8"))
        for path in sorted((run.folder / "data/sealed").glob("*/*.json"))
        if path.stem in names
    }
    reported = [
        entry for path in sorted((run.folder / "results/blind").glob("*.json")) for entry in json.loads(path.read_text("utf-8"))
    ]
    oracles: dict[str, Mapping[str, Any] | None] = {}
    for path in sorted((run.folder / "results/blind/oracle").glob("*.json")):
        oracles |= json.loads(path.read_text("utf-8"))
    return Proof(truths, {entry["campaign"]: entry for entry in reported}, oracles)


def _manifest(run: Audited) -> list[tuple[str, str]]:
    lines = (run.folder / "reports/blind/manifest.sha256").read_text("utf-8").splitlines()
    return [(digest, file) for digest, _, file in (line.partition("  ") for line in lines)]


def seals(run: Audited, file: str) -> list[Finding]:
    """Every ground truth is what was sealed, and every sealed one is there."""
    there = {path.name: path for path in (run.folder / "data/sealed").glob("*/*.json")}
    listed = _manifest(run)
    off = [
        name for digest, name in listed if name not in there or hashlib.sha256(there[name].read_bytes()).hexdigest() != digest
    ]
    return [held(file, "ground truths as they were sealed", "hashlib, SHA-256", not off, ", ".join(off[:3]), len(listed))]


def columns(
    file: str, stated: pd.DataFrame, expected: pd.DataFrame, by: str = "pandas", digits: float = _DIGITS
) -> list[Finding]:
    """A table beside the same made again, column by column.

    `stated`, `expected`: rows in the same order; what the second lacks is not compared. `digits`: allowed relative difference
    of each number. Returns one for each column; the last says how many cells were followed.
    """
    if len(stated) != len(expected):
        return [held(file, "rows", "counting", False, f"found {len(stated)}, expected {len(expected)}")]
    if not len(stated):
        return [held(file, "no rows, as there are no such cases", by, True, "")]
    found = []
    followed = [name for name in stated if name in expected]
    for name in followed:
        left, right = stated[name].to_numpy(), expected[name].to_numpy()
        try:
            numbers = np.array(left, float), np.array(right, float)
        except (TypeError, ValueError):
            same = [_word(one) == _word(other) for one, other in zip(left, right, strict=True)]
            place = same.index(False) if not all(same) else -1
            note = "" if place < 0 else f"row {place}: found {left[place]}, expected {right[place]}"
            found.append(held(file, f"column {name}", by, all(same), note, len(same)))
            continue
        scale = np.nan_to_num(np.abs(numbers[1]), posinf=0.0)
        found.append(compared(file, f"column {name}", by, *numbers, digits, scale=scale))
    rest = [str(name) for name in stated if name not in expected]
    checked = f"{len(followed) * len(stated)} of {stated.size} cells followed" + (f"; not {', '.join(rest)}" if rest else "")
    return [*found, held(file, checked, by, True, "", 0)]


def _word(value: Any) -> str:
    return "" if value is None or (isinstance(value, float) and np.isnan(value)) else str(value)


def cases(run: Audited, file: str) -> list[Finding]:
    """Every row of the cases: what the verdict is worth, sizes, errors, the oracle."""
    # Joints are words, such as 2-3, although one alone looks like a number.
    proof, stated = proof_of(run), pd.read_csv(run.folder / file, dtype={"joints": str})
    every = sorted(stated["case"]) == sorted(proof.truths)
    found = [held(file, "every sealed case once", "counting", every, f"{len(stated)} of {len(proof.truths)}", len(stated))]
    if every:
        rows = [_case(proof.truths[name], proof.verdicts[name], proof.oracles[name]) for name in stated["case"]]
        found += columns(file, stated, pd.DataFrame(rows), "json and pandas")
    return found


def _case(truth: Mapping[str, Any], verdict: Mapping[str, Any], oracle: Mapping[str, Any] | None) -> dict[str, Any]:
    defects, effects, robot = truth["defects"], _apart_from_setup(truth, verdict)[1], truth["case"]["robot"]
    recorded = truth["design"]["covariates"]
    aliases = [_ALIASES.get((defect["effect"], tuple(defect["joints"]))) for defect in defects]
    sizes = [defect["signal"]["rms_m"] for defect in defects]
    rms = float(np.sqrt(sum(size**2 for size in sizes)))
    return (
        outcome(truth, verdict)
        | {
            "joints": " + ".join("-".join(map(str, defect["joints"])) for defect in defects),
            "right_place": _places(defects, "effect") == _places(effects, "name"),
            "exact_alias": any(alias and alias not in _IMPOSSIBLE.get(robot, ()) for alias in aliases),
            "hidden": any(_NEEDS.get(defect["effect"]) not in (None, *recorded) for defect in defects),
            "level_of": "raw" if "raw" in [defect["of"] for defect in defects] else "retained",
            "raw": sum(defect["signal"]["raw"] for defect in defects),
            "retained": sum(defect["signal"]["retained"] for defect in defects),
            "signal_rms_m": rms,
            "signal_over_noise": rms / (np.sqrt(3) * truth["noise"]["sigma_m"]),
            "times_plausible": max((defect["share_of_plausible"] for defect in defects), default=np.nan),
        }
        | _errors(verdict)
        | _of_oracle(oracle)
    )


def _of_oracle(oracle: Mapping[str, Any] | None) -> dict[str, float]:
    """What one who knows the effect finds; nothing of effects that no model of the catalogue has."""
    if oracle is None:
        return dict.fromkeys(("oracle_p_value", "oracle_detected", "oracle_rms_m"), np.nan)
    figures = (oracle["p_value"], float(oracle["detected"]), oracle["heldout"]["rms_m"])
    return dict(zip(("oracle_p_value", "oracle_detected", "oracle_rms_m"), figures, strict=True))


def outcome(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> dict[str, Any]:
    """What a verdict is worth."""
    case = truth["case"]
    word, effects = _apart_from_setup(truth, verdict)
    true, names = list(case["effects"]), [effect["name"] for effect in effects]
    stated = bool(true) and word in ("named", "class", "several")
    exact = stated and sorted(true) == sorted(names)
    meant = [{effect["name"], *(re.split(r"[@\[]", other)[0] for other in effect["alternatives"])} for effect in effects]
    matched = len(true) == len(meant) and any(
        all(name in among for name, among in zip(true, order, strict=True)) for order in permutations(meant)
    )
    return {
        "case": truth["campaign"],
        "group": case["group"],
        "robot": case["robot"],
        "robots": _kind(case),
        "setting": case["setting"],
        "truth": _joined(true),
        "level": max(case["levels"], default=0.0),
        "verdict": word,
        "found": _joined(names),
        "detected": word not in _SILENT,
        "exact": exact,
        "named_right": exact and word == "named",
        "holds_truth": stated and matched,
        "wrong_name": word == "named" and names != true,
    }


def _apart_from_setup(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> tuple[str, list[Mapping[str, Any]]]:
    """Where the base is misplaced, to find so is right, and the rest is judged alone."""
    word, effects = verdict["verdict"], list(verdict["effects"])
    others = [effect for effect in effects if effect["name"] != "base_placement" or "misplaced" not in truth]
    if len(others) < len(effects):
        single = "class" if any(effect["alternatives"] for effect in others) else "named"
        word = {0: "adequate", 1: single}.get(len(others), "several")
    return word, others


def _kind(case: Mapping[str, Any]) -> str:
    return "proof" if case["robot"] in _PROOF else "tuned"


def _joined(names: Sequence[str]) -> str:
    return " + ".join(names) or "none"


def _places(effects: Iterable[Mapping[str, Any]], key: str) -> dict[str, set[int]]:
    found: dict[str, set[int]] = defaultdict(set)
    for effect in effects:
        found[effect[key]].update(effect["joints"])
    return dict(found)


def _errors(verdict: Mapping[str, Any]) -> dict[str, Any]:
    held_out = verdict["heldout"]
    names = ("before_rms_m", "after_rms_m", "noise_floor_rms_m", "reduction", "reduction_std_error")
    flags = ("adopted", "worse", "worse_adopted", "warned", "worse_unwarned")
    if held_out is None:
        return dict.fromkeys(names, np.nan) | dict.fromkeys(flags, False)
    before, after = held_out["before"]["rms_m"], held_out["after"]["rms_m"]
    floor = held_out["noise_floor_rms_m"]
    fallen, error = 1 - after / before, held_out["reduction_std_error"]
    worse = fallen < -2 * error
    adopted = any(effect.get("adopted") for effect in verdict["effects"])
    warned = any(" of the validation poses" in warning for warning in verdict["warnings"])
    figures = (before, after, np.nan if floor is None else floor, fallen, error)
    outcomes = (adopted, worse, worse and adopted, warned, worse and not warned)
    return dict(zip(names, figures, strict=True)) | dict(zip(flags, outcomes, strict=True))


def probabilities(run: Audited, file: str) -> list[Finding]:
    """What was stated of each case, and whether it is so."""
    proof, stated = proof_of(run), run.table(file)
    reported = [name for name in proof.truths if (proof.verdicts[name].get("probabilities") or {}).get("sets")]
    every = sorted(stated["case"]) == sorted(reported)
    found = [
        held(
            file,
            "every case of which something is stated",
            "counting",
            every,
            f"{len(stated)} of {len(reported)}",
            len(reported),
        )
    ]
    if every and len(stated):
        rows = [_stated(proof.truths[name], proof.verdicts[name]["probabilities"]) for name in stated["case"]]
        found += columns(file, stated, pd.DataFrame(rows), "json and pandas")
    return found


def _stated(truth: Mapping[str, Any], probabilities: Mapping[str, Any]) -> dict[str, Any]:
    case = truth["case"]
    ranked = sorted(probabilities["sets"], key=lambda entry: -entry["probability"])
    kept, reached = [], 0.0
    for entry in ranked:
        kept.append(entry)
        reached += entry["probability"]
        if reached >= 0.95:
            break
    return {
        "case": truth["campaign"],
        "robots": _kind(case),
        "robot": case["robot"],
        "group": case["group"],
        "setting": case["setting"],
        "truth": _joined(case["effects"]),
        "level": max(case["levels"], default=0.0),
        "stated": ranked[0]["probability"],
        "top": _joined(sorted(ranked[0]["mechanisms"])),
        "correct": _is_so(ranked[0]["mechanisms"], truth),
        "held": any(_is_so(entry["mechanisms"], truth) for entry in kept),
        "set_size": len(kept),
        "set_probability": reached,
        "nothing": probabilities["nothing"],
        "alarm_p_value": probabilities["alarm_p_value"],
    }


def _is_so(mechanisms: Sequence[str], truth: Mapping[str, Any]) -> bool:
    """Whether mechanisms are the true ones; what the compliances absorb is as good as nothing."""
    effects = truth["case"]["effects"]
    if any(effect.startswith("outside:") for effect in effects):
        return "other" in mechanisms
    absorbed = {defect["effect"] for defect in truth["defects"] if defect["of"] == "raw"}
    placement = {"base_placement"} if "misplaced" in truth else set()
    return set(mechanisms) - placement == set(effects) - absorbed


def intervals(proof: Proof) -> pd.DataFrame:
    """Every interval of a verdict that has a true value to hold, and whether it does."""
    rows = []
    for name, truth in proof.truths.items():
        case, verdict = truth["case"], proof.verdicts[name]
        freedom = verdict["noise"]["degrees_of_freedom"]
        # Of a normal distribution where the noise is known.
        reach = stats.t.ppf(0.975, freedom or np.inf)
        right = sorted(effect["name"] for effect in verdict["effects"]) == sorted(case["effects"])
        head = {"robots": _kind(case), "setting": case["setting"], "truth": _joined(case["effects"]), "right": right}
        head["level"] = max(case["levels"], default=0.0)
        for effect, parameter, true, value, error in [*_springs(truth, verdict), *_parameters(truth, verdict)]:
            holds = abs(value - true) <= reach * error
            comparable = _COMPARABLE.get(effect, "exact")
            rows.append(head | {"effect": effect, "parameter": parameter, "comparable": comparable, "holds": holds})
    return pd.DataFrame(rows)


_Value = tuple[str, str, float, float, float]


def _springs(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> list[_Value]:
    stated = verdict["compliance_urad_per_Nm"]
    triples = zip(truth["compliance_urad_per_Nm"], stated["after"], stated["std_error"], strict=True)
    return [("joint_compliance", f"c{j}", *triple) for j, triple in enumerate(triples, 1) if triple[2] > 0]


def _parameters(truth: Mapping[str, Any], verdict: Mapping[str, Any]) -> list[_Value]:
    found = []
    for defect in truth["defects"]:
        for effect in verdict["effects"]:
            for parameter in effect["parameters"]:
                key, name = parameter["name"].rsplit(" ", 1)
                joints = [int(joint) for joint in re.findall(r"\d+", (re.findall(r"^[^\[@]*@([\d+]+)", key) or [""])[0])]
                alike = effect["name"] == defect["effect"] and joints == defect["joints"]
                if alike and name in defect["parameters"] and not parameter["held"]:
                    value = defect["parameters"][name], parameter["value"], parameter["std_error"]
                    found.append((defect["effect"], name, *value))
    return found


CHECKS = (
    (re.compile(r"reports/blind/manifest\.sha256"), seals),
    (re.compile(r"reports/blind/cases\.csv"), cases),
    (re.compile(r"reports/blind/probabilities\.csv"), probabilities),
)
