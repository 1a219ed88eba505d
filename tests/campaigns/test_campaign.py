"""Measured campaigns: what a folder means, that every fault is refused in one line, and that a split never parts a pose."""

import csv
from dataclasses import fields, replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from support import refused

from elastocal.campaigns.campaign import Readings, Target, held_out_campaign, read_campaign, split, write_campaign
from elastocal.campaigns.measurements import measurement_columns

ARM = {
    "name": "three joints",
    "chain": "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.7) [elbow] Ry(q3) Tx(0.6) [hand]",
    "joint_limits_deg": [[-180, 180], [-100, 45], [-120, 120]],
    "compliance_urad_per_Nm": [1, 2, 3],
}
DOCUMENT = {
    "campaign": "cell7",
    "robot": "arm.yaml",
    "measured": "pose",
    "frame": "base",
    "targets": {"A": {"point": "elbow", "offset_m": [0, 0, 0.1]}, "B": {"point": "hand", "offset_m": "unknown"}},
}
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
POSES, LOADS, REPEATS = 10, 2, 2


def measured():
    """Columns of a campaign: each pose unloaded and loaded, twice, two targets; numbers that cannot be confused."""
    rng = np.random.default_rng(3)
    angles = rng.uniform(-0.9, 0.7, (POSES, 3))
    rows = []
    for pose in range(POSES):
        for load in range(LOADS):
            wrench = load * (100.0 + np.arange(6) + pose)
            for repeat in range(REPEATS):
                for target in ("A", "B"):
                    servo = rng.uniform(-1e-4, 1e-4, 3)
                    readings = rng.uniform(-1, 1, 6)
                    cells = (pose, load, repeat, target, *(angles[pose] + servo), *wrench, *readings, *rng.choice([-1, 1], 3))
                    rows.append((*cells, 60.0 * len(rows), 20.0 + 0.01 * len(rows)))
    names = ["pose", "load", "repeat", "target", "q1", "q2", "q3", *WRENCH, *"xyz", "rx", "ry", "rz"]
    names += ["approach1", "approach2", "approach3", "time_s", "temperature_c"]
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


