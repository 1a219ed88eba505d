"""The study's configuration is checked as a whole, and every fault is one line that names file, key and what is allowed."""

from copy import deepcopy

import pytest
from support import changed, refused

from elastocal.study.configuration import check_study, override


def test_the_repository_passes(config, config_folder):
    before = deepcopy(config)
    study = check_study(config, config_folder)
    assert list(study.robots) == config["robots"] and list(study.strategies) == config["strategies"]
    assert study.points["3+6DoF-comb"] == ("3DoF", "6DoF")
    assert config == before


FAULTS = {
    "typo": (("data_set",), 10, "data_set", ["unknown key", "'data_sets'?"]),
    "unknown strategy": (("strategies", 0), "6DOF", "strategies", ["'6DOF'", "'6DoF'?", "3+6DoF-comb"]),
    "unknown robot": (("robots", 0), "kukka", "robots", ["'kukka'", "'kuka'?", "fanuc"]),
    "robot by a path": (("robots", 0), "../robots/kuka", "robots", ["'../robots/kuka'", "a file of"]),
    "more data sets than fit anywhere": (("data_sets",), 1_000_000_000, "data_sets", ["1000000000", "10 to 1000000"]),
    "noise beyond all robots": (("noise_um", 1), 1e20, "noise_um[1]", ["1e+20", "0 to 100000"]),
    "noise of one name": (("noise_um",), [200, 200.00000001], "noise_um", ["200 and 200.00000001", "6 digits"]),
    "robot twice": (("robots",), ["kuka", "kuka"], "robots", ["each entry once"]),
    "no robot": (("robots",), [], "robots", ["1 or more entries"]),
    "negative noise": (("noise_um", 1), -50, "noise_um[1]", ["-50", "0 to 100000", "µm"]),
    "noise without end": (("noise_um", 1), float("inf"), "noise_um[1]", ["inf"]),
    "no seed": (("seed",), None, "seed", ["nothing", "random streams"]),
    "unknown interpretation": (
        ("interpretations", "average"),
        "mean",
        "interpretations.average",
        ["'mean'", "stiffness | compliance | median"],
    ),
    "flat offset": (("loading", "offset_m"), [0, 0.5], "loading.offset_m", ["[0, 0.5]", "allowed: 3 entries"]),
    "noise that is not simulated": (("tables", "noise_um"), 300, "tables.noise_um", ["300", "one of noise_um", "200"]),
    "length beyond the data": (("evaluation", "lengths", 3), 101, "evaluation.lengths[3]", ["101", "configurations = 100"]),
    "length that is not evaluated": (("tables", "length"), 21, "tables.length", ["21", "one of evaluation.lengths", "20"]),
    "interpretation that is switched to nothing known": (
        ("switched", "R7_median_compliance", "average"),
        "mean",
        "switched.R7_median_compliance.average",
        ["'mean'", "stiffness | compliance | median"],
    ),
    "one study has no distribution": (("evaluation", "studies"), 1, "evaluation.studies", ["found 1", "2 to 10000"]),
    "point that no robot has": (
        ("questions", "point_sets", "6DoF"),
        ["9DoF"],
        "questions.point_sets.6DoF",
        ["'9DoF'", "2DoF, 3DoF, 4DoF"],
    ),
    "section that is no mapping": (("tables",), 3, "tables", ["found 3", "keys with values"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_one_line_that_names_file_key_and_what_is_allowed(config, config_folder, fault):
    path, value, key, words = FAULTS[fault]
    with refused("study.yaml", f"{key}:", *words):
        check_study(changed(config, path, value), config_folder, "study.yaml")


def test_data_sets_too_short_for_a_strategy_are_refused(config, config_folder):
    short = deepcopy(config)
    short["interpretations"]["measured"], short["configurations"] = "position", 1
    short["evaluation"]["lengths"], short["tables"]["length"] = [1], 1
    with refused("study.yaml", "configurations:", "found 1", "2 or more", "6DoF"):
        check_study(short, config_folder, "study.yaml")
    short["configurations"] = 2
    check_study(short, config_folder, "study.yaml")


def test_a_strategy_with_a_prior_belongs_to_few_configurations(config, config_folder):
    with refused(config_folder / "strategies/6DoF-shrunk.yaml", "prior_std:", "found 0.3", "questions.few.strategies"):
        check_study(changed(config, ("strategies", 0), "6DoF-shrunk"), config_folder, "study.yaml")
    assert [document["name"] for document in check_study(config, config_folder, "study.yaml").few] == ["6DoF", "6DoF shrunk"]


@pytest.fixture
def other_folder(tmp_path):
    """A config folder with one robot and one strategy, both sound."""
    (tmp_path / "robots").mkdir()
    (tmp_path / "strategies").mkdir()
    (tmp_path / "robots" / "arm.yaml").write_text(
        "name: arm\nchain: Rz(q1) Tx(1) [A] Ry(q2) Tx(1) [B]\n"
        "joint_limits_deg: [[-180, 180], [-90, 90]]\ncompliance_urad_per_Nm: [1, 2]\n"
    )
    (tmp_path / "strategies" / "plain.yaml").write_text("name: plain\nstages: [{points: [B], joints: [1, 2]}]\n")
    return tmp_path


@pytest.fixture
def other_config(config):
    other = deepcopy(config) | {"robots": ["arm"], "strategies": ["plain"]}
    other["questions"]["few"]["strategies"] = ["plain"]
    if "classical_strategy" in other["tables"]:
        other["tables"]["classical_strategy"] = "plain"
    other["questions"]["point_sets"] = {"B": ["B"]}
    return other


FAULTY_FILES = {
    "bad YAML": ("robots/arm.yaml", "name: [arm\n", "line 2", ["YAML"]),
    "empty": ("robots/arm.yaml", "", "", ["found nothing", "keys with values"]),
    "missing key": ("robots/arm.yaml", "name: arm\n", "chain", ["nothing", "chain notation"]),
    "typo": ("strategies/plain.yaml", "name: plain\nstage: []\n", "stage", ["unknown key", "'stages'?"]),
    "unknown point": ("strategies/plain.yaml", "name: x\nstages: [{points: [C], joints: [1]}]\n", "stages[0].points", ["A, B"]),
    "joint left out": ("strategies/plain.yaml", "name: x\nstages: [{points: [B], joints: [1]}]\n", "stages[0]", ["joint 2"]),
    "list too long": (
        "robots/arm.yaml",
        "name: arm\nchain: Rz(q1) [A]\njoint_limits_deg: [[-1, 1]]\ncompliance_urad_per_Nm: [1, 2]\n",
        "compliance_urad_per_Nm",
        ["2 entries", "1 joints"],
    ),
    "no compliances": (
        "robots/arm.yaml",
        "name: arm\nchain: Rz(q1) Tx(1) [A] Ry(q2) Tx(1) [B]\njoint_limits_deg: [[-180, 180], [-90, 90]]\n",
        "compliance_urad_per_Nm",
        ["nothing", "simulate"],
    ),
    "faulty chain": (
        "robots/arm.yaml",
        "name: arm\nchain: Rz(q1) Tx(l7) [A]\njoint_limits_deg: [[-1, 1]]\ncompliance_urad_per_Nm: [1]\n",
        "chain",
        ["'Tx(l7)'"],
    ),
}


@pytest.mark.parametrize("fault", FAULTY_FILES)
def test_fault_in_a_named_file_is_one_line_that_names_that_file(other_config, other_folder, fault):
    name, text, key, words = FAULTY_FILES[fault]
    (other_folder / name).write_text(text)
    with refused((other_folder / name).as_posix(), key, *words):
        check_study(other_config, other_folder, "study.yaml")


def test_two_strategies_of_one_name_are_refused(other_config, other_folder):
    twin = (other_folder / "strategies/plain.yaml").read_text(encoding="utf-8")
    (other_folder / "strategies/twin.yaml").write_text(twin, encoding="utf-8")
    both = other_config | {"strategies": [*other_config["strategies"], "twin"]}
    with refused(other_folder / "strategies/twin.yaml", "name", "as of plain", "a name of its own"):
        check_study(both, other_folder)


def test_what_the_command_line_changes_is_read_as_in_the_file(config, config_folder):
    changed = override(
        config, ["seed=7", "evaluation={studies: 3, lengths: [5, 20]}", "switched={R4_tool_axes: {offset_frame: base}}"]
    )
    assert changed["seed"] == 7 and config["seed"] == 1
    assert changed["evaluation"] == config["evaluation"] | {"studies": 3, "lengths": [5, 20]}
    assert changed["switched"] == config["switched"] | {"R4_tool_axes": {"offset_frame": "base"}}
    check_study(changed, config_folder, "config.yaml")
    assert override(config, []) == config
