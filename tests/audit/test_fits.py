"""Fits of a diagnosed campaign hold; their parameters, standard errors, noise or residuals altered do not."""

import pandas as pd
import pytest
from audited_campaigns import altered, audit_of, failed_once_altered

FOLDER = "results/loop/cell"
STEPS, DIAGNOSIS, CAMPAIGN = (f"{FOLDER}/{name}" for name in ("steps.parquet", "diagnosis.json", "campaign.json"))
RESIDUALS = "reports/loop/cell/residuals.parquet"


def test_a_parameter_off_by_a_hundredth_of_its_standard_error_is_found(diagnosed):
    error = pd.read_parquet(diagnosed / STEPS)["std_error"].iloc[1]
    found = failed_once_altered(diagnosed, STEPS, ("value", 1), lambda value: value + 0.01 * error)
    assert found == ["estimates of step 1 (declared) stand still, in standard errors"]


def test_a_standard_error_halved_is_found(diagnosed):
    found = failed_once_altered(diagnosed, STEPS, ("std_error", 0), lambda value: 0.5 * value)
    assert "standard errors of step 1 (declared)" in found


def test_a_residual_of_a_held_out_pose_is_found(diagnosed):
    assert pd.read_parquet(diagnosed / RESIDUALS)["held_out"].iloc[-1]
    found = failed_once_altered(diagnosed, RESIDUALS, ("before_ry", -1), lambda value: value + 1e-7)
    assert found == ["residuals before, fitted and held out, all rows"]


def test_noise_that_is_not_that_of_the_repeats_is_found(diagnosed):
    keys = ["steps", 0, "noise", "orientation_rad"]
    found = failed_once_altered(diagnosed, DIAGNOSIS, keys, lambda value: 1.01 * value, STEPS)
    assert found == ["noise of step 0, from repeats"]


@pytest.mark.parametrize(("stated", "expected"), [(1.3, []), (1.31, ["noise of step 1, from repeats"])])
def test_noise_may_be_that_of_the_repeats_times_the_factor_that_is_stated(diagnosed, stated, expected):
    """Of a step about which measurements scatter more than about each other."""

    def larger(noise):
        return noise | {name: 1.3 * noise[name] for name in ("position_m", "orientation_rad")}

    with altered(diagnosed, DIAGNOSIS, ["steps", 1, "noise"], larger):
        found = failed_once_altered(diagnosed, DIAGNOSIS, ["document", "noise", "factor"], lambda _: stated, STEPS)
    assert [name for name in found if name.startswith("noise")] == expected


@pytest.mark.parametrize(
    ("key", "other"),
    [("frame", "tracker"), ("declared", ["joint_offset"]), ("targets", {"hand": {"point": "6DoF", "offset_m": "unknown"}})],
)
def test_what_is_not_written_down_here_is_left_out(diagnosed, key, other):
    assert audit_of(diagnosed, STEPS)
    with altered(diagnosed, CAMPAIGN, ["campaign", key], lambda _: other):
        assert audit_of(diagnosed, STEPS) == []
