"""One row a case: what the verdict is worth, how large the effect was, which errors were left, and what the oracle did."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.diagnosis.judge import ABOUT_ERRORS
from elastocal_proof.blind.cases import impossible_on
from elastocal_proof.blind.scores import judged_apart_from_setup, outcome
from elastocal_proof.plant.defects import KINDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

# Effects that lie wholly within another effect or the joint compliances, by effect and joints of the ground truth, with what it
# is not distinguishable from. Left out are aliases that a known frame, known targets and points at the elbow and wrist resolve:
# offset of joint 1 and base, last link and tool, tilt of joint 1 and base, coupling of joints 2 and 3 and upper arm.
EXACT_ALIASES: dict[tuple[str, tuple[int, ...]], str] = {
    ("force_scale", ()): "joint_compliance",
    ("compensator_torque", (2,)): "transmission_harmonic",
    ("transmission_harmonic", (2,)): "compensator_torque",
    ("link_weight", (2,)): "compensator_torque",
}
_STD_ERRORS = 2.0
_ERRORS: tuple[str, ...] = ("before_rms_m", "after_rms_m", "noise_floor_rms_m", "reduction", "reduction_std_error")
_ERRORS += ("worse", "warned", "worse_unwarned", "adopted", "worse_adopted")
_COVARIATES = {need for kind in KINDS.values() for need in kind.needs}


def case_row(
    truth: Mapping[str, Any],
    verdict: Mapping[str, Any],
    oracle: Mapping[str, Any] | None,
    limit: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Everything that the scores count of a case.

    `truth`: a sealed document. `verdict`: as verdict.json. `oracle`, `limit`: of `oracle.oracle` and `limit.limit`, where the
    case has one. Returns one row of cases.csv.
    """
    defects, unrecorded = truth["defects"], _COVARIATES - set(truth["design"]["covariates"])
    return (
        outcome(truth, verdict)
        | {
            "joints": " + ".join("-".join(map(str, defect["joints"])) for defect in defects),
            "right_place": _places(defects, "effect") == _places(judged_apart_from_setup(truth, verdict)[1], "name"),
            # By the ground truth alone.
            "exact_alias": any(_is_alias(defect, truth["case"]["robot"]) for defect in defects),
            "hidden": any(set(KINDS[defect["effect"]].needs) & unrecorded for defect in defects),
        }
        | _size(truth)
        | _errors(verdict)
        | _of_oracle(oracle)
        | {f"limit_{name}": np.nan if limit is None else float(limit[name]) for name in ("detected", "right")}
    )


def _size(truth: Mapping[str, Any]) -> dict[str, Any]:
    """How large the effects are; for several the squares add up."""
    defects, noise = truth["defects"], truth["noise"]
    raw, retained = (sum(defect["signal"][kind] for defect in defects) for kind in ("raw", "retained"))
    rms_m = float(np.sqrt(sum(defect["signal"]["rms_m"] ** 2 for defect in defects)))
    return {
        # Of what all these effects' levels are the non-centrality.
        "level_of": "raw" if any(defect["of"] == "raw" for defect in defects) else "retained",
        "raw": raw,
        "retained": retained,
        "signal_rms_m": rms_m,
        "signal_over_noise": rms_m / (np.sqrt(3.0) * noise["sigma_m"]),
        "times_plausible": max((defect["share_of_plausible"] for defect in defects), default=np.nan),
    }


def _is_alias(defect: Mapping[str, Any], robot: str) -> bool:
    """Whether an effect lies wholly within another one that the robot can have."""
    alias = EXACT_ALIASES.get((defect["effect"], tuple(defect["joints"])))
    return alias is not None and alias not in impossible_on(robot)


def _places(effects: Iterable[Mapping[str, Any]], name: str) -> dict[str, set[int]]:
    """Joints of each effect; those of one mechanism at several joints together."""
    found: dict[str, set[int]] = {}
    for effect in effects:
        found.setdefault(effect[name], set()).update(effect["joints"])
    return found


def _errors(verdict: Mapping[str, Any]) -> dict[str, Any]:
    """Held-out errors, and whether they got worse by more than chance with an effect that was adopted."""
    held = verdict["heldout"]
    if held is None:
        # A fault of the data ends a diagnosis before any model is fitted.
        return dict.fromkeys(_ERRORS[:5], np.nan) | dict.fromkeys(_ERRORS[5:], False)
    before, after = held["before"]["rms_m"], held["after"]["rms_m"]
    reduction, std_error = 1.0 - after / before, held["reduction_std_error"]
    warned = any(ABOUT_ERRORS in warning for warning in verdict["warnings"])
    adopted = any(effect.get("adopted", False) for effect in verdict["effects"])
    worse = reduction + _STD_ERRORS * std_error < 0.0
    return {
        "before_rms_m": before,
        "after_rms_m": after,
        "noise_floor_rms_m": np.nan if held["noise_floor_rms_m"] is None else held["noise_floor_rms_m"],
        "reduction": reduction,
        "reduction_std_error": std_error,
        "adopted": adopted,
        "worse": worse,
        # A warning does not excuse it, as there always is one.
        "worse_adopted": adopted and worse,
        "warned": warned,
        "worse_unwarned": worse and not warned,
    }


def _of_oracle(oracle: Mapping[str, Any] | None) -> dict[str, Any]:
    if oracle is None:
        return {"oracle_p_value": np.nan, "oracle_detected": np.nan, "oracle_rms_m": np.nan}
    return {
        "oracle_p_value": oracle["p_value"],
        "oracle_detected": float(oracle["detected"]),
        "oracle_rms_m": oracle["heldout"]["rms_m"],
    }
