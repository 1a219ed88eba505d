"""A campaign that declares far less noise than its measurements have: sizes of effects stay what they are in mm and mrad."""

from dataclasses import replace

import numpy as np
import pytest
from made_folders import PLAN, made_folder, made_table

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import cases_in

OFFSET = 1e-3


@pytest.fixture(scope="module")
def diagnosed(kuka, config_folder, tmp_path_factory):
    """Diagnoses by the noise that is declared, m, of measurements that scatter by 60 um without repeats."""
    found = {}
    for declared_m in (6e-5, 1e-6):
        folder = tmp_path_factory.mktemp("noise") / "made"
        table = made_table(kuka, "made", plan=PLAN, offset_of_joint_3=OFFSET)
        first = [repeat == 0 for repeat in table["repeat"]]
        table = {name: [value for value, kept in zip(values, first, strict=True) if kept] for name, values in table.items()}
        changes = {"noise": {"position_m": declared_m}, "declared": ["link_geometry"]}
        case, _ = cases_in(made_folder(folder, kuka, table=table, **changes), config_folder / "robots")
        found[declared_m] = diagnose(case, Settings(), 1)
    return found


def test_the_problem_is_whitened_by_the_noise_that_is_there(diagnosed):
    rows = [diagnosed[level].evidence.linearized for level in (6e-5, 1e-6)]
    assert rows[0].about.noise.position_m == pytest.approx(6e-5, rel=0.3)
    assert rows[1].about.noise.position_m == pytest.approx(6e-5, rel=0.3)


def test_sizes_and_verdict_do_not_follow_the_noise_that_was_declared(diagnosed):
    right, wrong = diagnosed[6e-5], diagnosed[1e-6]
    assert right.evidence.linearized.declared_size == wrong.evidence.linearized.declared_size
    # The wrong zero of a joint is a wrong geometry of its link, which is declared.
    assert right.document["verdict"] == wrong.document["verdict"] == "adequate"
    assert right.document["noise"]["factor"] == pytest.approx(1.0, abs=0.3)
    assert wrong.document["noise"]["factor"] == pytest.approx(60.0, rel=0.3)
    errors = [np.sqrt(np.diag(each.final.covariance)) for each in (right, wrong)]
    np.testing.assert_allclose(errors[0], errors[1], rtol=0.35)
    assert right.final.converged and wrong.final.converged


def test_noise_that_is_far_too_small_is_a_warning(diagnosed):
    told = [[line for line in diagnosed[level].document["warnings"] if "scatter" in line] for level in (6e-5, 1e-6)]
    assert not told[0] and len(told[1]) == 1
    assert "the noise that is declared" in told[1][0]


@pytest.mark.parametrize("error_rad", [0.0, 3e-4])
def test_an_error_that_all_measurements_of_a_pose_share_is_noise_of_the_model_and_said(
    error_rad, kuka, config_folder, tmp_path
):
    """Joints that stand otherwise in each pose than they report, by the same in all of its measurements."""
    table = made_table(kuka, "made", plan=replace(PLAN, poses=40))
    drawn = error_rad * np.random.default_rng(3).standard_normal((max(table["pose"]) + 1, 6))
    table |= {f"q{joint}": table[f"q{joint}"] + drawn[table["pose"], joint - 1] for joint in range(1, 7)}
    case, _ = cases_in(made_folder(tmp_path / "made", kuka, table=table), config_folder / "robots")
    found = diagnose(case, Settings(), 1)
    said = [line for line in found.document["warnings"] if "err together" in line]
    assert found.document["verdict"] == "adequate"
    assert len(said) == (error_rad > 0)
    # To the steps of its grid, of which neighbours differ by a factor of two.
    assert found.final.noise.pose_rad == pytest.approx(error_rad, rel=0.8)
    assert found.document["noise"]["pose_rad"] == found.final.noise.pose_rad
