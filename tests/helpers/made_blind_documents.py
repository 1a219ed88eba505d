"""Ground truths, verdicts and oracles of blind cases as documents, without making any
case; and the tables that are counted from them."""

import pandas as pd
from analysed_robots import ROBOTS

from elastocal.io.documents import read_document
from elastocal_proof.blind.scores import build_case_row, list_intervals
from elastocal_proof.blind.summary import summarize_figures

PLAN = read_document(ROBOTS.parent / "blind.yaml")
JOINTS = 6
# Half width of the 95 % interval of a normal estimate, in standard errors.
COVERAGE_FACTOR = 1.959964


def make_truth(
    *located_effects,
    group=None,
    level=50.0,
    robot="rx160",
    setting="usual",
    **changes,
):
    """Make a sealed document; a located effect is a tuple of its name and its joints,
    such as ("joint_offset", 3)."""
    defects = [
        {
            "effect": effect,
            "joints": list(joints),
            "of": "retained",
            "share_of_plausible": 0.5,
            "signal": {"raw": 4 * level, "retained": level},
            "parameters": {},
        }
        for effect, *joints in located_effects
    ]
    case = {
        "group": group or ("single" if located_effects else "none"),
        "robot": robot,
        "robots": "tuned" if robot in PLAN["tuned"] else "proof",
        "setting": setting,
        "effects": [defect["effect"] for defect in defects],
        "levels": [level] * len(defects),
    }
    return {
        "campaign": "case_x",
        "case": case,
        "defects": defects,
        "design": {"covariates": ["approach", "time", "temperature"]},
        "noise": {"sigma_m": 6e-5, "sigma_m_per_m": 0.0, "sigma_rad": 6e-5},
        "compliance_urad_per_Nm": [1.0] * JOINTS,
    } | changes


def make_effect(name, *joints, parameters=(), alternatives=(), adopted=True):
    """Make an effect of a verdict; a parameter is a tuple of its name, its value and its
    standard error."""
    key = f"{name}@{'+'.join(map(str, joints))}" if joints else name
    return {
        "name": name,
        "joints": list(joints),
        "alternatives": list(alternatives),
        "adopted": adopted,
        "parameters": [
            {
                "name": f"{key} {parameter}",
                "value": value,
                "std_error": std_error,
                "held": std_error == 0,
            }
            for parameter, value, std_error in parameters
        ],
    }


def make_verdict(
    kind,
    *effects,
    before=2e-4,
    after=1e-4,
    reduction=(0.4, 0.6),
    warnings=(),
    compliance=1.0,
    freedom=0,
):
    """Make a verdict with the keys of verdict.json that the scores read."""
    return {
        "verdict": kind,
        "effects": list(effects),
        "heldout": {
            "declared": {"rms_m": before},
            "after": {"rms_m": after},
            "noise_floor_rms_m": 1e-4,
            "reduction_ci95": list(reduction),
            "reduction_std_error": (reduction[1] - reduction[0])
            / (2 * COVERAGE_FACTOR),
        },
        "noise": {"degrees_of_freedom": freedom},
        "repeatable": None,
        "probabilities": None,
        "warnings": list(warnings),
        "compliance_urad_per_Nm": {
            "after": [compliance] * JOINTS,
            "std_error": [0.1] * JOINTS,
        },
    }


def make_plain_verdict(kind, *names, alternatives=()):
    """Make a verdict from its kind and the names of its effects."""
    effects = [make_effect(name, alternatives=alternatives) for name in names]
    return make_verdict(kind, *effects)


def make_adequate_verdict(**changes):
    return make_verdict(
        "adequate", before=1e-4, after=1e-4, reduction=(0.0, 0.0), **changes
    )


def make_oracle(p_value=1e-6, rms=1e-4, alternatives=None):
    return {
        "candidates": [],
        "p_value": p_value,
        "detected": p_value < 0.05,
        "alternatives": alternatives,
        "heldout": {"rms_m": rms},
    }


def tabulate_cases(*entries):
    """Tabulate rows of cases.csv; an entry is a tuple of a ground truth, a verdict, an
    oracle and, if there is one, a limit."""
    return pd.DataFrame([build_case_row(PLAN, *entry) for entry in entries])


def summarize_entries(*entries):
    """Summarize entries of `tabulate_cases`, by robots and quantity."""
    intervals = []
    for truth, verdict, *_ in entries:
        intervals += list_intervals(truth, verdict)
    cases = tabulate_cases(*entries)
    summary = summarize_figures(PLAN, cases, pd.DataFrame(intervals), 1)
    return summary.set_index(["robots", "quantity"])
