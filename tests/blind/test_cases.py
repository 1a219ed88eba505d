"""The list of cases, and the making of one."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal.campaigns.reading import read_campaign
from elastocal_proof.blind.cases import (
    FOREIGN,
    HARD,
    NAMED,
    PROOF,
    SETTINGS,
    SIZES,
    TUNED,
    Case,
    cases_of,
    defects_of,
    design_of,
    make_case,
    specimen_of,
    write_manifest,
)
from elastocal_proof.plant.campaigns import schedule_of
from elastocal_proof.plant.defects import KINDS, with_defects
from elastocal_proof.plant.physical_robot import seen_poses


def a_case(effects=(), levels=(), setting="usual", robot="fanuc", seed=5):
    return Case("/".join([*effects, setting]), "single", robot, effects, levels, setting, seed)


def made(case, folder):
    """Campaign and truth of a case."""
    digest = make_case(case, folder / "blind", folder / "sealed", ROBOTS)
    text = (folder / "sealed" / f"{case.name}.json").read_bytes()
    assert hashlib.sha256(text).hexdigest() == digest
    return read_campaign(folder / "blind" / case.name, ROBOTS), json.loads(text)


def test_the_full_size_has_the_nulls_effects_levels_and_robots_that_the_protocol_asks_for():
    cases = cases_of(SIZES["full"], 1)
    proof = [case for case in cases if case.robot in PROOF]
    assert sum(case.group == "none" for case in proof) == 1000
    for setting in HARD:
        assert sum(not case.effects and case.setting == setting for case in proof) == 200
    for effect in NAMED:
        # An arm without a gravity compensator has none that is wrong.
        for level in (25.0, 50.0, 200.0):
            found = sum(c.group == "single" and c.effects == (effect,) and c.levels == (level,) for c in proof)
            assert found == (8 if effect.startswith("compensator") else 16)
    for effect in FOREIGN:
        assert sum(c.group == "outside" and c.effects == (effect,) and c.levels == (200.0,) for c in proof) == 20
    for level in (50.0, 200.0):
        assert sum(c.group == "pair" and c.levels == (level, level) for c in proof) == 200
    for group in ("several_joints", "gear_gravity"):
        assert sum(c.group == group for c in proof) >= 200
    assert {case.setting for case in cases if case.group != "sweep"} == set(SETTINGS)
    assert {case.robot for case in cases} == {*PROOF, *TUNED}


def test_only_the_full_size_shows_the_robots_of_the_proof():
    for size in ("smoke", "quick", "development"):
        assert {case.robot for case in cases_of(SIZES[size], 1)} <= set(TUNED)
    assert len(cases_of(SIZES["quick"], 1)) <= 150


def test_cases_to_develop_on_are_in_no_other_size_even_at_the_same_seed():
    developed = {case.seed for case in cases_of(SIZES["development"], 1)}
    assert not developed & {case.seed for size in ("quick", "full") for case in cases_of(SIZES[size], 1)}
    assert {case.group for case in cases_of(SIZES["development"], 1)} >= {
        "several_joints",
        "gear_gravity",
        "moved",
        "undeclared",
    }


def test_a_single_case_has_its_effect_at_its_non_centrality(tmp_path):
    _, truth = made(a_case(("lost_motion",), (50.0,)), tmp_path)
    (defect,) = truth["defects"]
    assert defect["effect"] == "lost_motion"
    assert defect["of"] == "retained"
    assert defect["signal"]["retained"] == pytest.approx(50.0, rel=0.011)
    assert defect["signal"]["raw"] > defect["signal"]["retained"]
    assert defect["signal"]["rms_m"] > 0
    assert truth["seed"] == 5


def test_a_wrong_force_scale_is_told_to_be_absorbed(tmp_path):
    _, truth = made(a_case(("force_scale",), (50.0,)), tmp_path)
    assert truth["defects"][0]["of"] == "raw"
    assert truth["defects"][0]["signal"]["retained"] < 0.1


def test_what_no_size_makes_so_visible_has_the_largest_size_that_means_anything():
    """The force of a load cell that is off by a tenth shows less than a non-centrality of 10,000."""
    case = a_case(("force_scale",), (1e4,))
    ((defect, sizing),) = defects_of(case, specimen_of(case, ROBOTS), design_of(case))
    assert (defect.size, sizing["of"]) == (KINDS["force_scale"].largest, "raw")
    assert 10.0 < sizing["signal"]["raw"] < 1e4


@pytest.mark.parametrize("setting", sorted(SETTINGS))
def test_each_setting_makes_a_campaign_that_can_be_read(tmp_path, setting):
    case = a_case(setting=setting)
    campaign, truth = made(case, tmp_path)
    assert truth["case"]["setting"] == setting
    assert not truth["defects"]
    design = design_of(case)
    for covariate, column in (("approach", "approach"), ("time", "time_s"), ("temperature", "temperature_c")):
        assert (getattr(campaign.measurements, column) is not None) == (covariate in design.covariates)
    assert bool(truth["outliers"]) == setting.startswith("outliers")
    if setting.startswith("declared"):
        ratio = float(setting.rpartition("_")[2])
        assert campaign.noise["position_m"] == pytest.approx(ratio * 60e-6)
        assert campaign.measurements.repeat.max() == 0
    assert campaign.frame == ("tracker" if setting == "unknown_frame" else "base")


def test_weight_is_hidden_where_it_is_the_effect_and_declared_elsewhere(tmp_path):
    hidden, truth = made(a_case(("link_weight",), (50.0,)), tmp_path)
    assert not hidden.robot.masses and len(truth["masses"]) in (1, 5)
    told, truth = made(a_case(("payload",), (50.0,)), tmp_path)
    assert len(told.robot.masses) == len(truth["masses"]) == 7


@pytest.mark.parametrize("seed", range(5))
def test_gear_defects_under_gravity_sit_at_the_shoulder_or_the_elbow(seed):
    case = replace(a_case(("stiffening",), (200.0,), seed=seed), group="gear_gravity")
    ((defect, _),) = defects_of(case, specimen_of(case, ROBOTS), design_of(case))
    assert defect.joints in ((2,), (3,))


@pytest.mark.parametrize("setting", ["usual", "without_time_and_temperature"])
def test_a_stand_that_is_knocked_moves_all_measurements_after_one_row_among_the_training_poses(setting):
    case = replace(a_case(("setup_step",), (200.0,), setting=setting), group="moved")
    robot, design = specimen_of(case, ROBOTS), design_of(case)
    bad = with_defects(robot, [defect for defect, _ in defects_of(case, robot, design)])
    schedule = schedule_of(robot.arm, design, case.seed)
    change = np.abs(seen_poses(bad, schedule)[0] - seen_poses(robot, schedule)[0]).max(axis=(1, 2))
    first = int(np.argmax(change > 1e-9))
    assert (change[:first] < 1e-12).all() and (change[first:] > 1e-6).all()
    poses = np.unique(schedule.pose[schedule.training & (np.arange(len(change)) < first)]).size
    assert 2 <= poses <= 12


def test_repeatability_scatters_the_joints_of_a_robot_by_its_setting():
    laws = specimen_of(a_case(setting="repeatability"), ROBOTS).drives
    assert len(laws) == 1
    assert 1e-5 <= min(laws[0].sigma_rad) <= max(laws[0].sigma_rad) <= 3e-5
    assert specimen_of(a_case(), ROBOTS).drives == ()


def test_a_case_is_made_the_same_again(tmp_path):
    case = a_case(("thermal_growth",), (25.0,), robot="abb")
    for folder in ("one", "two"):
        made(case, tmp_path / folder)
    for path in (f"blind/{case.name}/measurements.parquet", f"sealed/{case.name}.json"):
        assert (tmp_path / "one" / path).read_bytes() == (tmp_path / "two" / path).read_bytes()


def test_nothing_of_the_truth_lies_in_the_blind_folder(tmp_path):
    case = a_case(("lost_motion",), (50.0,), seed=187654321)
    made(case, tmp_path)
    files = sorted(path.name for path in (tmp_path / "blind").rglob("*") if path.is_file())
    assert files == ["campaign.yaml", "measurements.parquet", "robot.yaml"]
    content = b"".join(path.read_bytes() for path in (tmp_path / "blind").rglob("*") if path.is_file())
    for word in (b"lost_motion", b"seed", b"usual", str(case.seed).encode(), tmp_path.name.encode()):
        assert word not in content


def test_a_manifest_names_the_hash_of_every_truth(tmp_path):
    write_manifest(tmp_path / "manifest.txt", {"case_b": "22", "case_a": "11"})
    assert (tmp_path / "manifest.txt").read_text() == "11  case_a.json\n22  case_b.json\n"


def test_bad_rows_are_planted_and_sealed_and_a_base_is_tilted_against_its_own_frame(tmp_path):
    clean, _ = made(a_case(), tmp_path / "clean")
    for setting in ("bad_rows", "tilted_base"):
        campaign, truth = made(a_case(setting=setting), tmp_path / setting)
        off = np.linalg.norm(campaign.measurements.position - clean.measurements.position, axis=1)
        if setting == "bad_rows":
            rows = {row for slip in truth["bad_rows"] for row in slip["rows"]}
            read = [part.astype(float) for part in (campaign.measurements.wrench, campaign.measurements.joint_angles)]
            same = [clean.measurements.wrench, clean.measurements.joint_angles]
            apart = (off > 0) | (read[0] != same[0]).any(axis=1) | (read[1] != same[1]).any(axis=1)
            turn = campaign.measurements.rotation_vector != clean.measurements.rotation_vector
            assert set(np.flatnonzero(apart | turn.any(axis=1)).tolist()) == rows
            assert 1 <= len(truth["bad_rows"]) <= 3 and "misplaced" not in truth
        else:
            turn = np.linalg.norm(truth["misplaced"]["turn_rad"])
            assert 1e-5 < turn < 1.2e-3 and "bad_rows" not in truth
            # A tilt moves what is far from the base more.
            assert off.min() < off.max() < 2e-3