class Cell:
    """A campaign's folder that a test spoils before it reads it."""

    def __init__(self, folder):
        self.robots = folder / "robots"
        self.folder = folder / "cell7"
        self.document, self.arm, self.table = dict(DOCUMENT), dict(ARM), measured()

    def without(self, *names):
        for name in names:
            del self.table[name]

    def spoil(self, row, column, cell):
        """Put something into a cell; rows are counted from 1 as in messages."""
        self.table[column][row - 1] = cell

    def write(self, kind="csv", separator=","):
        self.folder.mkdir(parents=True, exist_ok=True)
        self.robots.mkdir(exist_ok=True)
        (self.robots / "planar.yaml").write_text(yaml.safe_dump(ARM), encoding="utf-8")
        (self.folder / "arm.yaml").write_text(yaml.safe_dump(self.arm), encoding="utf-8")
        (self.folder / "campaign.yaml").write_text(yaml.safe_dump(self.document, sort_keys=False), encoding="utf-8")
        if kind == "parquet":
            pq.write_table(pa.table(self.table), self.folder / "measurements.parquet")
            return
        with open(self.folder / "measurements.csv", "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, delimiter=separator)
            writer.writerow(self.table)
            writer.writerows(zip(*self.table.values(), strict=True))

    def read(self, **arguments):
        self.write()
        return read_campaign(self.folder, self.robots, **arguments)

    @property
    def source(self):
        return (self.folder / "campaign.yaml").as_posix()

    @property
    def measurements(self):
        return (self.folder / "measurements.csv").as_posix()


@pytest.fixture
def cell(tmp_path):
    return Cell(tmp_path)


def assert_same(one, other):
    """The same readings, value for value."""
    for field in fields(Readings):
        left, right = getattr(one, field.name), getattr(other, field.name)
        assert (left is None) == (right is None), field.name
        if left is not None:
            assert left.dtype == right.dtype, field.name
            np.testing.assert_array_equal(left, right, err_msg=field.name)


def test_campaign_is_read_as_written(cell):
    cell.document |= {
        "compliance": "identify",
        "declared": ["joint_offset"],
        "noise": {"position_m": 6e-5, "orientation_rad": 7e-5},
        "holdout": {"fraction": 0.4, "seed": 5},
    }
    campaign, table = cell.read(effects=["joint_offset"]), cell.table
    assert (campaign.name, campaign.robot.name, campaign.measured, campaign.frame) == ("cell7", "three joints", "pose", "base")
    assert campaign.targets == (Target("A", "elbow", (0.0, 0.0, 0.1)), Target("B", "hand", None))
    assert (campaign.compliance, campaign.declared) == ("identify", ("joint_offset",))
    assert campaign.noise == {"position_m": 6e-5, "orientation_rad": 7e-5}
    assert campaign.holdout == {"fraction": 0.4, "seed": 5}
    readings = campaign.readings
    assert len(readings) == POSES * LOADS * REPEATS * 2
    for name in ("pose", "load", "repeat"):
        np.testing.assert_array_equal(getattr(readings, name), table[name])
    assert [campaign.targets[index].name for index in readings.target] == table["target"]
    np.testing.assert_array_equal(readings.joint_angles, np.column_stack([table[f"q{j}"] for j in (1, 2, 3)]))
    np.testing.assert_array_equal(readings.wrench, np.column_stack([table[name] for name in WRENCH]))
    np.testing.assert_array_equal(readings.position, np.column_stack([table[name] for name in "xyz"]))
    np.testing.assert_array_equal(readings.rotation_vector, np.column_stack([table[f"r{name}"] for name in "xyz"]))
    np.testing.assert_array_equal(readings.approach, np.column_stack([table[f"approach{j}"] for j in (1, 2, 3)]))
    np.testing.assert_array_equal(readings.time_s, table["time_s"])
    np.testing.assert_array_equal(readings.temperature_c, table["temperature_c"])
    np.testing.assert_array_equal(readings.session, np.zeros(len(readings)))
    np.testing.assert_array_equal(readings.row, np.arange(1, len(readings) + 1))


def test_what_a_campaign_leaves_out_has_a_default(cell):
    cell.without("approach1", "approach2", "approach3", "time_s", "temperature_c")
    campaign = cell.read()
    assert (campaign.compliance, campaign.declared, campaign.noise) == ("nominal", (), None)
    assert campaign.holdout == {"fraction": 0.3, "seed": 1}
    assert campaign.readings.approach is campaign.readings.time_s is campaign.readings.temperature_c is None


def test_seed_of_a_fraction_is_1_where_none_is_given(cell):
    cell.document["holdout"] = {"fraction": 0.2}
    assert cell.read().holdout == {"fraction": 0.2, "seed": 1}


def test_no_wrench_column_at_all_means_no_load(cell):
    keep = [index for index, load in enumerate(cell.table["load"]) if load == 0]
    cell.table = {name: [column[index] for index in keep] for name, column in cell.table.items()}
    cell.without(*WRENCH)
    np.testing.assert_array_equal(cell.read().readings.wrench, np.zeros((len(keep), 6)))


def test_orientations_are_left_aside_where_positions_are_measured(cell):
    cell.document["measured"] = "position"
    assert cell.read().readings.rotation_vector is None


def test_robot_is_found_by_its_name_as_well(cell):
    cell.document["robot"] = "planar"
    assert cell.read().robot.name == "three joints"


def test_joint_angles_are_those_of_the_model(cell):
    cell.arm["reported_joints"] = {"matrix": [[1, 0, 0], [0, -1, 0], [0, 1, 1]], "offset_deg": [0, -30, 0]}
    reported = np.column_stack([cell.table[f"q{j}"] for j in (1, 2, 3)])
    readings = cell.read().readings
    expected = np.column_stack([reported[:, 0], -reported[:, 1] - np.pi / 6, reported[:, 1] + reported[:, 2]])
    np.testing.assert_allclose(readings.joint_angles, expected, rtol=0, atol=1e-15)


def test_sense_of_approach_is_that_of_the_models_joints(cell):
    cell.arm["reported_joints"] = {"matrix": [[1, 0, 0], [0, -1, 0], [0, 1, 1]]}
    second, third = np.array(cell.table["approach2"]), np.array(cell.table["approach3"])
    approach = cell.read().readings.approach
    np.testing.assert_array_equal(approach[:, 1], -second)
    np.testing.assert_array_equal(approach[:, 2], np.where(second == third, second, 0))


def test_parquet_is_csv(cell):
    from_csv = cell.read()
    (cell.folder / "measurements.csv").unlink()
    cell.write("parquet")
    assert_same(read_campaign(cell.folder, cell.robots).readings, from_csv.readings)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_written_campaign_is_the_one_read(cell, tmp_path, kind):
    first = cell.read()
    document = cell.document | {"robot": "planar"}
    write_campaign(tmp_path / "again", document, cell.table, 3, kind)
    second = read_campaign(tmp_path / "again", cell.robots)
    assert_same(first.readings, second.readings)
    assert second.targets == first.targets
    assert sorted(path.name for path in (tmp_path / "again").iterdir()) == ["campaign.yaml", f"measurements.{kind}"]


def test_campaign_written_as_another_kind_leaves_one_file_of_measurements(cell, tmp_path):
    cell.write()
    for kind in ("csv", "parquet"):
        write_campaign(tmp_path / "again", cell.document | {"robot": "planar"}, cell.table, 3, kind)
    assert len(read_campaign(tmp_path / "again", cell.robots).readings) == len(cell.table["pose"])


def test_parquet_of_a_written_campaign_carries_units_and_meanings(cell, tmp_path):
    write_campaign(tmp_path / "again", cell.document, cell.table, 3)
    schema = pq.read_schema(tmp_path / "again" / "measurements.parquet")
    for name, column in measurement_columns(3).items():
        if name in cell.table:
            assert schema.field(name).metadata == {b"unit": column.unit.encode(), b"meaning": column.meaning.encode()}


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_campaign_that_cannot_be_written_leaves_the_one_before_it(cell, tmp_path, kind):
    folder, document = tmp_path / "again", cell.document | {"robot": "planar"}
    cell.write()
    write_campaign(folder, document, cell.table, 3, kind)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with refused((folder / f"measurements.{kind}").as_posix(), "header", "'q4'"):
        write_campaign(folder, document, cell.table | {"q4": cell.table["q3"]}, 3, kind)
    with pytest.raises((ValueError, pa.ArrowException), match=r"argument|length"):
        write_campaign(folder, document, cell.table | {"q3": cell.table["q3"][1:]}, 3, kind)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_document_that_the_schema_refuses_is_not_written(cell, tmp_path):
    with refused((tmp_path / "again" / "campaign.yaml").as_posix(), "frame", "tracker | base"):
        write_campaign(tmp_path / "again", cell.document | {"frame": "world"}, cell.table, 3)
    assert not (tmp_path / "again").exists()


def test_blank_rows_and_blanks_around_cells_are_passed_over_and_counted(cell):
    cell.write()
    path = cell.folder / "measurements.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    lines.insert(3, "")
    lines.insert(5, "," * lines[0].count(","))
    path.write_text("\ufeff" + "\n".join(line.replace(",", ", ") for line in lines), encoding="utf-8")
    readings = read_campaign(cell.folder, cell.robots).readings
    assert readings.row.tolist()[:5] == [1, 2, 4, 6, 7]
    assert len(readings) == len(cell.table["pose"])


def test_selected_readings_come_in_the_order_of_the_index(cell):
    readings = replace(cell.read().readings, time_s=None)
    chosen = readings.select(np.array([5, 2]))
    assert len(chosen) == 2 and chosen.row.tolist() == [6, 3] and chosen.time_s is None
    np.testing.assert_array_equal(chosen.position, readings.position[[5, 2]])
    assert_same(readings.select(readings.load == 1), readings.select(np.flatnonzero(readings.load == 1)))


def poses_of(readings):
    return set(zip(readings.session.tolist(), readings.pose.tolist(), strict=True))


def with_sessions(cell):
    """The same rows again as another session, with targets of its own."""
    table = {name: 2 * column for name, column in cell.table.items()}
    count = len(cell.table["pose"])
    table["session"] = count * [0] + count * [7]
    table["target"] = cell.table["target"] + [f"{name}2" for name in cell.table["target"]]
    cell.document["targets"] = cell.document["targets"] | {"A2": DOCUMENT["targets"]["A"], "B2": DOCUMENT["targets"]["B"]}
    cell.table = table


def test_split_parts_no_pose_of_any_session(cell):
    with_sessions(cell)
    campaign = cell.read()
    training, held_out = split(campaign)
    assert poses_of(training).isdisjoint(poses_of(held_out))
    assert poses_of(training) | poses_of(held_out) == {(session, pose) for session in (0, 7) for pose in range(POSES)}
    assert len(poses_of(held_out)) == 6
    assert sorted([*training.row, *held_out.row]) == campaign.readings.row.tolist()


@given(st.randoms(use_true_random=False))
def test_split_is_the_same_whatever_the_order_of_the_rows(tmp_path_factory, random):
    cell = Cell(tmp_path_factory.mktemp("campaign"))
    with_sessions(cell)
    expected = poses_of(split(cell.read())[1])
    order = list(range(len(cell.table["pose"])))
    random.shuffle(order)
    cell.table = {name: [column[index] for index in order] for name, column in cell.table.items()}
    assert poses_of(split(cell.read())[1]) == expected


def test_another_seed_holds_out_other_poses(cell):
    found = set()
    for seed in range(5):
        cell.document["holdout"] = {"fraction": 0.3, "seed": seed}
        held_out = frozenset(poses_of(split(cell.read())[1]))
        assert len(held_out) == 3
        found.add(held_out)
    assert len(found) > 1


def test_a_block_of_neighbours_is_held_out_by_its_seed(cell):
    found = set()
    for seed in range(20):
        cell.document["holdout"] = {"blocks": 3, "seed": seed}
        training, held_out = split(cell.read())
        assert poses_of(training).isdisjoint(poses_of(held_out))
        found.add(frozenset(poses_of(held_out)))
    # Blocks part the poses: whatever the seed, it is one of three, which together are all.
    assert len(found) == 3 and sum(map(len, found)) == POSES == len(frozenset.union(*found))
    cell.document["holdout"] = {"blocks": 3}
    assert cell.read().holdout == {"blocks": 3, "seed": 1}


def test_a_block_does_not_depend_on_the_order_of_the_rows(cell):
    cell.document["holdout"] = {"blocks": 3, "seed": 2}
    before = poses_of(split(cell.read())[1])
    order = np.random.default_rng(1).permutation(len(cell.table["pose"]))
    cell.table = {name: [column[index] for index in order] for name, column in cell.table.items()}
    assert poses_of(split(cell.read())[1]) == before


@pytest.mark.parametrize("named", [7, [7]])
def test_sessions_are_held_out_as_a_whole(cell, named):
    with_sessions(cell)
    cell.document["holdout"] = {"session": named}
    training, held_out = split(cell.read())
    assert {session for session, _ in poses_of(held_out)} == {7}
    assert {session for session, _ in poses_of(training)} == {0}


def test_named_poses_are_held_out_in_every_session_or_in_one(cell):
    with_sessions(cell)
    cell.document["holdout"] = {"poses": [4, [7, 2]]}
    training, held_out = split(cell.read())
    assert poses_of(held_out) == {(0, 4), (7, 4), (7, 2)}
    assert poses_of(training).isdisjoint(poses_of(held_out))


def other_campaign(cell, tmp_path, **changes):
    """Write a campaign beside the cell's, with targets of its own, and hold it out."""
    table = cell.table | {"target": ["T"] * len(cell.table["pose"]), "repeat": list(range(len(cell.table["pose"])))}
    document = cell.document | {"campaign": "other", "targets": {"T": DOCUMENT["targets"]["B"]}, "robot": "planar"} | changes
    write_campaign(tmp_path / "other", document, table, 3)
    cell.document["holdout"] = {"campaign": "../other"}


def test_other_campaign_is_the_test_of_all_readings(cell, tmp_path):
    other_campaign(cell, tmp_path)
    campaign = cell.read()
    training, held_out = split(campaign)
    assert len(held_out) == 0
    assert_same(training, campaign.readings)
    other = held_out_campaign(campaign, cell.folder, cell.robots)
    assert (other.name, [target.name for target in other.targets]) == ("other", ["T"])
    assert len(other.readings) == len(campaign.readings)


def test_two_campaigns_may_test_each_other(cell, tmp_path):
    cell.write()
    other_campaign(cell, tmp_path, holdout={"campaign": "../cell7"})
    other = held_out_campaign(cell.read(), cell.folder, cell.robots)
    assert held_out_campaign(other, tmp_path / "other", cell.robots).name == "cell7"


def test_campaign_that_holds_out_its_own_poses_has_no_other(cell):
    assert held_out_campaign(cell.read(), cell.folder, cell.robots) is None


def test_other_campaign_of_another_chain_is_refused(cell, tmp_path):
    other_campaign(cell, tmp_path)
    cell.arm["chain"] = ARM["chain"].replace("0.7", "0.8")
    campaign = cell.read()
    with refused(cell.source, "holdout.campaign", "another chain", "the same chain"):
        held_out_campaign(campaign, cell.folder, cell.robots)


def test_other_campaign_that_is_not_there_is_refused(cell):
    cell.document["holdout"] = {"campaign": "../nowhere"}
    with refused(cell.source, "holdout.campaign", "'../nowhere'", "campaign.yaml"):
        cell.read()


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"robbot": "arm.yaml"}, "robbot", ["unknown key", "'robot'?"]),
        ({"campaign": "../cell"}, "campaign", ["letters"]),
        ({"measured": "poses"}, "measured", ["'poses'", "position | pose"]),
        ({"frame": "world"}, "frame", ["tracker | base"]),
        ({"compliance": "free"}, "compliance", ["nominal | identify"]),
        ({"targets": {}}, "targets", ["what is tracked"]),
        ({"targets": {"A": {"point": "elbow"}}}, "targets.A.offset_m", ["nothing", "unknown: fitted"]),
        ({"targets": {"A": {"point": "elbow", "offset_m": "unkown"}}}, "targets.A.offset_m", ["'unkown'", "allowed: unknown"]),
        ({"targets": {"A": {"point": "elbow", "offset_m": [0, 0]}}}, "targets.A.offset_m", ["3 or more entries"]),
        ({"targets": {"A": {"point": "elbow", "offset_m": [0, 0, "1"]}}}, "targets.A.offset_m[2]", ["'1'", "number"]),
        ({"targets": {"A": {"point": "elbw", "offset_m": "unknown"}}}, "targets.A.point", ["'elbw'", "'elbow'? (elbow, hand)"]),
        ({"targets": {1: {"point": "elbow", "offset_m": "unknown"}}}, "targets", ["the name 1", "in quotes"]),
        ({"targets": DOCUMENT["targets"] | {"C": DOCUMENT["targets"]["A"]}}, "targets.C", ["no reading", "measurements.csv"]),
        ({"robot": "planer"}, "robot", ["'planer'", "'planar'? (planar)"]),
        ({"robot": "../arm.yaml"}, "robot", ["'../arm.yaml'", "relative to this folder", "planar"]),
        ({"declared": ["joint_ofset"]}, "declared[0]", ["'joint_ofset'", "'joint_offset'? (joint_offset, payload)"]),
        ({"declared": ["payload", "payload"]}, "declared", ["each entry once"]),
        ({"noise": {"position_m": 0}}, "noise.position_m", ["more than 0"]),
        ({"noise": {"orientation_rad": 1e-4}}, "noise.position_m", ["nothing"]),
        ({"holdout": {}}, "holdout", ["found {}"]),
        ({"holdout": {"fraction": 0.3, "poses": [1, 2]}}, "holdout", ["fraction, poses together", "one of"]),
        ({"holdout": {"poses": [1, 2], "seed": 1}}, "holdout", ["poses, seed together", "one of"]),
        ({"holdout": {"seed": 1}}, "holdout", ["seed alone", "{fraction, seed}"]),
        ({"holdout": {"fraction": 1.0}}, "holdout.fraction", ["1.0", "between 0 and 1"]),
        ({"holdout": {"fraction": 0.3, "seed": 1.5}}, "holdout.seed", ["1.5", "integer"]),
        ({"holdout": {"poses": ["1"]}}, "holdout.poses[0]", ["'1'", "integer"]),
        ({"holdout": {"poses": [[0, 1, 2]]}}, "holdout.poses[0]", ["2 or fewer"]),
        ({"holdout": {"poses": [3, 12]}}, "holdout.poses", ["found 12", "0..9"]),
        ({"holdout": {"poses": [3, [1, 4]]}}, "holdout.poses", ["[1, 4]", "0..9"]),
        ({"holdout": {"poses": [3]}}, "holdout", ["9 poses to fit and 1 held out", "2 held out"]),
        ({"holdout": {"poses": [1, 2, 3, 4, 5, 6]}}, "holdout", ["4 poses to fit and 6 held out", "at least 5 to fit"]),
        ({"holdout": {"fraction": 0.6}}, "holdout", ["4 poses to fit and 6 held out", "at least 5 to fit"]),
        ({"holdout": {"fraction": 0.3, "blocks": 3}}, "holdout", ["fraction, blocks together", "{blocks, seed}"]),
        ({"holdout": {"session": 0, "seed": 1}}, "holdout", ["session, seed together", "{session}"]),
        ({"holdout": {"blocks": 1}}, "holdout.blocks", ["found 1", "2 or more"]),
        ({"holdout": {"blocks": 2.5}}, "holdout.blocks", ["2.5", "integer"]),
        ({"holdout": {"blocks": 11}}, "holdout.blocks", ["11", "at most as many as poses, 10"]),
        ({"holdout": {"blocks": 9}}, "holdout", ["1 held out", "2 held out"]),
        ({"holdout": {"session": 3}}, "holdout.session", ["found 3", "sessions that were measured: 0"]),
        ({"holdout": {"session": [0, "x"]}}, "holdout.session[1]", ["'x'", "integer"]),
        ({"holdout": {"session": []}}, "holdout.session", ["session"]),
        ({"holdout": {"session": 0}}, "holdout", ["0 poses to fit and 10 held out"]),
        ({"holdout": {"fraction": 0.1}}, "holdout", ["9 poses to fit and 1 held out", "2 held out"]),
    ],
)
def test_faulty_document_is_refused_in_one_line(cell, changes, key, words):
    cell.document |= changes
    with refused(f"{cell.source}: {key}", key, *words):
        cell.read(effects=["joint_offset", "payload"])


