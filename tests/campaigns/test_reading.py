"""A campaign's folder is read as documented, and every fault in it is refused in one
line."""

import os

import numpy as np
import pytest
from made_cells import ARM, DOCUMENT, LOADS, POSES, REPEATS, WRENCH, assert_same
from support import refused

from elastocal.campaigns.campaign import Target
from elastocal.campaigns.holdout import split_poses
from elastocal.campaigns.reading import read_campaign, read_held_out_campaign
from elastocal.campaigns.writing import write_campaign


def test_a_campaign_is_read_as_written(cell):
    noise = {"position_m": 6e-5, "orientation_rad": 7e-5}
    cell.document |= {
        "compliance": "identify",
        "declared": ["joint_offset"],
        "noise": noise,
        "holdout": {"fraction": 0.4, "seed": 5},
    }
    campaign = cell.read(effects=["joint_offset"])
    assert campaign.name == "cell7"
    assert campaign.robot.name == "three joints"
    assert campaign.measures_poses
    assert campaign.frame == "base"
    assert campaign.targets == (
        Target("A", "elbow", (0.0, 0.0, 0.1), offset_std_m=2e-4),
        Target("B", "hand", None),
    )
    assert campaign.compliance == "identify"
    assert campaign.declared == ("joint_offset",)
    assert campaign.noise == noise
    assert campaign.holdout == {"fraction": 0.4, "seed": 5}


@pytest.mark.parametrize(
    ("stated", "sessions", "expected"),
    [
        ({}, 1, (1e-3, 0.0)),
        ({}, 2, (1e-3, 0.0)),
        ({"base_std_m": 0, "application_point_std_m": 0}, 2, (0.0, 0.0)),
        ({"base_std_m": 1e-4, "application_point_std_m": 5e-3}, 1, (5e-3, 1e-4)),
    ],
)
def test_what_is_declared_is_as_exact_as_stated(cell, stated, sessions, expected):
    """Sessions are parts of one registration unless the file says otherwise."""
    cell.document |= stated
    if sessions == 2:
        cell.repeat_as_session_7()
    campaign = cell.read()
    assert (campaign.application_point_std_m, campaign.base_std_m) == expected


def test_a_base_that_is_fitted_has_no_declared_standard_deviation(cell):
    cell.document |= {"frame": "tracker", "base_std_m": 1e-4}
    with refused(cell.source, "base_std_m", "frame: tracker", "frame: base"):
        cell.read()


def test_measurements_are_read_as_written(cell):
    campaign = cell.read()
    measurements = campaign.measurements
    assert len(measurements) == POSES * LOADS * REPEATS * 2
    targets = [campaign.targets[index].name for index in measurements.target]
    assert targets == cell.table["target"]
    expected = {
        "session": np.zeros(len(measurements)),
        "row": np.arange(1, len(measurements) + 1),
    }
    for name in ("pose", "load", "repeat", "time_s", "temperature_c"):
        expected[name] = cell.table[name]
    columns_of_arrays = {
        "joint_angles": ("q1", "q2", "q3"),
        "wrench": WRENCH,
        "position": "xyz",
        "rotation_vector": ("rx", "ry", "rz"),
        "approach": ("approach1", "approach2", "approach3"),
    }
    for name, columns in columns_of_arrays.items():
        expected[name] = np.column_stack([cell.table[column] for column in columns])
    for name, values in expected.items():
        np.testing.assert_array_equal(getattr(measurements, name), values, err_msg=name)


