import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

import elastocal as ec
from elastocal.interface.diagnoses import PROPOSED_POSES, SEED

TOP = Path(__file__).resolve().parents[2]
VERDICT = "reports/loop/ur5_every_seventh/verdict.json"


def test_a_wrong_zero_is_named_and_its_size_found(result):
    (effect,) = result.effects
    (parameter,) = effect.parameters
    assert effect.name == "joint_offset"
    assert effect.joints == (2,)
    assert abs(parameter.value - 2e-3) < 3.0 * parameter.std_error


def test_errors_fall_to_the_noise(result):
    floor_m = result.verdict.heldout.noise_floor_rms_m
    assert result.before.rms_m > 20 * floor_m
    assert result.after.rms_m < 1.2 * floor_m


def test_seed_and_proposed_poses_are_those_of_the_workflow():
    config = yaml.safe_load((TOP / "config.yaml").read_text("utf-8"))
    assert config["seed"] == SEED
    assert config["loop"]["proposed_states"] == PROPOSED_POSES


def test_result_prints_verdict_and_errors_in_a_few_lines(result):
    first, second, *_ = str(result).splitlines()
    assert "zero offset of joint 2" in first
    assert f"{1e3 * result.after.rms_m:.3f} mm" in second


def test_residuals_have_a_row_for_each_measurement(result, campaign):
    assert len(result.residuals["row"]) == len(campaign)
    assert result.residuals["held_out"].any()


def test_residuals_are_without_gross_errors_as_those_of_the_report(nominal, measured):
    wrong = measured.copy()
    wrong.loc[20, "x"] += 0.05
    target = {"reflector": {"point": "tool", "offset_m": [0, 0, 0], "offset_std_m": 0}}
    settings = {"frame": "base", "declared": [], "remainder": "none"}
    campaign = ec.Campaign.from_table(nominal, wrong, targets=target, **settings)
    result = ec.diagnose(campaign)
    assert len(result.verdict.gross_errors) == 1
    assert len(result.residuals["row"]) == len(campaign) - 1


def test_report_is_written_and_its_facts_name_the_effect(result, tmp_path):
    result.report(tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
    assert "zero offset of joint 2" in result.facts["sentences"][0]


def test_progress_is_reported_in_lines(campaign):
    lines = []
    ec.diagnose(campaign, report_progress=lines.append)
    assert lines
    assert all("\n" not in line for line in lines)


@pytest.mark.slow
def test_a_folder_gives_the_verdict_of_the_command(tmp_path):
    """The same campaign by `elastocal diagnose` and in memory."""
    subprocess.run(
        [
            sys.executable,
            "-m",
            "snakemake",
            "-j1",
            "-d",
            str(TOP),
            "reports/loop/ur5_every_seventh/verdict.json",
        ],
        check=True,
        cwd=TOP,
    )
    campaign = ec.read_campaign(
        TOP / "data/campaigns/ur5_every_seventh", TOP / "config/robots"
    )
    result = ec.diagnose(campaign)
    verdict = ec.read_verdict(TOP / VERDICT)
    (effect,) = result.effects
    (stored,) = verdict.missing_effects
    assert effect.members == stored.members
    np.testing.assert_allclose(effect.probability, stored.probability, atol=1e-3)
    # The workflow restores the fits from files and lets them converge once more, which
    # moves errors far above the noise by a thousandth.
    for name in ("before", "after", "delivered"):
        np.testing.assert_allclose(
            getattr(result.verdict.heldout, name).rms_m,
            getattr(verdict.heldout, name).rms_m,
            rtol=1e-3,
        )
    np.testing.assert_allclose(
        result.verdict.accuracy.rms_m, verdict.accuracy.rms_m, rtol=1e-2
    )