def test_declared_effects_are_not_checked_without_a_list_of_them(cell):
    cell.document["declared"] = ["anything"]
    assert cell.read().declared == ("anything",)


def test_fault_of_the_robot_file_names_that_file(cell):
    cell.arm["chain"] = "Tz(0.4) Rz(q1)"
    with refused((cell.folder / "arm.yaml").as_posix(), "chain", "measuring point"):
        cell.read()


@pytest.mark.parametrize("robot", ["arm.yaml", "planar"])
def test_missing_folder_is_refused(cell, robot):
    with refused(cell.source, "", "readable file"):
        read_campaign(cell.folder, cell.robots)


@pytest.mark.parametrize(
    ("row", "column", "entry", "words"),
    [
        (3, "q2", "0.1.2", ["'0.1.2'", "a number"]),
        (3, "q2", "", ["nothing", "a number"]),
        (80, "z", "nan", ["'nan'", "finite"]),
        (7, "fx", "inf", ["'inf'", "finite"]),
        (7, "time_s", "-Infinity", ["'-Infinity'", "finite"]),
        (2, "pose", "1.5", ["'1.5'", "integer"]),
        (2, "repeat", "3000000000", ["'3000000000'", "integer"]),
        (9, "approach2", 0.5, ["0.5", "-1, 0 or 1"]),
        (6, "target", "a", ["'a'", "'A'? (A, B)"]),
        (6, "target", "", ["nothing", "A, B"]),
        (1, "fz", 3.0, ["3 with load 0", "0 where load is 0"]),
        (4, "q1", 57.3, ["57.3", "rad, not degrees", "-3.14 to 3.14", "reported_joints"]),
        (4, "q2", -4.0, ["-4", "rad, not degrees", "-1.75 to 0.79"]),
        (40, "y", 812.4, ["812.4", "metres, not millimetres", "reaches"]),
        (12, "rx, ry, rz", None, ["a turn of", "not degrees"]),
    ],
)
def test_faulty_cell_is_refused_by_row_and_column(cell, row, column, entry, words):
    for name in column.split(", "):
        cell.spoil(row, name, 45.0 if entry is None else entry)
    with refused(cell.measurements, f"row {row}, column {column}", *words):
        cell.read()


