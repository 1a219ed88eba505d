"""The list of cases, and the making of one."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="the blind proof needs the extra `blind`")

from elastocal.blind.cases import (
    FOREIGN,
    LEVELS,
    NAMED,
    SETTINGS,
    SIZES,
    Case,
    block_of,
    cases_of,
    design_of,
    make_case,
    specimen_of,
    write_manifest,
)
from elastocal.campaign import read_campaign

ROBOTS = Path(__file__).resolve().parents[2] / "config" / "robots"


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
    proof = [case for case in cases if case.robot != "kuka"]
    assert sum(case.group == "none" for case in proof) >= 500
    for effect in NAMED:
        for level in LEVELS:
            assert sum(c.group == "single" and c.effects == (effect,) and c.levels == (level,) for c in proof) >= 40
    for effect in FOREIGN:
        assert sum(c.group == "outside" and c.effects == (effect,) and c.levels == (200.0,) for c in proof) >= 40
    assert sum(c.group == "pair" and c.levels == (200.0, 200.0) for c in proof) >= 150
    assert {case.setting for case in cases if case.group != "sweep"} == set(SETTINGS)
    assert {case.robot for case in cases} == {"kuka", "fanuc", "abb"}


def test_names_are_distinct_and_tell_neither_effect_nor_order():
    cases = cases_of(SIZES["full"], 1)
    assert len({case.name for case in cases}) == len(cases)
    assert len({case.seed for case in cases}) == len(cases)
    groups = [case.group for case in cases[:200]]
    assert len(set(groups)) >= 4


def test_more_cases_change_none_that_is_there_and_another_seed_changes_all():
    few = {case.key: case for case in cases_of(SIZES["quick"], 1)}
    more = {case.key: case for case in cases_of(replace(SIZES["quick"], none=30, single=2), 1)}
    assert all(more[key] == case for key, case in few.items())
    other = {case.name for case in cases_of(SIZES["quick"], 2)}
    assert not other & {case.name for case in few.values()}


def test_blocks_share_all_cases_out():
    cases = cases_of(SIZES["quick"], 1)
    blocks = [block_of(cases, number, 3) for number in (1, 2, 3)]
    assert sorted((case for block in blocks for case in block), key=lambda case: case.name) == cases


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


def test_a_pair_has_both_each_at_its_own_non_centrality(tmp_path):
    _, truth = made(a_case(("joint_offset", "hysteresis"), (50.0, 200.0)), tmp_path)
    assert [d["effect"] for d in truth["defects"]] == ["joint_offset", "hysteresis"]
    assert [round(d["signal"]["retained"], -1) for d in truth["defects"]] == [50.0, 200.0]


@pytest.mark.parametrize("setting", sorted(SETTINGS))
def test_each_setting_makes_a_campaign_that_can_be_read(tmp_path, setting):
    case = a_case(setting=setting)
    campaign, truth = made(case, tmp_path)
    assert truth["case"]["setting"] == setting
    assert not truth["defects"]
    design = design_of(case)
    for covariate, column in (("approach", "approach"), ("time", "time_s"), ("temperature", "temperature_c")):
        assert (getattr(campaign.readings, column) is not None) == (covariate in design.covariates)
    assert bool(truth["outliers"]) == setting.startswith("outliers")
    if setting.startswith("declared"):
        ratio = float(setting.rpartition("_")[2])
        assert campaign.noise["position_m"] == pytest.approx(ratio * 60e-6)
        assert campaign.readings.repeat.max() == 0
    assert campaign.frame == ("tracker" if setting == "unknown_frame" else "base")


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
    assert files == ["campaign.yaml", "measurements.parquet"]
    content = b"".join(path.read_bytes() for path in (tmp_path / "blind").rglob("*") if path.is_file())
    for word in (b"lost_motion", b"seed", b"usual", str(case.seed).encode(), tmp_path.name.encode()):
        assert word not in content


def test_a_manifest_names_the_hash_of_every_truth(tmp_path):
    write_manifest(tmp_path / "manifest.txt", {"case_b": "22", "case_a": "11"})
    assert (tmp_path / "manifest.txt").read_text() == "11  case_a.json\n22  case_b.json\n"
