"""The whole loop in one call: every kind of verdict, and a wall before the held-out
poses."""

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

# Loads in both senses, for what comes with the load and is in no catalogue.
BOTH_SENSES = replace(PLAN, poses=40, ladder=(0, 1, -1))
USUAL = replace(PLAN, poses=30)


def offset_and_harmonic(table):
    """Joint 3 half a milliradian beyond what it reports, and a wave of joint 5."""
    return table | {
        "q3": table["q3"] - 5e-4,
        "q5": table["q5"] - 1e-3 * np.cos(2 * table["q5"]),
    }


def foreign(table):
    """Joints 1 and 2 displaced by functions of other joints' angles, odd in the
    load."""
    q1 = 2e-4 * table["load"] * np.cos(1.5 * table["q2"] + table["q3"])
    q2 = 2e-4 * table["load"] * np.sin(table["q1"] + 1.5 * table["q3"])
    return table | {"q1": table["q1"] - q1, "q2": table["q2"] - q2}


def hidden(table):
    """Unloaded, each target once in a pose: beside a noise of centimetres nothing
    shows."""
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
    "several": (offset_and_harmonic, USUAL, {}),
    "unexplained": (foreign, BOTH_SENSES, {}),
    "not_testable": (hidden, PLAN, NOTHING_KNOWN),
    "named": (lambda table: table | {"q3": -table["q3"]}, PLAN, {}),
}
NAMES = {"several": ["joint_offset", "transmission_harmonic"]}


def in_order(table):
    """Pose by pose, as people measure."""
    order = np.lexsort((table["repeat"], table["load"], table["pose"]))
    return {name: table[name][order] for name in table}


def folder_of(path, robot, kind):
    change, plan, settings = KINDS[kind]
    table = in_order(change(make_table(robot, "made", seed=3, plan=plan)))
    return make_folder(path / "made", robot, table=table, **settings)


@pytest.mark.parametrize("kind", slow_but(["several", "named"], KINDS))
def test_verdict_is(kind, kuka, tmp_path):
    verdict = diagnose_folder(folder_of(tmp_path, kuka, kind), ROBOTS, 1)
    json.dumps(verdict, allow_nan=False)
    if kind == "named":
        # What is left of measurements that are wrong in themselves is no statement on
        # the model.
        (effect,) = verdict["effects"]
        assert (effect["name"], effect["family"], verdict["verdict"]) == (
            "wrong_sign",
            "data",
            "named",
        )
        assert verdict["candidates_tested"] == 0 and verdict["probabilities"] is None
        assert not [
            warning for warning in verdict["warnings"] if "times the noise" in warning
        ]
        return
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
        assert heldout["after"]["rms_m"] < 0.7 * heldout["before"]["rms_m"]
        (effect,) = (
            entry for entry in verdict["effects"] if entry["name"] == "joint_offset"
        )
        assert effect["locations"][0]["location"] == "joint 3" and 3 in effect["joints"]
        (parameter,) = effect["parameters"]
        assert parameter["value"] == pytest.approx(5e-4, abs=4 * parameter["std_error"])
    else:
        assert heldout["after"] == heldout["before"]


def test_no_step_before_the_judgement_depends_on_held_out_measurements(kuka, tmp_path):
    """Held-out measurements a metre off, or at other loads and angles, change nothing
    of the diagnosis, to the last digit."""
    folder = folder_of(tmp_path, kuka, "several")
    case, held_out = read_cases(folder, ROBOTS)
    unseen = set(
        zip(
            held_out.campaign.measurements.session,
            held_out.campaign.measurements.pose,
            strict=True,
        )
    )
    table = in_order(offset_and_harmonic(make_table(kuka, "made", seed=3, plan=USUAL)))
    mine = np.array(
        [(0, pose) in unseen or (1, pose) in unseen for pose in table["pose"]]
    )
    assert 0 < mine.sum() < len(mine)
    for name, change in (
        ("x", 1.0),
        ("z", -0.5),
        ("q2", 0.3),
        ("fx", 300.0 * (table["load"] != 0)),
    ):
        table[name] = table[name] + change * mine
    spoilt_folder = make_folder(tmp_path / "spoilt" / "made", kuka, table=table)
    spoilt, spoilt_held_out = read_cases(spoilt_folder, ROBOTS)
    assert (
        np.abs(
            spoilt_held_out.campaign.measurements.position
            - held_out.campaign.measurements.position
        ).max()
        > 0.9
    )
    one, other = (diagnose(each, Settings(), 1) for each in (case, spoilt))
    assert one.document == other.document
    for mine, theirs in zip(one.steps, other.steps, strict=True):
        np.testing.assert_array_equal(mine.fitted.covariance, theirs.fitted.covariance)
    verdicts = [judge(one, part, 1).document for part in (held_out, spoilt_held_out)]
    assert verdicts[0]["heldout"] != verdicts[1]["heldout"]
    different = {key for key in verdicts[0] if verdicts[0][key] != verdicts[1][key]}
    assert different <= {"heldout", "effects", "warnings"}


@pytest.mark.slow
def test_a_calibration_by_few_poses_is_no_worse_than_none(tmp_path):
    """Without priors these end at 1.12 times the error of frames alone."""
    ratios = []
    for seed in range(4):
        training, held_out = read_cases(
            service_arm_folder(tmp_path / f"arm{seed}", seed), ROBOTS
        )
        heldout = judge(diagnose(training, Settings(), 1), held_out, 1).document[
            "heldout"
        ]
        ratios.append(heldout["after"]["rms_m"] / heldout["uncalibrated"]["rms_m"])
    assert np.exp(np.log(ratios).mean()) < 1.03
