"""The list of cases, and the making of one."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_blind_documents import PLAN

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_campaign
from elastocal_proof.blind.cases import (
    CATALOGUE_EFFECTS,
    OUTSIDE_EFFECTS,
    PROOF,
    BlindCase,
    build_yardstick,
    list_cases,
    size_defects,
    write_sealed_case,
)
from elastocal_proof.plant.kinds import KINDS

SETTINGS = PLAN["settings"]
# Of names and seeds of the quick cases of seed 1, with declared masses among the
# effects.
NAMES = "2337bc6da1e6"


def a_case(
    effects=(),
    levels=(),
    setting="usual",
    robot="fanuc",
    seed=5,
    group="single",
    **more,
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
        **more,
    )


def made(case, folder):
    """Campaign and truth of a case."""
    digest = write_sealed_case(case, folder / "blind", folder / "sealed", ROBOTS)
    text = (folder / "sealed" / f"{case.name}.json").read_bytes()
    assert hashlib.sha256(text).hexdigest() == digest
    files = read_campaign_folder(folder / "blind" / case.name, ROBOTS)
    return read_campaign(files), json.loads(text)


def sized(case):
    robot = case.specimen(ROBOTS)
    return robot, size_defects(case, robot, build_yardstick(case, robot))


def test_the_full_size_has_the_nulls_effects_levels_and_robots_that_the_protocol_asks_for():
    cases = list_cases(PLAN, "full", 1)
    proof = [case for case in cases if case.robots == PROOF]
    assert {case.robot for case in proof} == {"gen3", "irb7600"} and len(proof) == len(
        cases
    ) <= 2000
    assert sum(case.group == "none" for case in proof) == 520
    for setting in (name for name, changes in SETTINGS.items() if changes.get("hard")):
        assert sum(not case.effects and case.setting == setting for case in proof) == 50
    for effect in CATALOGUE_EFFECTS:
        # An arm without a gravity compensator has none that is wrong.
        for level in (25.0, 50.0, 200.0):
            found = sum(
                c.group == "single" and c.effects == (effect,) and c.levels == (level,)
                for c in proof
            )
            assert found == (2 if effect.startswith("compensator") else 4)
    for effect in OUTSIDE_EFFECTS:
        assert (
            sum(
                c.group == "outside" and c.effects == (effect,) and c.levels == (200.0,)
                for c in proof
            )
            == 10
        )
    for level in (50.0, 200.0):
        assert (
            sum(c.group == "pair" and c.levels == (level, level) for c in proof) == 60
        )
    for group, count in (("several_joints", 52), ("gear_gravity", 64), ("remains", 40)):
        assert sum(c.group == group for c in proof) == count
    assert {case.setting for case in cases} == set(SETTINGS)
    assert len({case.name for case in cases}) == len(cases)


def test_only_the_full_size_shows_the_proofs_robots_and_names_and_seeds_follow_from_seed_and_key_alone():
    sizes = {
        size: list_cases(PLAN, size, 1)
        for size in ("smoke", "quick", "development", "full")
    }
    assert {
        case.robots for size, some in sizes.items() if size != "full" for case in some
    } == {"tuned"}
    # Cases to develop on are in no other.
    developed = {case.seed for case in sizes["development"]}
    cases = sizes["quick"]
    assert not developed & {case.seed for case in (*cases, *sizes["full"])}
    assert (
        cases
        == list_cases(PLAN, "quick", 1)
        == sorted(cases, key=lambda case: case.name)
    )
    # Pinned: sealed documents of earlier runs hold what follows from these.
    of_old = [
        case
        for case in cases
        if case.setting != "many_poses" and "two_angles" not in case.key
    ]
    digest = hashlib.sha256(
        " ".join(f"{case.name} {case.seed}" for case in of_old).encode()
    ).hexdigest()
    assert digest[:12] == NAMES
    assert not {case.name for case in cases} & {
        case.name for case in list_cases(PLAN, "quick", 2)
    }


def test_a_case_has_its_effect_at_its_non_centrality_or_is_told_to_be_absorbed_at_the_largest_that_means_anything():
    _, ((_, sizing),) = sized(a_case(("lost_motion",), (50.0,)))
    assert sizing["of"] == "retained" and sizing["signal"]["retained"] == pytest.approx(
        50.0, rel=0.011
    )
    assert sizing["signal"]["raw"] > sizing["signal"]["retained"]
    # The force of a load cell that is off by a tenth shows less than a non-centrality
    # of 10,000.
    _, ((_, sizing),) = sized(a_case(("force_scale",), (50.0,)))
    assert sizing["of"] == "raw" and sizing["signal"]["retained"] < 0.1
    _, ((defect, sizing),) = sized(a_case(("force_scale",), (1e4,)))
    assert (defect.size, sizing["of"]) == (KINDS["force_scale"].largest, "raw")
    assert 10.0 < sizing["signal"]["raw"] < 1e4


@pytest.mark.parametrize("setting", sorted(SETTINGS))
def test_each_setting_makes_a_campaign_that_can_be_read(tmp_path, setting):
    case = a_case(setting=setting)
    campaign, truth = made(case, tmp_path)
    assert (
        truth["case"]["setting"] == setting
        and truth["case"]["changes"] == SETTINGS[setting]
        and not truth["defects"]
    )
    for covariate, column in (
        ("approach", "approach"),
        ("time", "time_s"),
        ("temperature", "temperature_c"),
    ):
        assert (getattr(campaign.measurements, column) is not None) == (
            covariate in case.design.covariates
        )
    if setting.startswith("declared"):
        assert campaign.noise["position_m"] == pytest.approx(
            SETTINGS[setting]["declared_ratio"] * 60e-6
        )
        assert campaign.measurements.repeat.max() == 0
    assert campaign.frame == ("tracker" if setting == "unknown_frame" else "base")
    assert bool(campaign.robot.masses) == (setting != "weight_compensated")


@pytest.mark.parametrize("seed", range(3))
def test_groups_put_their_defects_where_they_belong(seed):
    _, ((defect, _),) = sized(
        a_case(("stiffening",), (200.0,), seed=seed, group="gear_gravity")
    )
    assert defect.joints in ((2,), (3,))
    _, several = sized(
        a_case(("joint_offset",), (200.0,), seed=seed, group="several_joints")
    )
    assert 3 <= len({defect.joints for defect, _ in several}) == len(several) <= 6
    _, ((everything, _),) = sized(
        a_case(("link_weight",), (1e6,), seed=seed, group="undeclared")
    )
    assert everything.joints == (2, 3, 4, 5)


def test_a_case_is_made_the_same_again_and_nothing_of_its_truth_lies_in_the_blind_folder(
    tmp_path,
):
    case = replace(a_case(("thermal_growth",), (25.0,), robot="abb"), seed=187654321)
    for folder in ("one", "two"):
        made(case, tmp_path / folder)
    for path in (f"blind/{case.name}/measurements.parquet", f"sealed/{case.name}.json"):
        assert (tmp_path / "one" / path).read_bytes() == (
            tmp_path / "two" / path
        ).read_bytes()
    files = [path for path in (tmp_path / "one" / "blind").rglob("*") if path.is_file()]
    assert sorted(path.name for path in files) == [
        "campaign.yaml",
        "measurements.parquet",
        "robot.yaml",
    ]
    content = b"".join(path.read_bytes() for path in files)
    for word in (
        b"thermal_growth",
        b"seed",
        b"usual",
        str(case.seed).encode(),
        tmp_path.name.encode(),
    ):
        assert word not in content


def test_bad_rows_are_planted_and_sealed_and_a_base_is_tilted_against_its_own_frame(
    tmp_path,
):
    clean, _ = made(a_case(), tmp_path / "clean")
    (bad, slipped), (tilted, moved) = (
        made(a_case(setting=name), tmp_path / name)
        for name in ("bad_rows", "tilted_base")
    )
    names = ("position", "rotation_vector", "wrench", "joint_angles")
    apart = np.any(
        [
            (getattr(bad.measurements, name) != getattr(clean.measurements, name)).any(
                axis=1
            )
            for name in names
        ],
        axis=0,
    )
    assert set(np.flatnonzero(apart).tolist()) == {
        row for slip in slipped["bad_rows"] for row in slip["rows"]
    }
    assert 1 <= len(slipped["bad_rows"]) <= 3 and "misplaced" not in slipped
    off = np.linalg.norm(
        tilted.measurements.position - clean.measurements.position, axis=1
    )
    assert (
        1e-5 < np.linalg.norm(moved["misplaced"]["turn_rad"]) < 1.2e-3
        and "bad_rows" not in moved
    )
    # A tilt moves what is far from the base more.
    assert off.min() < off.max() < 2e-3