def test_the_rotation_of_a_mount_is_as_stated_or_unknown_if_the_offset_is(cell):
    targets = cell.document["targets"] = {
        name: dict(target) for name, target in DOCUMENT["targets"].items()
    }
    targets["A"]["rotation"] = [0, 0, 1.5]
    assert [target.rotation for target in cell.read().targets] == [
        (0.0, 0.0, 1.5),
        None,
    ]
    targets["A"].pop("rotation")
    targets["B"]["rotation"] = [0, 1, 0]
    assert [target.rotation for target in cell.read().targets] == [
        (0.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
    ]
    for invalid, phrase in (
        ([0, 0, 92], "not degrees"),
        ([0, 0], "3 entries"),
        ("known", "unknown"),
    ):
        targets["B"]["rotation"] = invalid
        with refused(cell.source, "targets.B.rotation", phrase):
            cell.read()


def test_optional_entries_and_columns_have_defaults(cell):
    cell.without("approach1", "approach2", "approach3", "time_s", "temperature_c")
    campaign = cell.read()
    assert campaign.compliance == "nominal"
    assert campaign.declared == ()
    assert campaign.noise is None
    assert campaign.holdout == {"fraction": 0.3, "seed": 1}
    assert campaign.measurements.approach is None
    assert campaign.measurements.time_s is None
    assert campaign.measurements.temperature_c is None


def test_uncertainties_of_measurements_are_read_and_exclude_a_declared_noise(cell):
    cell.document.pop("noise", None)
    cell.table["u95_m"] = [1e-4] * len(cell.table["pose"])
    np.testing.assert_array_equal(cell.read().measurements.u95_m, cell.table["u95_m"])
    cell.document["noise"] = {"orientation_rad": 5e-5, "joint_rad": 1e-5}
    assert cell.read().noise == cell.document["noise"]
    cell.document["noise"] = {"position_m": 1e-4}
    with refused(
        f"{cell.source}: noise.position_m", "noise.position_m", "u95_m", "one of them"
    ):
        cell.read()


def test_the_direction_of_approach_is_that_of_the_models_joints(cell):
    cell.arm["reported_joints"] = {"matrix": [[1, 0, 0], [0, -1, 0], [0, 1, 1]]}
    second = np.array(cell.table["approach2"])
    third = np.array(cell.table["approach3"])
    approach = cell.read().measurements.approach
    np.testing.assert_array_equal(approach[:, 1], -second)
    np.testing.assert_array_equal(approach[:, 2], np.where(second == third, second, 0))


def hold_out_campaign(cell, tmp_path):
    """Write a campaign with its own targets next to the cell, and hold it out."""
    table = cell.table | {
        "target": ["T"] * len(cell.table["pose"]),
        "repeat": list(range(len(cell.table["pose"]))),
    }
    document = cell.document | {
        "campaign": "other",
        "targets": {"T": DOCUMENT["targets"]["B"]},
        "robot": "planar",
    }
    write_campaign(tmp_path / "other", document, table, 3)
    cell.document["holdout"] = {"campaign": "../other"}


def test_another_campaign_of_the_same_chain_validates_a_fit_to_all_measurements(
    cell, tmp_path
):
    hold_out_campaign(cell, tmp_path)
    campaign = cell.read()
    training, held_out = split_poses(campaign)
    assert len(held_out) == 0
    assert_same(training, campaign.measurements)
    validation = read_held_out_campaign(cell.open())
    assert validation.name == "other"
    assert [target.name for target in validation.targets] == ["T"]
    assert len(validation.measurements) == len(campaign.measurements)
    cell.arm["chain"] = ARM["chain"].replace("0.7", "0.8")
    cell.write()
    with refused(cell.source, "holdout.campaign", "another chain", "the same chain"):
        read_held_out_campaign(cell.open())


@pytest.mark.parametrize(
    ("changes", "key", "phrases"),
    [
        ({"robbot": "arm.yaml"}, "robbot", ["unknown key", "'robot'?"]),
        (
            {"targets": {"A": {"point": "elbow"}}},
            "targets.A.offset_m",
            ["nothing", "unknown: fitted"],
        ),
        (
            {"targets": {"A": {"point": "elbow", "offset_m": "unkown"}}},
            "targets.A.offset_m",
            ["'unkown'", "allowed: unknown"],
        ),
        (
            {"targets": {"A": {"point": "elbw", "offset_m": "unknown"}}},
            "targets.A.point",
            ["'elbw'", "'elbow'? (elbow, hand)"],
        ),
        (
            {"targets": {1: {"point": "elbow", "offset_m": "unknown"}}},
            "targets",
            ["the name 1", "in quotes"],
        ),
        (
            {"targets": DOCUMENT["targets"] | {"C": DOCUMENT["targets"]["A"]}},
            "targets.C",
            ["no measurement", "measurements.csv"],
        ),
        ({"robot": "planer"}, "robot", ["'planer'", "'planar'? (planar)"]),
        (
            {"declared": ["joint_ofset"]},
            "declared[0]",
            ["'joint_ofset'", "'joint_offset'? (joint_offset, payload)"],
        ),
        ({"noise": {"orientation_rad": 1e-4}}, "noise", ["no position_m", "u95_m"]),
        (
            {"noise": {"position_m": 1e-4, "joint_rad": [1e-5]}},
            "noise.joint_rad",
            ["1 number", "or 3"],
        ),
        (
            {"noise": {"position_m": 1e-4, "joint_rad": [0, 2.0, 0]}},
            "noise.joint_rad[1]",
            ["2.0", "0 to 0.1"],
        ),
        *(
            ({"noise": {"position_m": value}}, "noise.position_m", ["laser", "0.1"])
            for value in (0.2, 6e-12)
        ),
        (
            {"noise": {"position_m": 1e-4, "orientation_rad": 60}},
            "noise.orientation_rad",
            ["resolves"],
        ),
        (
            {"targets": {"A": {"point": "elbow", "offset_m": [0, 0, 150]}}},
            "targets.A.offset_m[2]",
            ["150", "reaches"],
        ),
    ],
)
def test_a_faulty_document_is_refused_in_one_line(cell, changes, key, phrases):
    cell.document |= changes
    with refused(f"{cell.source}: ", f" {key}", *phrases):
        cell.read(effects=["joint_offset", "payload"])


def test_loads_are_refused_if_compliances_are_neither_stated_nor_identified(cell):
    del cell.arm["compliance_urad_per_Nm"]
    with refused(cell.source, "compliance", "nominal", "arm.yaml", "identify"):
        cell.read()
    cell.document["compliance"] = "identify"
    robot = cell.read().robot
    assert not robot.compliance_known
    assert (robot.compliance > 0).all()


def test_without_loads_unknown_compliances_are_zero_and_masses_are_ignored(
    cell,
):
    del cell.arm["compliance_urad_per_Nm"]
    cell.arm["masses"] = [
        {"link": 2, "mass_kg": 10, "centre_m": [0.3, 0, 0], "relative_std": 0.2}
    ]
    cell.keep(np.flatnonzero(np.equal(cell.table["load"], 0)))
    robot = cell.read().robot
    np.testing.assert_array_equal(robot.compliance, np.zeros(3))
    assert robot.masses == ()
    assert not robot.compliance_known
    cell.arm["compliance_urad_per_Nm"] = [1, 2, 3]
    assert cell.read().robot.masses
    assert cell.read().robot.compliance_known


@pytest.mark.parametrize(
    "name", ["/etc/passwd", "../secret", "../../etc/passwd", "x" * 5000, "link.yaml"]
)
def test_no_file_outside_the_folder_is_read_or_shown_as_a_robot(cell, name):
    """The folder of robots does not count as outside."""
    cell.write()
    secret = cell.folder.parent / "secret"
    secret.write_text("password: 1\n")
    (cell.folder / "link.yaml").symlink_to(secret)
    cell.document["robot"] = name
    with refused(cell.source, "robot", "a file in this folder"):
        cell.read()
    cell.document["robot"] = "../robots/planar.yaml"
    cell.read()


@pytest.mark.parametrize(
    "file", ["campaign.yaml", "measurements.csv", "measurements.parquet"]
)
@pytest.mark.parametrize("kind", ["link", "pipe", "folder", "link out"])
def test_a_link_pipe_or_folder_instead_of_a_file_is_named_and_not_opened(
    cell, file, kind
):
    cell.write()
    path = cell.folder / file
    elsewhere = cell.folder.parent / "elsewhere"
    path.unlink(missing_ok=True)
    if kind.startswith("link"):
        path.symlink_to(elsewhere)
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.mkdir()
    phrase = f"found a {kind} that leads to no file"
    if kind == "link out":
        elsewhere.write_text("{")
        phrase = "a link out of the campaign's folder"
    with refused(path, "", phrase):
        read_campaign(cell.open())
    with refused(path, "", phrase):
        cell.open().files()


@pytest.mark.parametrize(
    ("row", "column", "entry", "phrases"),
    [
        (9, "approach2", 0.5, ["0.5", "-1, 0 or 1"]),
        (6, "target", "a", ["'a'", "'A'? (A, B)"]),
        (6, "target", "", ["nothing", "A, B"]),
        (1, "fz", 3.0, ["'3'", "0 where load is 0"]),
        (4, "q1", 3.0, ["'3'", "within 0.02 rad of line 2", "the same pose"]),
        (12, "rx", 45.0, ["a turn of", "not degrees"]),
    ],
)
def test_an_implausible_cell_is_refused_by_line_and_column(
    cell, row, column, entry, phrases
):
    cell.spoil(row, column, entry)
    with refused(cell.measurements, f"line {row + 1}, column {column}", *phrases):
        cell.read()


def test_a_few_wrong_rows_are_left_to_the_diagnosis(cell):
    """A wrong unit affects a whole file. A mistyped cell is a gross error of its
    row."""
    cell.spoil(40, "y", 812.4)
    assert cell.read().measurements.position[39, 1] == 812.4
    for row in range(1, 25):
        cell.spoil(row, "y", 812.4)
    with refused(
        cell.measurements, "column y", "812.4", "metres, not millimetres", "reaches"
    ):
        cell.read()


def test_a_repeated_measurement_and_a_whole_file_in_degrees_are_refused(cell):
    cell.spoil(7, "repeat", 0)
    with refused(
        cell.measurements,
        "line 8",
        "pose 0, load 1, repeat 0, target A again",
        "first in line 6",
    ):
        cell.read()
    for name in ("q1", "q2", "q3"):
        cell.table[name] = [57.3 * number for number in cell.table[name]]
    with refused(cell.measurements, "column q", "not degrees"):
        cell.read()


def test_a_load_without_wrench_columns_is_refused(cell):
    cell.without(*WRENCH)
    with refused(
        cell.measurements, "line 6, column load", "found '1'", "no columns fx"
    ):
        cell.read()


def test_a_clock_that_is_set_back_once_is_refused(cell):
    """By an hour at the end of summer time, by a day at midnight."""
    count = len(cell.table["pose"])
    rising = 60.0 * np.arange(count)
    for set_back_s in (3600.0, 86400.0):
        late = np.arange(count) >= count // 2
        cell.table["time_s"] = [*(rising - set_back_s * late + 1e5)]
        with refused(
            cell.folder / "measurements.csv",
            f"line {count // 2 + 2}",
            "not set back",
            "add the hour",
        ):
            cell.read()
    for fall_s in (600.0, 20000.0):
        # Neither an hour nor a day: the order of the file is another one.
        cell.table["time_s"] = [*(rising - fall_s * late + 1e5)]
        cell.read()


def test_a_file_that_lists_one_target_after_the_other_has_no_clock_set_back(cell):
    count = len(cell.table["pose"])
    order = np.argsort(cell.table["target"], kind="stable")
    for name, column in cell.table.items():
        cell.table[name] = [column[row] for row in order]
    half = 3500.0 / (count // 2 - 1) * np.arange(count // 2)
    cell.table["time_s"] = [*half, *half]
    cell.read()
