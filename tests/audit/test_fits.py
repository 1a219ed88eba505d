"""Fits of diagnosed campaigns hold; an altered estimate, standard error, correlation or
residual does not."""

import numpy as np
import pandas as pd
import pytest
from audited_campaigns import audit_of, diagnosed_campaign
from made_audits import altered, failed
from support import TRACK, TURNED

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.fits import build_mujoco_model, iterate_equilibrium

STEPS = "results/loop/cell/steps.parquet"
RESIDUALS = "reports/loop/cell/residuals.parquet"
WRENCH = np.array([100.0, -200.0, 300.0, 40.0, 50.0, -60.0])


@pytest.mark.parametrize("chain", [TURNED, TRACK])
def test_mujoco_and_pinocchio_agree_on_the_deflected_arm(chain):
    """The arm has springs in its joints and links."""
    arm = Arm({"chain": chain, "links": {}})
    draws = np.random.default_rng(1)
    angles = draws.uniform(-1, 1, arm.joints)
    half = 1e-4 * draws.normal(size=(arm.coordinates, arm.coordinates))
    springs = half @ half.T
    for point in arm.points:
        expected = arm.pose(arm.deflect(springs, angles, WRENCH, 3)[0], point)[0]
        positions = iterate_equilibrium(
            arm, build_mujoco_model(arm), springs, angles, WRENCH, point
        )
        np.testing.assert_allclose(positions[2], expected, rtol=0, atol=1e-12)
        assert np.abs(expected - arm.pose(arm.extend(angles), point)[0]).max() > 1e-6
        assert np.abs(positions[-1] - positions[-2]).max() < 1e-12


# Robot, effects and design of the measurements. The second campaign has an effect that
# no model of the audit has.
HONEST = [
    ("kuka", ("joint_offset",), {"covariates": ()}),
    pytest.param(
        "fanuc",
        ("outside:foreign_angle_stiffness",),
        {"covariates": ()},
        marks=pytest.mark.slow,
    ),
    pytest.param(
        "iiwa14", ("transmission_harmonic",), {"covariates": ()}, marks=pytest.mark.slow
    ),
    pytest.param("abb", ("payload",), {"measured": "position"}, marks=pytest.mark.slow),
    pytest.param(
        "kuka",
        (),
        {"declared_noise": (2e-5, 2e-5), "repeats": 1, "repeated_poses": 0},
        marks=pytest.mark.slow,
    ),
]


@pytest.mark.parametrize(("robot", "effects", "design"), HONEST)
def test_an_honest_campaign_raises_no_alarm(robot, effects, design, tmp_path):
    findings = audit_of(diagnosed_campaign(tmp_path, robot, effects, **design))
    assert failed(findings) == []
    assert len(findings) >= 1


def test_a_campaign_of_springs_holds(diagnosed):
    findings = audit_of(diagnosed)
    assert failed(findings) == []
    assert {finding.by for finding in findings} >= {
        "MuJoCo",
        "statsmodels on pinocchio",
    }
    assert {"residuals before", "residuals after"} <= {
        finding.checked.partition(",")[0] for finding in findings
    }


@pytest.mark.parametrize(
    ("file", "at", "change", "expected"),
    [
        (
            STEPS,
            ("std_error", 0),
            lambda value: 0.5 * value,
            "standard errors of step 1 (declared)",
        ),
        (
            "results/loop/cell/diagnosis.json",
            ["covariance", 0, 0],
            lambda value: 1.1 * value,
            "correlations of the estimates",
        ),
        (RESIDUALS, ("before_dy", 7), lambda value: value + 1e-6, "residuals before"),
        (RESIDUALS, ("after_dz", -1), lambda value: value + 1e-6, "residuals after"),
    ],
)
def test_an_altered_figure_does_not_hold(diagnosed, file, at, change, expected):
    with altered(diagnosed, file, at, change):
        failures = failed(
            audit_of(diagnosed, RESIDUALS if file == RESIDUALS else STEPS)
        )
    assert any(name.startswith(expected) for name in failures)


def test_an_estimate_wrong_by_a_hundredth_of_its_standard_error_does_not_hold(
    diagnosed,
):
    error = 0.01 * pd.read_parquet(diagnosed / STEPS)["std_error"].iloc[1]
    with altered(diagnosed, STEPS, ("value", 1), lambda value: value + error):
        assert (
            "estimates of step 1 (declared) stand still, in standard errors"
            in failed(audit_of(diagnosed, STEPS))
        )


@pytest.mark.parametrize(
    ("key", "setting"),
    [
        ("frame", "tracker"),
        ("declared", ["joint_offset"]),
        ("targets", {"hand": {"point": "6DoF", "offset_m": "unknown"}}),
    ],
)
def test_campaigns_beyond_the_models_of_the_audit_are_left_out(diagnosed, key, setting):
    with altered(
        diagnosed,
        "results/loop/cell/campaign.json",
        ["campaign", key],
        lambda _: setting,
    ):
        assert audit_of(diagnosed) == []
