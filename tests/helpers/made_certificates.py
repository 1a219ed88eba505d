"""Contents of a certificate, made up."""

from elastocal.application.accuracy import Accuracy


def step(model, rms, open_above=False):
    metrics = ("mean_m", "rms_m", "p95_m", "max_m")
    values = {metric: rms * factor for metric, factor in zip(metrics, (0.9, 1.0, 1.6, 2.0), strict=True)}
    values |= {f"{metric}_low": 0.8 * values[metric] for metric in metrics[:3]} | {"max_m_low": None, "max_m_high": None}
    values |= {f"{metric}_high": 1.3 * values[metric] for metric in metrics[:2]}
    values["p95_m_high"] = None if open_above else 2.0 * rms
    return {"model": model, "step": {"corrected": "with lost_motion"}.get(model, model)} | values


def line(name, rms, known=True):
    return {"name": name, "rms_m": rms, "low_m": 0.8 * rms if known else None, "high_m": 1.2 * rms if known else None}


def made_accuracy():
    noise = "the tracker's noise is not in it"
    return Accuracy("base", "predicted", 1.2e-4, 3e-4, 1.6e-4, None, noise, 9, "some poses").document()


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
        "held_out": [step("uncorrected", 1.5e-3), step("declared", 3e-4), step("corrected", 1.2e-4, True)],
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
            line("uncorrected", 1.5e-3, False),
            line("joint_compliance", 1e-3),
            line("lost_motion", 2e-4),
            line("uncertainty of the parameters", 2e-5, False),
            line("repeatability", 0.0, False),
        ],
        "budget_states": 100,
        "tracker_rms_m": 1.5e-4,
    }