def test_faulty_cell_of_a_parquet_file_is_refused_alike(cell):
    cell.spoil(5, "x", None)
    cell.write("parquet")
    with refused((cell.folder / "measurements.parquet").as_posix(), "row 5, column x", "found nothing", "finite"):
        read_campaign(cell.folder, cell.robots)


def test_whole_file_in_degrees_or_millimetres_is_refused(cell, tmp_path):
    for names, factor, words in ((["q1", "q2", "q3"], 57.3, "degrees"), (["x", "y", "z"], 1e3, "millimetres")):
        spoilt = Cell(tmp_path / words)
        tmp_path.joinpath(words).mkdir()
        for name in names:
            spoilt.table[name] = [factor * number for number in spoilt.table[name]]
        with refused(spoilt.measurements, f"column {names[0][0]}" if factor < 100 else "column ", words):
            spoilt.read()


def test_joint_just_beyond_its_limit_is_no_degrees(cell):
    for row in range(1, 9):
        cell.spoil(row, "q2", 1.2)
    assert len(cell.read().readings) == len(cell.table["pose"])


def test_wrong_sign_beyond_a_limit_is_no_degrees(cell):
    for row in range(1, 9):
        cell.spoil(row, "q2", 1.7)
    assert len(cell.read().readings) == len(cell.table["pose"])


