"""Contents of a certificate, made up."""

from dataclasses import asdict

from elastocal.application.accuracy import Accuracy


def made_accuracy():
    return asdict(Accuracy("base", 1.2e-4, 3e-4, 1.6e-4, None, 9, "some poses"))


def made_document(decision="pass", misplaced=False, **conformity):
    return {
        "campaign": "cell_7",
        "robot": "arm",
        "serial": "",
        "date": "2026-11-23",
        "stated": {"instrument": "Leica AT960, 751234"},
        "point": "All errors are those of tool0.",
        "misplaced": [{"sentence": "reflector or tool sits 5.0 mm from where it is declared"}] if misplaced else [],
        "worst_pose": {"joints": [{"value": -0.5, "unit": "rad"}, {"value": 0.25, "unit": "m"}], "error_m": 3e-4},
        "versions": {"elastocal": "0.1.0"},
        "origin": {"commit": "c0ffee", "code_sha256": "cd" * 32, "data_sha256": "da" * 32, "environment": {"numpy": "2"}},
        "files": {"campaign.yaml": "ab" * 32},
        "verdict": "named",
        "effects": ["lost_motion"],
        "errors": [["predicted over the poses", "1.500 mm", "0.120 mm"]],
        "regression": "",
        "validation_rms_m": {"uncorrected": 1.5e-3, "corrected": 1.2e-4},
        "noise_floor_rms_m": 1e-4,
        "joint_ranges": [{"low": -85.0, "high": 60.4, "unit": "deg"}, {"low": 0.0, "high": 1.5, "unit": "m"}],
        "accuracy": made_accuracy(),
        "conformity": {
            "decision": decision,
            "tolerance_m": 2e-4,
            "rms_m": 1.2e-4,
            "limit_m": 1.6e-4,
            "guard_band_m": 2e-5,
            "risk_above": 0.01,
            "accepted_risk": 0.05,
            "poses": 9,
            "configurations": 9,
            "shortfalls": [],
        }
        | conformity,
        "budget": [
            {"name": "uncorrected", "rms_m": 1.5e-3},
            {"name": "joint_compliance", "rms_m": 1e-3},
            {"name": "lost_motion", "rms_m": 2e-4},
            {"name": "uncertainty of the parameters", "rms_m": 2e-5},
            {"name": "repeatability", "rms_m": 0.0},
        ],
        "budget_states": 100,
        "tracker_rms_m": 1.5e-4,
    }
