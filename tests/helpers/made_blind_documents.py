"""Ground truths, verdicts and oracles of blind cases as documents, without making any
case; and the plan that counts them."""

import pandas as pd
from analysed_robots import ROBOTS

from elastocal.io.documents import read_document
from elastocal_proof.blind.scores import build_case_row, list_intervals
from elastocal_proof.blind.summary import summarize_figures

PLAN = read_document(ROBOTS.parent / "blind.yaml")
JOINTS = 6


def truth(*places, group=None, level=50.0, robot="irb7600", setting="usual", **changes):
    """A sealed document; a place is an effect with its joints, such as ("joint_offset",
    3)."""
    group = group or ("single" if places else "none")
    defects = [
        {
            "effect": effect,
            "joints": list(joints),
            "of": "retained",
            "share_of_plausible": 0.5,
            "signal": {"raw": 4 * level, "retained": level},
            "parameters": {},
        }
        for effect, *joints in places
    ]
    effects = [effect for effect, *_ in places]
    robots = "tuned" if robot in PLAN["tuned"] else "proof"
    case = {
        "group": group,
        "robot": robot,
        "robots": robots,
        "setting": setting,
        "effects": effects,
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


def effect(name, *joints, parameters=(), alternatives=(), adopted=True):
    """An effect of a verdict; a parameter is a name with its value and its standard
    error."""
    key = "@".join([name, "+".join(map(str, joints))] if joints else [name])
    return {
        "name": name,
        "joints": list(joints),
        "alternatives": list(alternatives),
        "adopted": adopted,
        "parameters": [
            {
                "name": f"{key} {of}",
                "value": value,
                "std_error": error,
                "held": error == 0,
            }
            for of, value, error in parameters
        ],
    }


def verdict(
    word,
    *effects,
    before=2e-4,
    after=1e-4,
    reduction=(0.4, 0.6),
    warnings=(),
    compliance=1.0,
    freedom=0,
):
    """A verdict as in verdict.json."""
    return {
        "verdict": word,
        "effects": list(effects),
        "heldout": {
            "before": {"rms_m": before},
            "after": {"rms_m": after},
            "noise_floor_rms_m": 1e-4,
            "reduction_ci95": list(reduction),
            # As the interval of a normal estimate has it.
            "reduction_std_error": (reduction[1] - reduction[0]) / (2 * 1.959964),
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


def said(word, *names, alternatives=()):
    """A verdict by its word and names."""
    return verdict(word, *(effect(name, alternatives=alternatives) for name in names))


def silence(**changes):
    return verdict("adequate", before=1e-4, after=1e-4, reduction=(0.0, 0.0), **changes)


def oracle(p_value=1e-6, rms=1e-4):
    return {
        "candidates": [],
        "p_value": p_value,
        "detected": p_value < 0.05,
        "heldout": {"rms_m": rms},
    }


def frame(*entries):
    """Rows of cases.csv of (ground truth, verdict, oracle), with a limit behind them
    where there is one."""
    return pd.DataFrame([build_case_row(PLAN, *entry) for entry in entries])


def summary(*entries):
    """The summary of such entries by robots and quantity."""
    spans = pd.DataFrame(
        [
            row
            for document, found, *_ in entries
            for row in list_intervals(document, found)
        ]
    )
    return summarize_figures(PLAN, frame(*entries), spans, 1).set_index(
        ["robots", "quantity"]
    )