def test_joint_angles_are_judged_in_the_models_convention(cell):
    cell.arm["reported_joints"] = {"offset_deg": [0, 180, 0]}
    cell.table["q2"] = [angle - np.pi for angle in cell.table["q2"]]
    assert len(cell.read().readings) == len(cell.table["pose"])


def test_the_same_reading_twice_is_refused(cell):
    cell.spoil(7, "repeat", 0)
    found = "pose 0, load 1, repeat 0, target A again"
    with refused(cell.measurements, "row 7", found, "first in row 5"):
        cell.read()


def test_readings_of_one_pose_at_other_angles_are_refused(cell):
    cell.spoil(14, "q3", cell.table["q3"][8] + 0.025)
    with refused(cell.measurements, "row 14, column q3", "0.025 rad from row 9", "within 0.02 rad"):
        cell.read()


def test_load_without_columns_of_the_wrench_is_refused(cell):
    cell.without(*WRENCH)
    with refused(cell.measurements, "row 5, column load", "found 1", "no columns fx"):
        cell.read()


@pytest.mark.parametrize("missing", ["pose", "load", "repeat", "target", "q3", "y", "rz", "mx", "approach1"])
def test_missing_column_is_refused(cell, missing):
    cell.without(missing)
    with refused(cell.measurements, "header", f"no column {missing!r}", f"{missing}: "):
        cell.read()


