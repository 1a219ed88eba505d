"""A campaign with a few bad rows: the verdict is that of the clean file, and the rows
are named with their line."""

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
# Zero offsets of a mastering that went wrong, rad; that of the last joint moves no
# point on its axis.
OFFSETS = np.array([1.8, -2.1, 1.6, 2.4, -1.9, 0.0]) * 1e-3


def lost_beam(table, row):
    for axis in "xyz":
        table[axis][row - 1] = 0.0


def held_point(table, row):
    for axis in "xyz":
        table[axis][row - 1] = table[axis][row - 2]


def off_by(distance_m):
    def damage(table, row):
        table["x"][row - 1] += distance_m

    return damage


def wrong_angle(table, row):
    table["q2"][row - 1] += 0.05


def verdict_on(folder, damage=(), **changes):
    """Verdict on 60 poses of a UR10, one row each, with some of them damaged: pairs of
    a function and its rows."""
    robot = analysed("ur10")
    draws = np.random.default_rng(33)
    shown = draws.uniform(-2.0, 2.0, (POSES, robot.joints))
    at = compute_nominal_poses(
        robot, robot.reported_angles(robot.model_angles(shown) + OFFSETS)
    )[0]
    table = {
        "pose": np.arange(1, POSES + 1),
        "load": np.zeros(POSES, int),
        "repeat": np.zeros(POSES, int),
    }
    table |= {"target": np.full(POSES, "S")} | {
        f"q{joint}": angle.copy() for joint, angle in enumerate(shown.T, 1)
    }
    table |= dict(
        zip(
            "xyz",
            (at + NOISE_M * draws.standard_normal(at.shape)).T.copy(),
            strict=True,
        )
    )
    for spoil, *rows in damage:
        spoil(table, *rows)
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
    write_campaign(folder, document | changes, table, robot.joints, "csv")
    return diagnose_folder(folder, ROBOTS, 1)


def places(verdict):
    return verdict["verdict"], {
        effect["name"]: effect["joints"] for effect in verdict["effects"]
    }


def named_rows(verdict):
    return sorted(
        row for entry in verdict.get("gross_errors", []) for row in entry["rows"]
    )


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    found = verdict_on(tmp_path_factory.mktemp("clean"))
    assert [effect["name"] for effect in found["effects"]] == [
        "joint_offset"
    ] and named_rows(found) == []
    return found


@pytest.mark.parametrize(
    ("damage", "size_m"),
    [
        pytest.param(off_by(1e-3), 1e-3, marks=pytest.mark.slow),
        (off_by(0.1), 0.1),
        *(
            pytest.param(damage, None, marks=pytest.mark.slow)
            for damage in (lost_beam, held_point, wrong_angle)
        ),
    ],
    ids=["1 mm", "100 mm", "lost beam", "held point", "wrong angle"],
)
def test_one_bad_row_leaves_the_verdict_and_is_named_with_its_line_and_its_size(
    tmp_path, clean, damage, size_m
):
    found = verdict_on(tmp_path, [(damage, 8)])
    assert places(found) == places(clean)
    assert named_rows(found) == [8]
    (entry,) = found["gross_errors"]
    # The header is line 1.
    assert "line 9" in entry["detail"] and "left out" in entry["detail"]
    assert not entry["held_out"] and entry["pose"] == 8 and entry["target"] == "S"
    assert entry["standard_deviations"] > 5.0
    assert size_m is None or entry["distance_m"] == pytest.approx(size_m, abs=5e-4)
    assert size_m != 0.1 or "100 mm" in entry["detail"]


def test_a_bad_row_that_is_held_out_is_named_and_both_errors_are_given(tmp_path, clean):
    found = verdict_on(tmp_path, [(lost_beam, 14)])
    assert places(found) == places(clean)
    assert named_rows(found) == [14] and found["gross_errors"][0]["held_out"]
    heldout = found["heldout"]
    assert heldout["after"]["rms_m"] < 1.1 * clean["heldout"]["after"]["rms_m"]
    assert (
        heldout["with_gross_errors"]["after"]["rms_m"] > 100 * heldout["after"]["rms_m"]
    )
    assert any("line 15" in warning for warning in found["warnings"])


UNITS = {"q": "rad", "f": "N", "m": "Nm", "x": "m", "y": "m", "z": "m"}


def imported(folder, table, lost):
    """A campaign of a table without numbers of poses, as an importer makes it; rows
    that are lost read zeros throughout."""
    names = [name for name in table if name[0] in UNITS]
    rows = np.column_stack([table[name] for name in names])
    rows[lost] = 0.0
    folder.mkdir(parents=True)
    heads = ",".join(f"{name} [{UNITS[name[0]]}]" for name in names)
    np.savetxt(folder / "table.csv", rows, "%.12g", ",", header=heads, comments="")
    robot = analysed("kuka")
    found = read_measurement_table(
        folder / "table.csv", ImportOptions(target="6DoF"), robot
    )
    target = {"6DoF": {"point": "6DoF", "offset_m": [0, 0, 0]}}
    return make_folder(
        folder, robot, table=found.table, targets=target, compliance="nominal"
    )


def facts_of(verdict):
    """All that a row that is held out may not change."""
    effects = [
        {key: entry[key] for key in ("name", "joints", "probability", "parameters")}
        for entry in verdict["effects"]
    ]
    return {
        key: verdict[key]
        for key in ("verdict", "probabilities", "kept", "misfit", "noise", "settings")
    } | {"e": effects}


def assert_a_lost_held_out_row_changes_nothing(folder, number, whole):
    """Of 24 poses, of every second campaign under two loads, whose joint 3 is off."""
    forces = ((0.0, (0,)), (800.0, (0, 1)))[number % 2]
    plan = replace(
        PLAN,
        points=("6DoF",),
        poses=24,
        force_N=forces[0],
        ladder=forces[1],
        repeats=1,
        repeated_poses=0,
    )
    table = make_table(analysed("kuka"), "made", number, plan, 3e-4 * (number % 5))
    order = np.lexsort([table["load"], table["pose"]])
    table = {name: column[order] for name, column in table.items()}
    clean = imported(folder / "clean", table, [])
    rows = read_cases(clean, ROBOTS)[1].campaign.measurements.row
    lost = int(np.random.default_rng(number).choice(rows))
    damaged = imported(folder / "damaged", table, [lost - 1])
    before, after = (
        read_cases(each, ROBOTS)[0].campaign.measurements for each in (clean, damaged)
    )
    for name in ("position", "joint_angles", "wrench", "row"):
        np.testing.assert_array_equal(
            getattr(before, name), getattr(after, name), err_msg=f"{number}: {name}"
        )
    if whole:
        verdicts = [diagnose_folder(each, ROBOTS, 1) for each in (clean, damaged)]
        assert facts_of(verdicts[0]) == facts_of(verdicts[1]), number
        assert named_rows(verdicts[1]) == sorted({*named_rows(verdicts[0]), lost}), (
            number
        )


def test_a_lost_row_that_is_held_out_parts_no_pose_anew_and_changes_nothing_of_the_verdict(
    tmp_path,
):
    for number in range(20):
        assert_a_lost_held_out_row_changes_nothing(
            tmp_path / str(number), number, number < 2
        )


@pytest.mark.slow
def test_of_200_campaigns_none_says_anything_else_with_a_lost_row_that_is_held_out(
    tmp_path,
):
    for number in range(200):
        assert_a_lost_held_out_row_changes_nothing(tmp_path / str(number), number, True)
