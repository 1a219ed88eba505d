"""Whatever is wrong with the measurements, the loop ends with a verdict that says so and with a report."""

import json

import numpy as np
import pytest
from analysed_robots import ROBOTS
from loop_scripts import run_loop
from made_folders import made_folder, made_table
from selected import slow_but

POSE = {"measured": "pose", "noise": {"position_m": 6e-5, "orientation_rad": 6e-5}}
# Those whose tables, figures and pages have the least in common.
FAULTS = {
    "nonsense": (
        lambda t: t | {axis: np.random.default_rng(5).normal(size=len(t["x"])) for axis in "xyz"},
        {},
        "implausible_measurements",
        "from where the robot file puts them",
    ),
    "joint 3 turned": (lambda t: t | {"q3": -t["q3"]}, {}, "wrong_sign", "joint 3 has the wrong sense"),
    "poses zero": (
        lambda t: t | {name: 0 * t[name] for name in ("x", "y", "z", "rx", "ry", "rz")},
        POSE,
        "constant_columns",
        "zero",
    ),
}


@pytest.mark.parametrize("fault", slow_but(["nonsense"], FAULTS))
def test_a_decisive_fault_ends_in_a_verdict_and_in_a_report(fault, kuka, tmp_path):
    change, settings, name, words = FAULTS[fault]
    table = change(made_table(kuka, "made"))
    if not settings:
        table = {name: values for name, values in table.items() if name not in ("rx", "ry", "rz")}
    out = run_loop(made_folder(tmp_path / "made", kuka, table=table, **settings), ROBOTS, tmp_path / "out")
    assert (out / "report.pdf").read_bytes().startswith(b"%PDF")
    assert "<title>Calibration report: made</title>" in (out / "page.html").read_text(encoding="utf-8")
    verdict = json.loads((out / "verdict.json").read_text(encoding="utf-8"))
    (effect,) = verdict["effects"]
    assert (effect["name"], effect["family"], verdict["verdict"]) == (name, "data", "named")
    assert words in effect["detail"] and verdict["candidates_tested"] == 0 and verdict["probabilities"] is None
    # What is left of measurements that are wrong in themselves is no statement on the model.
    assert not [warning for warning in verdict["warnings"] if "times the noise" in warning]
