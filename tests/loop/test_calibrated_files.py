"""The calibrated robot is restored from the files of a diagnosis as it was fitted, and
only if no file behind it has changed.

A certificate decides by predicted errors; its error budget has the contribution of each
effect and the errors that a correction leaves.
"""

import hashlib
import json
import shutil
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS
from certified import ENGINE
from contact_campaigns import build_contact_case, write_contacts
from made_calibrated import USUAL, make_calibrated_robot
from made_remainders import NOISE_M
from support import refused

from elastocal.application.accuracy import predict_campaign_accuracy
from elastocal.application.calibrated import (
    calibrate_by_fit,
    predict_poses,
)
from elastocal.io.json_files import read_json
from elastocal.io.origin import list_versions
from elastocal.io.records import compute_sha256
from elastocal.loop.calibrated_files import (
    build_certificate,
    compute_error_budget,
    load_diagnosed,
)
from elastocal.loop.diagnosis_tables import restore_diagnosis


def test_the_robot_is_that_of_the_final_fit(checkout):
    campaign = load_diagnosed(checkout / "made", ROBOTS, checkout)
    tables = checkout / "results/loop/made"
    restored = restore_diagnosis(campaign.case, read_json(tables / "diagnosis.json"))
    expected = calibrate_by_fit(restored.final, campaign.case.campaign.robot)
    assert [e.key for e in campaign.calibrated.model.effects] == [
        "joint_compliance",
        "joint_offset@3",
    ]
    for coefficients, expected_coefficients in zip(
        campaign.calibrated.estimate.coefficients,
        expected.estimate.coefficients,
        strict=True,
    ):
        # A coefficient at its bound is zero up to rounding, compared with the others.
        rounding = 1e-12 * np.abs(expected_coefficients).max(initial=0.0)
        np.testing.assert_allclose(
            coefficients, expected_coefficients, rtol=1e-6, atol=rounding
        )
    # A covariance close to zero is compared with the standard errors instead of with
    # itself.
    errors = np.sqrt(np.diag(expected.covariance))
    difference = np.abs(campaign.calibrated.covariance - expected.covariance)
    assert (
        difference
        <= 1e-3 * np.abs(expected.covariance) + 1e-6 * np.outer(errors, errors)
    ).all()
    assert (campaign.calibrated.noise.joint_rad >= expected.noise.joint_rad).all()
    assert campaign.calibrated.scope.frame == (
        "robot" if campaign.case.model.fitted_frames else "base"
    )
    assert campaign.verdict.campaign == campaign.name == "made"
    assert campaign.calibrated.scope.form_m == pytest.approx(
        campaign.verdict.accuracy.form_m, rel=1e-9
    )


def test_the_regression_comes_back_and_physics_alone_has_its_own_accuracy(
    regressed_checkout,
):
    whole = load_diagnosed(regressed_checkout / "smooth", ROBOTS, regressed_checkout)
    physics = whole.without_regression()
    stated = whole.verdict
    heldout = whole.verdict.heldout
    assert heldout.delivered.rms_m < 0.6 * heldout.after.rms_m
    assert (
        physics.calibrated.residual_model is None
        and physics.verdict.heldout.delivered == heldout.after
    )
    assert physics.verdict.accuracy == stated.physics != stated.accuracy
    for campaign in (whole, physics):
        accuracy = predict_campaign_accuracy(campaign.calibrated)
        expected = campaign.verdict.accuracy
        assert accuracy.rms_m == pytest.approx(expected.rms_m, rel=1e-3)
        assert accuracy.form_m == pytest.approx(expected.form_m, rel=1e-6)
    # The prediction comes from folds with fewer poses, so it is no smaller than the
    # observed error.
    missed = np.sqrt(heldout.delivered.rms_m**2 - 3 * NOISE_M**2)
    assert missed < stated.accuracy.rms_m < 3.0 * missed < stated.physics.rms_m


def test_the_origin_names_code_data_and_environment(checkout):
    origin = load_diagnosed(checkout / "made", ROBOTS, checkout).origin

    def digest(value):
        return hashlib.sha256(
            json.dumps(value, sort_keys=True, separators=(",", ":")).encode()
        ).hexdigest()

    files = {
        f"campaign/{path.name}": hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (checkout / "made").iterdir()
    }
    files["robot/kuka.yaml"] = hashlib.sha256(
        (ROBOTS / "kuka.yaml").read_bytes()
    ).hexdigest()
    assert origin == {
        "commit": "c0ffee",
        "code_sha256": digest({ENGINE: compute_sha256(checkout / ENGINE)}),
        "data_sha256": digest(files),
        "environment": list_versions(checkout),
    }


def another_seed(folder):
    path = folder / "campaign.yaml"
    path.write_text(path.read_text().replace("seed: 1", "seed: 2"))


