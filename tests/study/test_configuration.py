"""The study's configuration is checked as a whole, and every fault is one line that
names file, key and what is allowed."""

from copy import deepcopy

import pytest
from support import changed, refused

from elastocal.study.configuration import check_study, override_entries


def test_the_repository_passes(config, config_folder):
    before = deepcopy(config)
    study = check_study(config, config_folder)
    assert (
        list(study.robots) == config["robots"]
        and list(study.strategies) == config["strategies"]
    )
    assert study.points["3+6DoF-comb"] == ("3DoF", "6DoF")
    assert config == before


FAULTS = {
    "unknown strategy": (
        ("strategies", 0),
        "6DOF",
        "strategies",
        ["'6DOF'", "'6DoF'?", "3+6DoF-comb"],
    ),
    "more data sets than fit anywhere": (
        ("data_sets",),
        1_000_000_000,
        "data_sets",
        ["1000000000", "10 to 1000000"],
    ),
    "noise of one name": (
        ("noise_um",),
        [200, 200.00000001],
        "noise_um",
        ["200 and 200.00000001", "6 digits"],
    ),
    "negative noise": (
        ("noise_um", 1),
        -50,
        "noise_um[1]",
        ["-50", "0 to 100000", "µm"],
    ),
    "no seed": (("seed",), None, "seed", ["nothing", "random streams"]),
    "noise that is not simulated": (
        ("tables", "noise_um"),
        300,
        "tables.noise_um",
        ["300", "one of noise_um", "200"],
    ),
    "length beyond the data": (
        ("tables", "length"),
        101,
        "tables.length",
        ["101", "configurations = 100"],
    ),
    "one study has no distribution": (
        ("evaluation", "studies"),
        1,
        "evaluation.studies",
        ["found 1", "2 to 10000"],
    ),
    "point that no robot has": (
        ("questions", "point_sets", "6DoF"),
        ["9DoF"],
        "questions.point_sets.6DoF",
        ["'9DoF'", "2DoF, 3DoF, 4DoF"],
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_one_line_that_names_file_key_and_what_is_allowed(
    config, config_folder, fault
):
    path, value, key, allowed = FAULTS[fault]
    with refused("study.yaml", f"{key}:", *allowed):
        check_study(changed(config, path, value), config_folder, "study.yaml")


def test_data_sets_too_short_for_a_strategy_are_refused(config, config_folder):
    short = deepcopy(config)
    short["interpretations"]["measured"] = "position"
    short["configurations"] = 1
    short["tables"]["length"] = 1
    with refused("study.yaml", "configurations:", "found 1", "2 or more", "6DoF"):
        check_study(short, config_folder, "study.yaml")
    short["configurations"] = 2
    check_study(short, config_folder, "study.yaml")


@pytest.fixture
def other_folder(tmp_path):
    """A config folder with one robot and one strategy, both sound."""
    (tmp_path / "robots").mkdir()
    (tmp_path / "strategies").mkdir()
    (tmp_path / "robots" / "arm.yaml").write_text(
        "name: arm\nchain: Rz(q1) Tx(1) [A] Ry(q2) Tx(1) [B]\n"
        "joint_limits_deg: [[-180, 180], [-90, 90]]\ncompliance_urad_per_Nm: [1, 2]\n"
    )
    (tmp_path / "strategies" / "plain.yaml").write_text(
        "name: plain\nstages: [{points: [B], joints: [1, 2]}]\n"
    )
    return tmp_path


@pytest.fixture
def other_config(config):
    changed_config = deepcopy(config) | {"robots": ["arm"], "strategies": ["plain"]}
    changed_config["tables"]["classical_strategy"] = "plain"
    changed_config["questions"]["point_sets"] = {"B": ["B"]}
    return changed_config


FAULTY_FILES = {
    "typo": (
        "strategies/plain.yaml",
        "name: plain\nstage: []\n",
        "stage",
        ["unknown key", "'stages'?"],
    ),
    "unknown point": (
        "strategies/plain.yaml",
        "name: x\nstages: [{points: [C], joints: [1]}]\n",
        "stages[0].points",
        ["A, B"],
    ),
    "joint left out": (
        "strategies/plain.yaml",
        "name: x\nstages: [{points: [B], joints: [1]}]\n",
        "stages[0]",
        ["joint 2"],
    ),
    "no compliances": (
        "robots/arm.yaml",
        "name: arm\nchain: Rz(q1) Tx(1) [A] Ry(q2) Tx(1) [B]\n"
        "joint_limits_deg: [[-180, 180], [-90, 90]]\n",
        "compliance_urad_per_Nm",
        ["nothing", "simulate"],
    ),
}


@pytest.mark.parametrize("fault", FAULTY_FILES)
def test_fault_in_a_named_file_is_one_line_that_names_that_file(
    other_config, other_folder, fault
):
    name, text, key, allowed = FAULTY_FILES[fault]
    (other_folder / name).write_text(text)
    with refused((other_folder / name).as_posix(), key, *allowed):
        check_study(other_config, other_folder, "study.yaml")


def test_two_strategies_of_one_name_are_refused(other_config, other_folder):
    twin = (other_folder / "strategies/plain.yaml").read_text(encoding="utf-8")
    (other_folder / "strategies/twin.yaml").write_text(twin, encoding="utf-8")
    both = other_config | {"strategies": [*other_config["strategies"], "twin"]}
    with refused(
        other_folder / "strategies/twin.yaml",
        "name",
        "as of plain",
        "a name of its own",
    ):
        check_study(both, other_folder)


def test_values_on_the_command_line_are_read_as_in_the_file(config, config_folder):
    changed = override_entries(
        config,
        ["seed=7", "evaluation={studies: 3}", "interpretations={offset_frame: tool}"],
    )
    assert changed["seed"] == 7 and config["seed"] == 1
    assert changed["evaluation"] == config["evaluation"] | {"studies": 3}
    assert changed["interpretations"] == config["interpretations"] | {
        "offset_frame": "tool"
    }
    check_study(changed, config_folder, "config.yaml")
    assert override_entries(config, []) == config