@pytest.mark.parametrize(
    ("name", "hint"), [("Load", "'load'?"), ("temperature", "'temperature_c'?"), ("q4", "q3, for 3 joints")]
)
def test_unknown_column_is_refused_with_the_closest_known(cell, name, hint):
    old = {"Load": "load", "temperature": "temperature_c", "q4": "q3"}[name]
    cell.table = {name if column == old else column: cells for column, cells in cell.table.items()}
    with refused(cell.measurements, "header", f"unknown column {name!r}", hint):
        cell.read()


def test_column_that_is_there_twice_is_refused(cell):
    cell.write()
    path = cell.folder / "measurements.csv"
    path.write_text(path.read_text(encoding="utf-8").replace("q2", "q1", 1), encoding="utf-8")
    with refused(cell.measurements, "header", "column 'q1' twice", "once"):
        read_campaign(cell.folder, cell.robots)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_other_separators_are_refused(cell, separator):
    cell.write(separator=separator)
    with refused(cell.measurements, "header", "separated by commas"):
        read_campaign(cell.folder, cell.robots)


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        (b"", "", ["an empty file"]),
        (b"pose,load\n", "", ["no row of data"]),
        (b"pose,load\n0,0\n0,0,0\n", "row 2", ["3 cells", "2, one for each column"]),
        (b'pose,load\n0,"0\n', "", ["comma-separated"]),
        (b"pose,load\n0,\xff\n", "byte 12", ["not UTF-8"]),
    ],
)
def test_file_that_is_no_table_is_refused(cell, text, key, words):
    cell.write()
    (cell.folder / "measurements.csv").write_bytes(text)
    with refused(cell.measurements, key, *words):
        read_campaign(cell.folder, cell.robots)


