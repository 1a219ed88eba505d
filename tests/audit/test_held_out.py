"""What a verdict, a table of splits and an overview say of residuals; a figure altered is found."""

import json

import numpy as np
import pandas as pd
import pytest
from made_audits import CONFIGURATION, failed

from elastocal.validation import held_out as validated
from elastocal_proof.audit import held_out
from elastocal_proof.audit.audited import Audited

FOLDER, REPORTS = "results/loop/cell", "reports/loop/cell"
POSES = 9
EFFECT = {"name": "payload", "joints": [2], "probability": 0.9}


def named(distance):
    """Figures of errors as a verdict has them."""
    return dict(zip(("mean_m", "rms_m", "p95_m", "max_m"), held_out.measure(distance), strict=True))


@pytest.fixture
def run(tmp_path):
    for folder in (FOLDER, REPORTS):
        (tmp_path / folder).mkdir(parents=True)
    draws, pose = np.random.default_rng(4), np.repeat(np.arange(POSES), 3)
    columns = [f"{state}_d{axis}" for state in ("before", "after") for axis in "xyz"]
    off = draws.normal(size=(len(pose), 6)) * np.repeat([2e-4, 1e-4], 3)
    frame = pd.DataFrame(off, columns=columns).assign(session=0, pose=pose, load=np.tile([0, 1, 2], POSES), target=0)
    frame = frame.assign(repeat=0, row=np.arange(1, len(pose) + 1), held_out=True, outside_range=pose == 2, gross_error=False)
    frame.to_parquet(tmp_path / REPORTS / "residuals.parquet")
    seen = frame[["session", "pose", "load", "target", "row"]].assign(x=draws.normal(size=len(pose)), y=0.0, z=0.0)
    seen.assign(approach1=np.nan).to_parquet(tmp_path / FOLDER / "held_out.parquet")
    (tmp_path / FOLDER / "campaign.json").write_text(json.dumps({"campaign": {"campaign": "cell"}, "held_out": None}))
    distances = [np.linalg.norm(off[:, columns], axis=1) for columns in (slice(3), slice(3, 6))]
    _, (_, fallen) = validated.intervals([validated.Errors(each, pose) for each in distances], 1000, np.random.default_rng(5))
    sides = {"inside": pose != 2, "outside": pose == 2}
    before, after = stated = [named(each) for each in distances]
    heldout = {
        "before": before,
        "after": after,
        "noise_floor_rms_m": 1e-4,
        "reduction_ci95": [fallen.low, fallen.high],
        "reduction_std_error": fallen.std_error,
        "poses": POSES,
        "share_below_max": 0.05 ** (1 / POSES),
        "outside_range": {"poses": 1}
        | {
            side: {state: named(each[kept]) for state, each in zip(("before", "after"), distances, strict=True)}
            for side, kept in sides.items()
        },
    }
    document = {
        "gross_errors": [],
        "verdict": "named",
        "effects": [EFFECT],
        "warnings": ["few"],
        "compliance_urad_per_Nm": {"before": [0.5]},
    }
    diagnosed = document | {"effects": [EFFECT | {"heldout_gain": None}]}
    (tmp_path / FOLDER / "diagnosis.json").write_text(json.dumps({"document": diagnosed}))
    gain = 1 - after["rms_m"] / before["rms_m"]
    verdict = document | {"effects": [EFFECT | {"heldout_gain": gain}], "heldout": heldout, "warnings": ["few", "grew"]}
    (tmp_path / REPORTS / "verdict.json").write_text(json.dumps(verdict))
    steps = pd.DataFrame({"step": [1], "owner": ["joint_compliance"], "value": [5e-7]})
    steps.to_parquet(tmp_path / FOLDER / "steps.parquet")
    rows = {"step": ["declared", "with payload"], "heldout_rms_m": [each["rms_m"] for each in stated]}
    table = pd.DataFrame(rows).assign(heldout_rms_over_floor=lambda each: each["heldout_rms_m"] / 1e-4)
    table.to_csv(tmp_path / REPORTS / "before_after.csv", index=False)
    row = {"split": "held out", "block": "all", "poses": POSES, "reduction": gain, "reduction_std_error": fallen.std_error}
    row |= {"reduction_low": fallen.low, "reduction_high": fallen.high}
    for state, each in zip(("before", "after"), stated, strict=True):
        row |= {f"{state}_rms_m{end}": factor * each["rms_m"] for end, factor in (("", 1.0), ("_low", 0.9), ("_high", 1.1))}
    pd.DataFrame([row]).to_csv(tmp_path / REPORTS / "splits.csv", index=False)
    return Audited(tmp_path, CONFIGURATION, {}, {}, 4)


def of_verdict(run, change=lambda document: None):
    path = run.folder / REPORTS / "verdict.json"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    return failed(held_out.verdict(run, f"{REPORTS}/verdict.json", "cell"))


def of_splits(run, column=None, factor=1.0):
    path = run.folder / REPORTS / "splits.csv"
    frame = pd.read_csv(path)
    if column:
        frame.loc[0, column] *= factor
    frame.to_csv(path, index=False)
    return failed(held_out.splits(run, f"{REPORTS}/splits.csv", "cell"))


def test_a_verdict_that_says_what_the_residuals_say_holds(run):
    assert of_verdict(run) == []
    assert of_splits(run) == []


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda d: d.update(verdict="class"), "what the diagnosis reported"),
        (lambda d: d["effects"][0].update(probability=0.95), "what the diagnosis reported"),
        (lambda d: d.update(warnings=["grew"]), "what the diagnosis reported"),
        (lambda d: d["effects"][0].update(heldout_gain=0.9), "gain of each effect"),
        (lambda d: d["compliance_urad_per_Nm"].update(before=[0.6]), "compliances of the declared model"),
        (lambda d: d["heldout"]["after"].update(p95_m=1e-4), "errors after"),
        (lambda d: d["heldout"].update(reduction_std_error=0.01), "standard error of the reduction"),
        (lambda d: d["heldout"].update(share_below_max=0.9), "poses, share below the largest error"),
        (lambda d: d["heldout"]["outside_range"].update(poses=2), "poses, share below the largest error"),
        (lambda d: d["heldout"].update(noise_floor_rms_m=1.1e-4), "what the noise leaves"),
    ],
)
def test_a_figure_altered_is_found(run, change, expected):
    assert expected in of_verdict(run, change)


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ("before_rms_m_high", "intervals hold their before_rms_m"),
        ("after_rms_m", "held-out errors, standard error of the reduction"),
        ("reduction_std_error", "held-out errors, standard error of the reduction"),
    ],
)
def test_an_error_or_interval_altered_is_found(run, column, expected):
    assert expected in of_splits(run, column, 0.8)
