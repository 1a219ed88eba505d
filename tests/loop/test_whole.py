"""The whole loop in one call reaches every kind of verdict, and the diagnosis never sees
held-out measurements."""

import json
from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_folders import PLAN, make_folder, make_table
from selected import slow_but
from small_data import service_arm_folder

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import diagnose_folder, read_cases

# Loads in both senses, which reveal an error that is odd in the load.
BOTH_SENSES = replace(PLAN, poses=40, ladder=(0, 1, -1))
USUAL = replace(PLAN, poses=30)


def add_offset_and_harmonic(table):
    """Add an offset of half a milliradian to joint 3, and a harmonic error to joint 5."""
    return table | {
        "q3": table["q3"] - 5e-4,
        "q5": table["q5"] - 1e-3 * np.cos(2 * table["q5"]),
    }


def add_unknown_error(table):
    """Displace joints 1 and 2 by functions of the other joints' angles that are odd in
    the load; the catalogue has no such effect."""
    q1 = 2e-4 * table["load"] * np.cos(1.5 * table["q2"] + table["q3"])
    q2 = 2e-4 * table["load"] * np.sin(table["q1"] + 1.5 * table["q3"])
    return table | {"q1": table["q1"] - q1, "q2": table["q2"] - q2}


def keep_unloaded(table):
    """Keep one unloaded measurement of each target in each pose."""
    keys = np.column_stack(
        [table["pose"], np.unique(table["target"], return_inverse=True)[1]]
    )
    first = np.sort(np.unique(keys[table["load"] == 0], axis=0, return_index=True)[1])
    rows = np.flatnonzero(table["load"] == 0)[first]
    return {
        name: values[rows] for name, values in table.items() if name[0] not in "rfm"
    } | {"repeat": 0 * rows}


UNKNOWN = {point: {"point": point, "offset_m": "unknown"} for point in PLAN.points}
NOTHING_KNOWN = {
    "targets": UNKNOWN,
    "frame": "tracker",
    "compliance": "nominal",
    "noise": {"position_m": 0.05},
}
KINDS = {
    "adequate": (lambda table: table, USUAL, {}),
    "several": (add_offset_and_harmonic, USUAL, {}),
    "unexplained": (add_unknown_error, BOTH_SENSES, {}),
    "not_testable": (keep_unloaded, PLAN, NOTHING_KNOWN),
    "named": (lambda table: table | {"q3": -table["q3"]}, PLAN, {}),
}
NAMES = {"several": ["joint_offset", "transmission_harmonic"]}


def sort_by_pose(table):
    """Sort measurements pose by pose, as people measure."""
    order = np.lexsort((table["repeat"], table["load"], table["pose"]))
    return {name: table[name][order] for name in table}


def make_kind(path, robot, kind):
    change, plan, settings = KINDS[kind]
    table = sort_by_pose(change(make_table(robot, "made", seed=3, plan=plan)))
    return make_folder(path / "made", robot, table=table, **settings)


@pytest.mark.parametrize(
    "kind", slow_but(["several"], [kind for kind in KINDS if kind != "named"])
)
def test_the_loop_reaches_each_kind_of_verdict(kind, kuka, tmp_path):
    verdict = diagnose_folder(make_kind(tmp_path, kuka, kind), ROBOTS, 1)
    json.dumps(verdict, allow_nan=False)
    probabilities = verdict["probabilities"]
    heldout = verdict["heldout"]
    assert verdict["verdict"] == kind, probabilities
    assert sorted(effect["name"] for effect in verdict["effects"]) == NAMES.get(
        kind, []
    )
    assert sum(
        entry["probability"] for entry in probabilities["sets"]
    ) == pytest.approx(1.0, abs=0.05)
    alarmed = probabilities["alarm_p_value"] <= Settings().alarm_level
    assert alarmed == (kind not in ("adequate", "not_testable"))
    if verdict["effects"]:
        assert heldout["after"]["rms_m"] < 0.7 * heldout["declared"]["rms_m"]
        (effect,) = (
            entry for entry in verdict["effects"] if entry["name"] == "joint_offset"
        )
        assert effect["locations"][0]["location"] == "joint 3" and 3 in effect["joints"]
        (parameter,) = effect["parameters"]
        assert parameter["value"] == pytest.approx(5e-4, abs=4 * parameter["std_error"])
    else:
        assert heldout["after"] == heldout["declared"]


