"""The list of blind cases, and the making of one case."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_blind_documents import PLAN
from scipy.stats import binom

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_campaign
from elastocal_proof.blind.cases import (
    CATALOGUE_EFFECTS,
    OUTSIDE_EFFECTS,
    PROOF,
    BlindCase,
    build_noncentrality_model,
    list_cases,
    size_defects,
    write_sealed_case,
)
from elastocal_proof.plant.kinds import KINDS

SETTINGS = PLAN["settings"]
# Digest of the names and seeds of the quick cases of seed 1, whose effects include
# declared masses.
NAMES_DIGEST = "2337bc6da1e6"
LATER_SETTINGS = ("many_poses", "reflectors_off", "masses_without_compliances")


def make_case(
    effects=(),
    levels=(),
    setting="usual",
    robot="fanuc",
    seed=5,
    group="single",
    **fields,
):
    return BlindCase(
        "/".join([*effects, setting]),
        group,
        robot,
        effects,
        levels,
        setting,
        seed,
        changes=SETTINGS[setting],
        **fields,
    )


def write_and_read(case, folder):
    """Write a case, and return its campaign and its ground truth."""
    digest = write_sealed_case(case, folder / "blind", folder / "sealed", ROBOTS)
    sealed = (folder / "sealed" / f"{case.name}.json").read_bytes()
    assert hashlib.sha256(sealed).hexdigest() == digest
    campaign_folder = read_campaign_folder(folder / "blind" / case.name, ROBOTS)
    return read_campaign(campaign_folder), json.loads(sealed)


def draw_sized_defects(case):
    return size_defects(
        case, build_noncentrality_model(case, case.build_specimen(ROBOTS))
    )


@pytest.fixture(scope="module")
def registered():
    return list_cases(PLAN, "registered", 1)


def test_the_registered_size_has_the_robots_null_cases_and_settings_of_the_protocol(
    registered,
):
    assert {case.robots for case in registered} == {PROOF}
    robots = {case.robot for case in registered}
    assert robots == {"xarm7", "rizon10", "kr120", "rx160"}
    assert len(registered) <= 2000
    assert sum(case.group == "none" for case in registered) == 320
    for setting, changes in SETTINGS.items():
        if changes.get("hard"):
            null_cases = [
                case
                for case in registered
                if case.setting == setting and not case.effects
            ]
            assert len(null_cases) == 24
    assert {case.setting for case in registered} == set(SETTINGS)
    assert len({case.name for case in registered}) == len(registered)


def test_the_registered_size_has_the_effects_and_levels_of_the_protocol(registered):
    def count(group, **fields):
        expected = {"group": group, **fields}.items()
        return sum(expected <= vars(case).items() for case in registered)

    for effect in CATALOGUE_EFFECTS:
        # One of the four robots has a gravity compensator, which can be wrong.
        expected = 2 if effect.startswith("compensator") else 8
        for level in (25.0, 50.0, 200.0):
            assert count("single", effects=(effect,), levels=(level,)) == expected
    for effect in OUTSIDE_EFFECTS:
        assert count("outside", effects=(effect,), levels=(200.0,)) == 12
    for level in (50.0, 200.0):
        assert count("pair", levels=(level, level)) == 48
    assert count("several_joints") == 52
    assert count("gear_gravity") == 64
    assert count("remains") == 32


def test_only_the_registered_contains_robots_of_the_proof():
    for size in ("smoke", "quick", "development"):
        assert {case.robots for case in list_cases(PLAN, size, 1)} == {"tuned"}


def test_cases_to_develop_on_are_in_no_other_size(registered):
    developed = {case.seed for case in list_cases(PLAN, "development", 1)}
    evaluated = [*list_cases(PLAN, "quick", 1), *registered]
    assert not developed & {case.seed for case in evaluated}


def test_names_and_seeds_follow_from_the_seed_and_the_key_alone():
    cases = list_cases(PLAN, "quick", 1)
    assert cases == list_cases(PLAN, "quick", 1)
    assert cases == sorted(cases, key=lambda case: case.name)
    # The sealed documents of earlier runs depend on these names and seeds.
    earlier_cases = [
        case
        for case in cases
        if case.setting not in LATER_SETTINGS and "two_angles" not in case.key
    ]
    names_and_seeds = " ".join(f"{case.name} {case.seed}" for case in earlier_cases)
    digest = hashlib.sha256(names_and_seeds.encode()).hexdigest()
    assert digest[:12] == NAMES_DIGEST
    names_of_another_seed = {case.name for case in list_cases(PLAN, "quick", 2)}
    assert not names_of_another_seed & {case.name for case in cases}


def test_a_defect_has_the_non_centrality_of_its_case():
    [(_, sizing)] = draw_sized_defects(make_case(("lost_motion",), (50.0,)))
    assert sizing["of"] == "retained"
    assert sizing["signal"]["retained"] == pytest.approx(50.0, rel=0.011)
    assert sizing["signal"]["raw"] > sizing["signal"]["retained"]


def test_a_defect_that_the_model_absorbs_is_sized_by_its_raw_non_centrality():
    [(_, sizing)] = draw_sized_defects(make_case(("force_scale",), (50.0,)))
    assert sizing["of"] == "raw"
    assert sizing["signal"]["retained"] < 0.1


def test_a_defect_that_is_too_small_at_its_largest_size_has_that_size():
    # A load cell that is wrong by a tenth has a non-centrality below 10,000.
    [(defect, sizing)] = draw_sized_defects(make_case(("force_scale",), (1e4,)))
    assert defect.size == KINDS["force_scale"].largest
    assert sizing["of"] == "raw"
    assert 10.0 < sizing["signal"]["raw"] < 1e4


@pytest.mark.parametrize("setting", sorted(SETTINGS))
def test_each_setting_makes_a_campaign_that_can_be_read(tmp_path, setting):
    case = make_case(setting=setting)
    campaign, truth = write_and_read(case, tmp_path)
    assert truth["case"]["setting"] == setting
    assert truth["case"]["changes"] == SETTINGS[setting]
    assert not truth["defects"]
    for covariate, column in (
        ("approach", "approach"),
        ("time", "time_s"),
        ("temperature", "temperature_c"),
    ):
        is_present = getattr(campaign.measurements, column) is not None
        assert is_present == (covariate in case.design.covariates)
    if setting.startswith("declared"):
        ratio = SETTINGS[setting]["declared_ratio"]
        assert campaign.noise["position_m"] == pytest.approx(ratio * 60e-6)
        assert campaign.measurements.repeat.max() == 0
    assert campaign.frame == ("tracker" if setting == "unknown_frame" else "base")
    assert bool(campaign.robot.masses) == (setting != "weight_compensated")


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))]
)
def test_each_group_has_its_defects_at_the_right_joints(seed):
    [(gear_defect, _)] = draw_sized_defects(
        make_case(("stiffening",), (200.0,), seed=seed, group="gear_gravity")
    )
    assert gear_defect.joints in ((2,), (3,))
    offsets = draw_sized_defects(
        make_case(("joint_offset",), (200.0,), seed=seed, group="several_joints")
    )
    joints = {defect.joints for defect, _ in offsets}
    assert 3 <= len(joints) == len(offsets) <= 6
    [(undeclared_weight, _)] = draw_sized_defects(
        make_case(("link_weight",), (1e6,), seed=seed, group="undeclared")
    )
    assert undeclared_weight.joints == (2, 3, 4, 5)


def test_a_case_is_reproducible_and_its_blind_folder_reveals_nothing(tmp_path):
    case = replace(make_case(("thermal_growth",), (25.0,), robot="abb"), seed=187654321)
    for folder in ("one", "two"):
        write_and_read(case, tmp_path / folder)
    for path in (f"blind/{case.name}/measurements.parquet", f"sealed/{case.name}.json"):
        first = (tmp_path / "one" / path).read_bytes()
        assert first == (tmp_path / "two" / path).read_bytes()
    files = [path for path in (tmp_path / "one" / "blind").rglob("*") if path.is_file()]
    assert sorted(path.name for path in files) == [
        "campaign.yaml",
        "measurements.parquet",
        "robot.yaml",
    ]
    content = b"".join(path.read_bytes() for path in files)
    for secret in (
        b"thermal_growth",
        b"seed",
        b"usual",
        str(case.seed).encode(),
        tmp_path.name.encode(),
    ):
        assert secret not in content


def test_bad_rows_are_planted_and_sealed(tmp_path):
    clean, _ = write_and_read(make_case(), tmp_path / "clean")
    damaged, truth = write_and_read(make_case(setting="bad_rows"), tmp_path / "bad")
    differs = np.any(
        [
            (
                getattr(damaged.measurements, name) != getattr(clean.measurements, name)
            ).any(axis=1)
            for name in ("position", "rotation_vector", "wrench", "joint_angles")
        ],
        axis=0,
    )
    sealed_rows = {row for slip in truth["bad_rows"] for row in slip["rows"]}
    assert set(np.flatnonzero(differs).tolist()) == sealed_rows
    assert 1 <= len(truth["bad_rows"]) <= 3
    assert "misplaced" not in truth


def test_a_tilted_base_moves_points_more_that_are_farther_from_it(tmp_path):
    clean, _ = write_and_read(make_case(), tmp_path / "clean")
    tilted, truth = write_and_read(
        make_case(setting="tilted_base"), tmp_path / "tilted"
    )
    assert 1e-5 < np.linalg.norm(truth["misplaced"]["turn_rad"]) < 1.2e-3
    assert "bad_rows" not in truth
    displacement_m = np.linalg.norm(
        tilted.measurements.position - clean.measurements.position, axis=1
    )
    assert displacement_m.min() < displacement_m.max() < 2e-3


def test_reflectors_sit_0_3_mm_from_their_declared_places(tmp_path):
    clean, _ = write_and_read(make_case(), tmp_path / "clean")
    moved, truth = write_and_read(make_case(setting="reflectors_off"), tmp_path / "off")
    distances = np.linalg.norm(truth["reflectors_m"], axis=1)
    np.testing.assert_allclose(distances, 3e-4)
    displacement_m = np.linalg.norm(
        moved.measurements.position - clean.measurements.position, axis=1
    )
    np.testing.assert_allclose(displacement_m, 3e-4, rtol=1e-6)
    # Nobody says how exactly the places are known.
    assert {target.offset_std_m for target in moved.targets} == {2e-4}
    assert {target.offset_std_m for target in clean.targets} == {0.0}


def test_a_campaign_without_loads_has_masses_and_no_compliances(tmp_path):
    case = make_case(setting="masses_without_compliances")
    campaign, _ = write_and_read(case, tmp_path)
    assert not campaign.measurements.wrench.any()
    assert campaign.robot.masses
    robot_file = tmp_path / "blind" / case.name / "robot.yaml"
    assert "compliance_urad_per_Nm" not in robot_file.read_text()


def test_the_first_blocks_are_a_random_sample_of_all_groups(registered):
    blocks = PLAN["sizes"]["registered"]["blocks"]
    sample = [
        case for block in range(blocks // 2) for case in registered[block::blocks]
    ]
    for group in {case.group for case in registered}:
        share = np.mean([case.group == group for case in registered])
        hits = sum(case.group == group for case in sample)
        low, high = binom.interval(0.9999, len(sample), share)
        assert low <= hits <= high
