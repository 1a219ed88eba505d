"""What is said of a campaign before it is diagnosed."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_folders import made_folder, made_table
from small_data import service_arm_folder

from elastocal.loop.overview import overview
from elastocal.mechanics.kinematics import poses


def overview_of(folder):
    return overview(folder, ROBOTS)


@pytest.fixture(scope="module")
def facts(kuka, tmp_path_factory):
    return overview_of(made_folder(tmp_path_factory.mktemp("o") / "made", kuka))


def test_springs_have_their_errors_and_candidates_their_reasons(facts):
    assert facts["diagnosable"] and facts["faults"] == []
    assert all(0 < spring["relative_std_error"] < 1 for spring in facts["compliance"][:5])
    # Of the last joint, on whose axis the target sits, nothing is determined.
    assert facts["compliance"][5] == {"value_urad_per_Nm": None, "relative_std_error": None}
    assert facts["testable"] > 20
    assert sum(facts["untestable"].values()) > 0 and all(facts["untestable"])
    assert any("one load beside none" in sentence for sentence in facts["suspicious"])
    assert any("held-out poses say little" in sentence for sentence in facts["suspicious"])


def test_of_a_compliance_that_comes_out_negative_no_number_is_stated(kuka, tmp_path):
    """What the declared model lacks hides behind it, and behind all others."""
    signs = [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]
    table = made_table(replace(kuka, compliance=kuka.compliance * signs), "made")
    facts = overview_of(made_folder(tmp_path / "made", kuka, table=table))
    assert facts["compliance"] == [] and facts["accuracy"] is None
    assert any("the compliance of joint 3 comes out negative" in sentence for sentence in facts["suspicious"])


def test_a_decisive_fault_is_said_and_the_campaign_is_not_diagnosable(kuka, tmp_path):
    table = made_table(kuka, "made")
    table["q3"] = -table["q3"]
    facts = overview_of(made_folder(tmp_path / "made", kuka, table=table))
    assert not facts["diagnosable"]
    assert any(fault["decisive"] and "joint 3" in fault["sentence"] for fault in facts["faults"])


def test_parameters_that_are_many_for_the_poses_are_said_and_how_many_poses_it_takes(tmp_path, facts):
    found = overview_of(service_arm_folder(tmp_path / "made", 1))
    (said,) = [sentence for sentence in found["suspicious"] if "poses are few" in sentence]
    least = int(said.split("Measure about ")[1].split(" ")[0])
    assert said.startswith(f"24 poses are few for {found['parameters']} parameters, of which they determine about")
    assert found["numbers"] == 72 and least > 48
    assert 9 < found["effective_parameters"] < found["parameters"]
    assert not any("poses are few" in sentence for sentence in facts["suspicious"])


def test_positions_that_a_controller_worked_out_are_said_to_be_no_measurements(kuka, tmp_path):
    table = made_table(kuka, "o")
    chain, at = kuka.chain, kuka.model_angles(np.column_stack([table[f"q{joint}"] for joint in range(1, 7)]))
    for point in chain.points:
        mine = table["target"] == point.name
        if mine.any():
            for axis, values in zip("xyz", poses(chain, at[mine], point)[0].T, strict=True):
                table[axis][mine] = values.round(6)
    (first, *_) = overview_of(made_folder(tmp_path / "made", kuka, table=table))["suspicious"]
    assert "no measurements" in first
