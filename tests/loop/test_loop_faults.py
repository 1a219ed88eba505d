"""Whatever is wrong with the measurements, the loop ends with a verdict that says so and with a report."""

import json

import numpy as np
import pytest
from analysed_robots import ROBOTS
from loop_scripts import run_loop
from made_folders import made_folder, made_table
from scipy.spatial.transform import Rotation
from selected import slow_but

from elastocal.loop.whole import diagnosed

PLACE, TURN = np.array([2.0, 0.6, -0.2]), np.array([0.3, -0.5, 1.2])
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
POSE = {"measured": "pose", "noise": {"position_m": 6e-5, "orientation_rad": 6e-5}}


def scaled(table, names, factor):
    return table | {name: factor * table[name] for name in names}


def in_tracker_frame(table):
    position = Rotation.from_rotvec(TURN).apply(np.column_stack([table[axis] for axis in "xyz"])) + PLACE
    vectors = np.column_stack([table[f"r{axis}"] for axis in "xyz"])
    turned = (Rotation.from_rotvec(TURN) * Rotation.from_rotvec(vectors)).as_rotvec()
    columns = np.column_stack([position, turned]).T
    return table | dict(zip(("x", "y", "z", "rx", "ry", "rz"), columns, strict=True))


def shuffled(table):
    order = np.random.default_rng(3).permutation(len(table["x"]))
    return table | {name: table[name][order] for name in ("x", "y", "z", "rx", "ry", "rz")}


FAULTS = {
    "loads turned": (lambda t: scaled(t, WRENCH, -1), {}, "wrong_sign", "the loads fit turned round"),
    "kilonewtons": (lambda t: scaled(t, WRENCH, 1e-3), {}, "wrong_unit", "kilonewtons"),
    "tracker's frame, poses": (in_tracker_frame, POSE, "wrong_frame", "the robot would stand 2.1 m away"),
    "z turned": (lambda t: scaled(t, "z", -1), {}, "swapped_axes", "z = -z"),
    "rows shuffled": (shuffled, {}, "shuffled_rows", "measured columns of another"),
    "positions constant": (lambda t: t | {axis: 0 * t[axis] + 1.5 for axis in "xyz"}, {}, "constant_columns", "the same"),
}
# Those whose tables, figures and pages have the least in common: they go through the scripts, the others to the verdict alone.
REPORTED = {
    "nonsense": (
        lambda t: t | {axis: np.random.default_rng(5).normal(size=len(t["x"])) for axis in "xyz"},
        {},
        "implausible_measurements",
        "from where the robot file puts them",
    ),
    "joint 3 turned": (lambda t: scaled(t, ["q3"], -1), {}, "wrong_sign", "joint 3 has the wrong sense"),
    "poses zero": (lambda t: scaled(t, ["x", "y", "z", "rx", "ry", "rz"], 0), POSE, "constant_columns", "zero"),
}


def folder_of(path, robot, change, settings):
    table = change(made_table(robot, "made"))
    if settings.get("measured") != "pose":
        table = {name: values for name, values in table.items() if name not in ("rx", "ry", "rz")}
    return made_folder(path, robot, table=table, **settings)


def check(verdict, name, words):
    (effect,) = verdict["effects"]
    assert (effect["name"], effect["family"], verdict["verdict"]) == (name, "data", "named")
    assert words in effect["detail"] and verdict["candidates_tested"] == 0 and verdict["probabilities"] is None
    # What is left of measurements that are wrong in themselves is no statement on the model.
    assert not [warning for warning in verdict["warnings"] if "times the noise" in warning]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_decisive_fault_ends_in_a_verdict_that_names_it(fault, kuka, tmp_path):
    change, settings, name, words = FAULTS[fault]
    verdict = diagnosed(folder_of(tmp_path / "made", kuka, change, settings), ROBOTS, 1)
    json.dumps(verdict, allow_nan=False)
    check(verdict, name, words)


def reported(folder, out):
    """The verdict of a campaign that went through the scripts to its report."""
    run_loop(folder, ROBOTS, out)
    assert (out / "report.pdf").read_bytes().startswith(b"%PDF")
    assert "<title>Calibration report: made</title>" in (out / "page.html").read_text(encoding="utf-8")
    return json.loads((out / "verdict.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("fault", slow_but(["nonsense"], REPORTED))
def test_a_decisive_fault_ends_in_a_verdict_and_in_a_report(fault, kuka, tmp_path):
    change, settings, name, words = REPORTED[fault]
    check(reported(folder_of(tmp_path / "made", kuka, change, settings), tmp_path / "out"), name, words)


@pytest.mark.slow
def test_nothing_testable_ends_in_a_verdict_and_a_report(kuka, tmp_path):
    """Unloaded, each target once in a pose, beside a noise of a decimetre: there is no fault, and nothing shows."""
    table = made_table(kuka, "made")
    keys = np.column_stack([table["pose"], np.unique(table["target"], return_inverse=True)[1]])
    rows = np.flatnonzero(table["load"] == 0)
    rows = rows[np.sort(np.unique(keys[rows], axis=0, return_index=True)[1])]
    kept = {name: values[rows] for name, values in table.items() if name not in ("rx", "ry", "rz", *WRENCH)}
    kept["repeat"] = 0 * rows
    targets = {point: {"point": point, "offset_m": "unknown"} for point in ("3DoF", "6DoF")}
    unknown = {"targets": targets, "frame": "tracker", "compliance": "nominal", "noise": {"position_m": 0.1}}
    folder = made_folder(tmp_path / "made", kuka, table=kept, **unknown)
    verdict = reported(folder, tmp_path / "out")
    assert verdict["verdict"] == "not_testable" and verdict["effects"] == []