def moved_row(folder, row):
    table = pd.read_csv(folder / "measurements.csv")
    table.loc[row, "x"] += 1e-9
    table.to_csv(folder / "measurements.csv", index=False)


CHANGES = {
    "another seed": another_seed,
    "no measurements": lambda folder: (folder / "measurements.csv").unlink(),
    "another table": lambda folder: (folder / "measurements.parquet").touch(),
    **{f"row {row} moved": partial(moved_row, row=row) for row in range(0, 60, 12)},
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_campaign_that_changed_since_its_diagnosis_is_refused(
    checkout, tmp_path, change
):
    shutil.copytree(checkout / "made", tmp_path / "changed")
    change(tmp_path / "changed")
    with refused(
        (tmp_path / "changed").as_posix(),
        "",
        "changes since its diagnosis",
        "elastocal diagnose",
    ):
        load_diagnosed(tmp_path / "changed", ROBOTS, checkout)


def test_results_of_another_engine_are_refused(checkout, tmp_path):
    changed = shutil.copytree(checkout, tmp_path / "top", symlinks=True)
    (changed / ENGINE).write_text("VERSION = 2\n", encoding="utf-8")
    with refused(
        changed / ENGINE,
        "",
        "another version than read_campaign made was made with",
        f"elastocal diagnose {changed}/made",
    ):
        load_diagnosed(changed / "made", ROBOTS, changed)


@pytest.mark.parametrize(
    ("share", "judged", "decision"),
    [(0.2, 8, "fail"), (2.0, 8, "pass"), (2.0, 3, "undecided")],
)
def test_a_certificate_follows_the_prediction_if_enough_configurations_judge(
    checkout, share, judged, decision
):
    campaign = load_diagnosed(checkout / "made", ROBOTS, checkout)
    campaign = replace(
        campaign,
        verdict=replace(
            campaign.verdict,
            heldout=replace(campaign.verdict.heldout, configurations=judged),
        ),
    )
    tolerance_m = share * campaign.verdict.accuracy.rms_m
    conformity = build_certificate(campaign, tolerance_m, 0.05)["conformity"]
    assert conformity["decision"] == decision
    assert [
        line.startswith("too few: 3 configurations")
        for line in conformity["shortfalls"]
    ] == [True] * (judged == 3)


def rms_distance(positions, references):
    return np.sqrt(((positions - references) ** 2).sum(axis=1).mean())


@pytest.fixture
def states(fanuc):
    rng = np.random.default_rng(0)
    low, high = fanuc.joint_limits.T
    wrench = np.hstack([300.0 * rng.standard_normal((60, 3)), np.zeros((60, 3))])
    return fanuc.reported_angles(rng.uniform(0.6 * low, 0.6 * high, (60, 6))), wrench


def test_each_entry_of_the_budget_is_the_error_without_that_effect(fanuc, states):
    calibrated = make_calibrated_robot(fanuc, *USUAL)
    budget = compute_error_budget(calibrated, *states)
    whole, _ = predict_poses(calibrated, *states)
    for name in ("joint_offset", "link_geometry", "joint_compliance", "link_weight"):
        values = tuple(
            0.0 * value if effect.effect == name else value
            for effect, value in zip(
                calibrated.model.effects, calibrated.estimate.coefficients, strict=True
            )
        )
        without = replace(
            calibrated, estimate=replace(calibrated.estimate, coefficients=values)
        )
        assert budget[name] == pytest.approx(
            rms_distance(whole, predict_poses(without, *states)[0])
        )
    names = list(budget)
    assert names[-2:] == [
        "uncertainty of the parameters",
        "repeatability",
    ]
    contributions = [budget[name] for name in names[:-2]]
    assert contributions == sorted(contributions, reverse=True)


def test_the_compliances_of_the_robot_file_contribute_their_deflection(fanuc, states):
    calibrated = make_calibrated_robot(fanuc, "joint_offset@2", identified=False)
    rigid = replace(
        calibrated, model=replace(calibrated.model, nominal_compliance=np.zeros(6))
    )
    expected = rms_distance(
        predict_poses(calibrated, *states)[0], predict_poses(rigid, *states)[0]
    )
    assert (
        compute_error_budget(calibrated, *states)["joint_compliance"]
        == pytest.approx(expected)
        and expected > 1e-5
    )


def test_contacts_certify_no_robot(tmp_path):
    document = {"measured": "point", "features": {"socket": {}}}
    rows = [{"angles": np.full(6, 0.1 * row), "feature": "socket"} for row in range(20)]
    folder = write_contacts(tmp_path / "cell", document, rows)
    campaign = SimpleNamespace(folder=folder, case=build_contact_case(folder))
    with refused(folder.source, "measured", "point", "elastocal export states"):
        build_certificate(campaign, 1e-3, 0.05)
