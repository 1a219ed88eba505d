"""Synthetic contents of a verification."""

import numpy as np
import pandas as pd

TOLERANCE_M = 2e-4


def make_verification(*, held=True, remains=False, decision="pass", certified=True):
    """Make the document of a verification."""
    judged = {
        "decision": decision,
        "tolerance_m": TOLERANCE_M,
        "limit_m": 1.5e-4,
        "risk_above": 0.01,
        "accepted_risk": 0.05,
    }
    certificate = {
        "predicted": judged | {"decision": "pass"},
        "measured": judged,
        "shortfalls": [],
    }
    return {
        "campaign": "cell",
        "robot": "KUKA",
        "serial": "",
        "date": "2026-11-29",
        "version": "0.1.0",
        "origin": {"environment": {"numpy": "2"}, "commit": "c0ffee"},
        "files": {"measured": "0123"},
        "target": "SMR",
        "offset_fitted": False,
        "not_measured": 1,
        "frame": "robot",
        "targets": 12,
        "measurements": 24,
        "configurations": 9,
        "before_rms_m": 1.5e-3,
        "predicted_rms_m": 5e-5,
        "measured_rms_m": 1.1e-4,
        "robot_rms_m": 4e-5,
        "robot_bound_m": 7e-5,
        "accepted_risk": 0.05,
        "worst": {"number": 3, "error_m": 2.1e-4},
        "noise": {"source": "repeats", "position_m": 6e-5, "rms_m": 1e-4},
        "prediction": {
            "held": held,
            "p_value": 0.4 if held else 0.001,
            "level": 0.05,
            "expected_m": 1.15e-4,
            "noticed_m": 9e-5,
            "power": 0.8,
            "above_bound": 1,
            "bounded": 12,
        },
        "remaining": {
            "remains": remains,
            "p_value": 0.002 if remains else 0.3,
            "level": 0.05,
            "rms_m": 8e-5,
            "chance_m": 1.05e-4,
        },
        "certificate": certificate if certified else None,
        "remarks": [],
    }


def make_table(count=12):
    """Make the table of a verification."""
    stream = np.random.default_rng(0)
    return pd.DataFrame(
        {
            "target": np.arange(1, count + 1),
            "predicted_error_before_m": 1.5e-3,
            "predicted_error_after_m": 5e-5,
            "bound_with_noise_m": 1.9e-4,
            "measured_error_m": stream.uniform(3e-5, 2e-4, count),
        }
    )
