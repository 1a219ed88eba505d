"""A few bad rows do not change the verdict of a campaign, and each of them is reported
with its line."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS, analysed
from made_folders import PLAN, make_folder, make_table

from elastocal.application.calibrated import compute_nominal_poses
from elastocal.campaigns.writing import write_campaign
from elastocal.exchange.measurement_table import ImportOptions, read_measurement_table
from elastocal.loop.whole import diagnose_folder, read_cases

NOISE_M = 5e-5
POSES = 60
HELD_OUT = [5, 9, 14, 18, 23, 27, 31, 36, 40, 44, 47, 49, 52, 54, 56, 57, 59, 60]
# Zero offsets of a wrong mastering, rad. The offset of the last joint moves no point on
# its axis.
OFFSETS = np.array([1.8, -2.1, 1.6, 2.4, -1.9, 0.0]) * 1e-3


def lose_beam(table, row):
    """The tracker lost the beam: the row reads zeros."""
    for axis in "xyz":
        table[axis][row - 1] = 0.0


def hold_point(table, row):
    """The tracker repeated the point of the row before."""
    for axis in "xyz":
        table[axis][row - 1] = table[axis][row - 2]


def shift_by(distance_m):
    def damage(table, row):
        table["x"][row - 1] += distance_m

    return damage


def mistype_angle(table, row):
    table["q2"][row - 1] += 0.05


def diagnose_damaged(folder, damage=None, row=None):
    """Verdict on 60 poses of a UR10 with one row each, one of which is damaged by a
    function."""
    robot = analysed("ur10")
    generator = np.random.default_rng(33)
    shown = generator.uniform(-2.0, 2.0, (POSES, robot.joints))
    actual = robot.reported_angles(robot.model_angles(shown) + OFFSETS)
    position = compute_nominal_poses(robot, actual)[0]
    position = position + NOISE_M * generator.standard_normal(position.shape)
    table = {
        "pose": np.arange(1, POSES + 1),
        "load": np.zeros(POSES, int),
        "repeat": np.zeros(POSES, int),
        "target": np.full(POSES, "S"),
    }
    for joint in range(robot.joints):
        table[f"q{joint + 1}"] = shown[:, joint].copy()
    for axis, name in enumerate("xyz"):
        table[name] = position[:, axis].copy()
    if damage is not None:
        damage(table, row)
    document = {
        "campaign": "made",
        "robot": "ur10",
        "measured": "position",
        "frame": "base",
        "targets": {"S": {"point": "6DoF", "offset_m": [0, 0, 0]}},
        "compliance": "nominal",
        "declared": [],
        "noise": {"position_m": NOISE_M},
        "holdout": {"poses": HELD_OUT},
    }
    write_campaign(folder, document, table, robot.joints, "csv")
    return diagnose_folder(folder, ROBOTS, 1)


def summarize_effects(verdict):
    joints = {effect["name"]: effect["joints"] for effect in verdict["effects"]}
    return verdict["verdict"], joints


def list_gross_error_rows(verdict):
    rows = []
    for gross_error in verdict.get("gross_errors", []):
        rows += gross_error["rows"]
    return sorted(rows)


@pytest.fixture(scope="module")
def clean_verdict(tmp_path_factory):
    verdict = diagnose_damaged(tmp_path_factory.mktemp("clean"))
    assert [effect["name"] for effect in verdict["effects"]] == ["joint_offset"]
    assert list_gross_error_rows(verdict) == []
    return verdict


@pytest.mark.parametrize(
    ("damage", "size_m"),
    [
        pytest.param(shift_by(1e-3), 1e-3, marks=pytest.mark.slow),
        (shift_by(0.1), 0.1),
        *(
            pytest.param(damage, None, marks=pytest.mark.slow)
            for damage in (lose_beam, hold_point, mistype_angle)
        ),
    ],
    ids=["1 mm", "100 mm", "lost beam", "held point", "wrong angle"],
)
def test_one_bad_row_keeps_the_verdict_and_is_reported_with_its_line_and_size(
    tmp_path, clean_verdict, damage, size_m
):
    verdict = diagnose_damaged(tmp_path, damage, 8)
    assert summarize_effects(verdict) == summarize_effects(clean_verdict)
    assert list_gross_error_rows(verdict) == [8]
    (gross_error,) = verdict["gross_errors"]
    # The header is line 1.
    assert "line 9" in gross_error["detail"]
    assert "left out" in gross_error["detail"]
    assert not gross_error["held_out"]
    assert gross_error["pose"] == 8
    assert gross_error["target"] == "S"
    assert gross_error["standard_deviations"] > 5.0
    assert 0.9 < gross_error["probability"] <= 1.0
    if size_m is not None:
        assert gross_error["distance_m"] == pytest.approx(size_m, abs=5e-4)
    if size_m == 0.1:
        assert "100 mm" in gross_error["detail"]


def test_a_bad_held_out_row_is_reported_and_errors_with_and_without_it_are_given(
    tmp_path, clean_verdict
):
    verdict = diagnose_damaged(tmp_path, lose_beam, 14)
    assert summarize_effects(verdict) == summarize_effects(clean_verdict)
    assert list_gross_error_rows(verdict) == [14]
    assert verdict["gross_errors"][0]["held_out"]
    after_m = verdict["heldout"]["after"]["rms_m"]
    assert after_m < 1.1 * clean_verdict["heldout"]["after"]["rms_m"]
    assert verdict["heldout"]["with_gross_errors"]["after"]["rms_m"] > 100 * after_m
    assert any("line 15" in warning for warning in verdict["warnings"])


UNITS = {"q": "rad", "f": "N", "m": "Nm", "x": "m", "y": "m", "z": "m"}


def import_campaign(folder, table, lost_row=None):
    """A campaign from a table without pose numbers, as an importer makes it. The lost
    row, counted from 1, reads zeros throughout."""
    names = [name for name in table if name[0] in UNITS]
    rows = np.column_stack([table[name] for name in names])
    if lost_row is not None:
        rows[lost_row - 1] = 0.0
    folder.mkdir(parents=True)
    header = ",".join(f"{name} [{UNITS[name[0]]}]" for name in names)
    np.savetxt(folder / "table.csv", rows, "%.12g", ",", header=header, comments="")
    robot = analysed("kuka")
    options = ImportOptions(target="6DoF")
    imported = read_measurement_table(folder / "table.csv", options, robot)
    target = {"6DoF": {"point": "6DoF", "offset_m": [0, 0, 0]}}
    return make_folder(
        folder, robot, table=imported.table, targets=target, compliance="nominal"
    )


def select_training_results(verdict):
    """Everything that a held-out row must not change."""
    names = ("verdict", "probabilities", "kept", "misfit", "noise", "settings")
    results = {name: verdict[name] for name in names}
    results["effects"] = []
    for effect in verdict["effects"]:
        names = ("name", "joints", "probability", "parameters")
        results["effects"].append({name: effect[name] for name in names})
    return results


def make_clean_and_damaged(folder, number):
    """Two folders of a campaign of 24 poses whose joint 3 has an offset, and the
    held-out row that is lost in the second one. Every second campaign has two loads."""
    force_N, ladder = ((0.0, (0,)), (800.0, (0, 1)))[number % 2]
    plan = replace(
        PLAN,
        points=("6DoF",),
        poses=24,
        force_N=force_N,
        ladder=ladder,
        repeats=1,
        repeated_poses=0,
    )
    table = make_table(analysed("kuka"), "made", number, plan, 3e-4 * (number % 5))
    order = np.lexsort([table["load"], table["pose"]])
    table = {name: column[order] for name, column in table.items()}
    clean = import_campaign(folder / "clean", table)
    held_out_rows = read_cases(clean, ROBOTS)[1].campaign.measurements.row
    lost_row = int(np.random.default_rng(number).choice(held_out_rows))
    return clean, import_campaign(folder / "damaged", table, lost_row), lost_row


def assert_training_rows_are_equal(clean, damaged, number):
    before = read_cases(clean, ROBOTS)[0].campaign.measurements
    after = read_cases(damaged, ROBOTS)[0].campaign.measurements
    for name in ("position", "joint_angles", "wrench", "row"):
        np.testing.assert_array_equal(
            getattr(before, name), getattr(after, name), err_msg=f"{number}: {name}"
        )


def assert_verdicts_are_equal(clean, damaged, lost_row, number):
    before = diagnose_folder(clean, ROBOTS, 1)
    after = diagnose_folder(damaged, ROBOTS, 1)
    assert select_training_results(before) == select_training_results(after), number
    expected_rows = sorted({*list_gross_error_rows(before), lost_row})
    assert list_gross_error_rows(after) == expected_rows, number


def test_a_lost_held_out_row_changes_neither_the_training_poses_nor_the_verdict(
    tmp_path,
):
    # Each of the five errors of a joint, without and with loads.
    for number in range(10):
        clean, damaged, lost_row = make_clean_and_damaged(
            tmp_path / str(number), number
        )
        assert_training_rows_are_equal(clean, damaged, number)
        # Diagnose only one campaign; the slow test reads and diagnoses forty.
        if number == 1:
            assert_verdicts_are_equal(clean, damaged, lost_row, number)


@pytest.mark.slow
def test_a_lost_held_out_row_changes_none_of_40_verdicts(tmp_path):
    """If one verdict in fourteen changed, the test would find it with 95 %."""
    for number in range(40):
        clean, damaged, lost_row = make_clean_and_damaged(
            tmp_path / str(number), number
        )
        assert_training_rows_are_equal(clean, damaged, number)
        assert_verdicts_are_equal(clean, damaged, lost_row, number)
