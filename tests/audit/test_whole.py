"""The whole audit of a folder."""

import pytest
from audited_campaigns import altered, audit_of, diagnosed_campaign
from made_audits import CONFIGURATION, failed
from planted_errors import forge
from support import refused

from elastocal_proof.audit.audited import Audited
from elastocal_proof.audit.findings import Finding
from elastocal_proof.audit.whole import as_table, audit, require_all


def test_an_empty_folder_is_no_finished_run(tmp_path):
    assert [finding.holds for finding in audit(Audited(tmp_path, CONFIGURATION, {}, {}, 4))] == [False]


def test_a_file_that_cannot_be_read_is_a_finding_and_no_traceback(tmp_path):
    file = "results/budget/kuka.parquet"
    (tmp_path / "results/budget").mkdir(parents=True)
    (tmp_path / file).write_bytes(b"no table")
    forge(tmp_path, file)
    found = audit(Audited(tmp_path, CONFIGURATION, {}, {}, 4))
    assert [finding.holds for finding in found] == [True, False, False]
    assert "ArrowInvalid" in found[1].note


def test_a_run_of_which_a_check_does_not_hold_is_refused_by_the_file():
    rows = [Finding("rows", "pandas", 1, 0.0, file="a.csv"), Finding("column x", "pandas", 3, 2.0, "found 1", "b.csv")]
    with refused("b.csv", "column x", "1 of 2 checks"):
        require_all(as_table(rows), "audit.html")
    assert require_all(as_table(rows[:1]), "audit.html") == "1 files, 1 checks, 1 values compared: all hold\n"


BARE = {"covariates": ()}
# Robot, effects, whether it weighs, and how it is measured.
HONEST = {
    "nothing wrong, three kilonewtons": ("fanuc", (), False, {"force_N": 3000.0}),
    "a joint off, no covariates": ("kuka", ("joint_offset",), False, BARE),
    "a limber arm whose gear errs": ("iiwa14", ("transmission_harmonic",), False, BARE),
    "links that bend, all points": ("kuka", ("link_elasticity",), False, {**BARE, "points": ("3DoF", "6DoF")}),
    "declared weights": ("fanuc", ("joint_offset",), True, {}),
    "declared weights, no covariates": ("abb", (), True, BARE),
    "weights behind a parallelogram, declared noise": ("gp180", (), True, {"declared_noise": (6e-5, 6e-5)}),
    "positions alone, a payload": ("abb", ("payload",), True, {"measured": "position"}),
    "too small a declared noise, no repeats": (
        *("kuka", (), False),
        {**BARE, "measured": "position", "declared_noise": (2e-5, 2e-5), "repeats": 1, "repeated_poses": 0},
    ),
    "the tracker's frame": ("kuka", ("joint_offset",), False, {"frame": "tracker"}),
    "declared geometry": ("kuka", (), False, {"declared": ("joint_offset", "link_geometry")}),
    "a set-up that moved, repeats on both sides": ("kuka", ("setup_step",), False, {"repeated_poses": 12}),
    "what no catalogue has": ("fanuc", ("outside:foreign_angle_stiffness",), False, BARE),
}


@pytest.mark.parametrize("case", HONEST)
def test_an_honest_campaign_raises_no_alarm(case, tmp_path):
    robot, effects, weighs, design = HONEST[case]
    found = audit_of(diagnosed_campaign(tmp_path, robot, effects, weighs, **design))
    assert [finding for finding in found if not finding.holds] == []
    assert len(found) >= 18


@pytest.fixture(scope="module")
def weighing(tmp_path_factory):
    """A campaign of which neither weights nor approaches are left out."""
    return diagnosed_campaign(tmp_path_factory.mktemp("audited"), "fanuc", ("joint_offset",), weighs=True)


@pytest.mark.parametrize(
    ("file", "column", "row", "change", "expected"),
    [
        ("reports/loop/cell/residuals.parquet", "before_dy", 7, lambda v: v + 1e-7, "residuals of the declared model"),
        ("reports/loop/cell/residuals.parquet", "after_dz", 7, lambda v: v + 1e-5, "train errors after"),
        ("reports/loop/cell/residuals.parquet", "after_dz", -1, lambda v: v + 1e-5, "heldout errors after"),
        ("results/loop/cell/steps.parquet", "value", 1, lambda v: 1.001 * v, "residuals of the declared model"),
    ],
)
def test_one_number_altered_is_found(weighing, file, column, row, change, expected):
    """A residual by 0.1 µm, or by 10 µm where only means are known; a compliance by a thousandth of itself."""
    with altered(weighing, file, (column, row), change):
        found = failed(audit_of(weighing))
    assert any(name.startswith(expected) for name in found), found