def test_parquet_that_cannot_be_read_is_refused(cell):
    cell.write()
    (cell.folder / "measurements.csv").rename(cell.folder / "measurements.parquet")
    with refused((cell.folder / "measurements.parquet").as_posix(), "", "no readable Parquet file"):
        read_campaign(cell.folder, cell.robots)


def test_parquet_whose_text_is_no_utf8_is_refused(cell):
    cell.write("parquet")
    names = pa.array([b"\xd8"] * len(cell.table["pose"]), pa.binary())
    broken = pa.Array.from_buffers(pa.string(), len(names), names.buffers())
    path = cell.folder / "measurements.parquet"
    pq.write_table(pa.table(cell.table | {"target": broken}), path)
    with refused(path.as_posix(), "", "no readable Parquet file"):
        read_campaign(cell.folder, cell.robots)


def test_one_file_of_measurements_must_be_there(cell):
    cell.write()
    cell.write("parquet")
    with refused(cell.folder.as_posix(), "", "both measurements.csv and", "one of them"):
        read_campaign(cell.folder, cell.robots)
    for name in ("measurements.csv", "measurements.parquet"):
        (cell.folder / name).unlink()
    with refused(cell.folder.as_posix(), "", "neither measurements.csv nor", "one of them"):
        read_campaign(cell.folder, cell.robots)