def test_a_fault_of_the_data_is_named_without_a_statement_on_the_model(kuka, tmp_path):
    verdict = diagnose_folder(make_kind(tmp_path, kuka, "named"), ROBOTS, 1)
    json.dumps(verdict, allow_nan=False)
    (effect,) = verdict["effects"]
    assert (effect["name"], effect["family"]) == ("wrong_sign", "data")
    assert verdict["verdict"] == "named"
    assert verdict["candidates_tested"] == 0 and verdict["probabilities"] is None
    # The residual of faulty measurements says nothing about the model.
    assert not any("times the noise" in warning for warning in verdict["warnings"])


def test_no_step_before_the_judgement_depends_on_held_out_measurements(kuka, tmp_path):
    """Shift held-out measurements by a metre and change their loads and angles: the
    diagnosis stays the same to the last digit."""
    folder = make_kind(tmp_path, kuka, "several")
    case, held_out = read_cases(folder, ROBOTS)
    held_out_poses = set(
        zip(
            held_out.campaign.measurements.session,
            held_out.campaign.measurements.pose,
            strict=True,
        )
    )
    table = sort_by_pose(
        add_offset_and_harmonic(make_table(kuka, "made", seed=3, plan=USUAL))
    )
    is_held_out = np.array(
        [
            (0, pose) in held_out_poses or (1, pose) in held_out_poses
            for pose in table["pose"]
        ]
    )
    assert 0 < is_held_out.sum() < len(is_held_out)
    for name, change in (
        ("x", 1.0),
        ("z", -0.5),
        ("q2", 0.3),
        ("fx", 300.0 * (table["load"] != 0)),
    ):
        table[name] = table[name] + change * is_held_out
    altered_folder = make_folder(tmp_path / "altered" / "made", kuka, table=table)
    altered, altered_held_out = read_cases(altered_folder, ROBOTS)
    assert (
        np.abs(
            altered_held_out.campaign.measurements.position
            - held_out.campaign.measurements.position
        ).max()
        > 0.9
    )
    diagnosis = diagnose(case, Settings(), 1)
    altered_diagnosis = diagnose(altered, Settings(), 1)
    assert diagnosis.document == altered_diagnosis.document
    for step, altered_step in zip(
        diagnosis.steps, altered_diagnosis.steps, strict=True
    ):
        np.testing.assert_array_equal(
            step.fitted.covariance, altered_step.fitted.covariance
        )
    verdicts = [
        judge(diagnosis, poses, 1).document for poses in (held_out, altered_held_out)
    ]
    assert verdicts[0]["heldout"] != verdicts[1]["heldout"]
    different = {key for key in verdicts[0] if verdicts[0][key] != verdicts[1][key]}
    assert different <= {"heldout", "effects", "warnings"}


@pytest.mark.slow
def test_a_calibration_by_few_poses_is_no_worse_than_none(tmp_path):
    """Without priors, the error would be 1.12 times that of fitted frames alone."""
    ratios = []
    for seed in range(4):
        training, held_out = read_cases(
            service_arm_folder(tmp_path / f"arm{seed}", seed), ROBOTS
        )
        heldout = judge(diagnose(training, Settings(), 1), held_out, 1).document[
            "heldout"
        ]
        ratios.append(heldout["after"]["rms_m"] / heldout["before"]["rms_m"])
    assert np.exp(np.log(ratios).mean()) < 1.03
