"""The evaluator that needs numpy alone agrees with the package."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from made_models import (
    FOLLOWING,
    ROBOTS,
    draw_commands,
    make_calibrated,
    write_made_model,
)

from elastocal.application.calibrated import (
    compute_nominal_poses,
    find_extrapolated,
    predict_poses,
    predict_residual_displacements,
)
from elastocal.application.compensation import find_joint_targets
from elastocal.evaluators import elastocal_model

# The tests of the C++ header evaluate the formulas of all regressions in each run.
REGRESSIONS = (
    "two_joints",
    *(
        pytest.param(name, marks=pytest.mark.slow)
        for name in ("ridge_harmonics", "gaussian_process", "extra_trees")
    ),
)


@pytest.mark.parametrize("name", ROBOTS)
def test_poses_are_those_of_the_package(name, tmp_path):
    calibrated = make_calibrated(name)
    path = write_made_model(tmp_path / "arm.json", calibrated)
    commands = draw_commands(calibrated)
    expected = predict_poses(calibrated, *commands)
    predicted = elastocal_model.load_model(path).predict(*commands)
    for first, second in zip(predicted, expected, strict=True):
        np.testing.assert_allclose(first, second, atol=1e-12)


@pytest.mark.parametrize("regression", REGRESSIONS)
def test_regressions_are_those_of_the_package(regression, tmp_path):
    calibrated = make_calibrated("kuka", regression)
    path = write_made_model(tmp_path / "arm.json", calibrated)
    commands = draw_commands(calibrated, 200)
    is_added = predict_residual_displacements(calibrated, *commands).any(axis=1)
    assert 0.2 < is_added.mean() < 1.0
    model = elastocal_model.load_model(path)
    expected = predict_poses(calibrated, *commands)[0]
    np.testing.assert_allclose(model.predict(*commands)[0], expected, atol=1e-11)
    physics = elastocal_model.load_model(path, regression=False)
    moved = (physics.predict(*commands)[0] != expected).any(axis=1)
    assert moved[is_added].all()


@pytest.mark.parametrize("name", ["kuka", "gen3", FOLLOWING])
def test_corrected_commands_reach_the_wanted_poses_by_the_package(name, tmp_path):
    calibrated = make_calibrated(name)
    path = write_made_model(tmp_path / "arm.json", calibrated)
    commands, wrench = draw_commands(calibrated, 200)
    wanted = compute_nominal_poses(calibrated.robot, commands)
    by_package = find_joint_targets(calibrated, *wanted, wrench, commands)
    usable = by_package.status == "ok"
    assert usable.mean() > 0.9
    model = elastocal_model.load_model(path)
    for first, second in zip(model.rigid(commands), wanted, strict=True):
        np.testing.assert_allclose(first, second, atol=1e-12)
    correction = model.correct(*wanted, by_package.uncorrected, wrench)
    reached = predict_poses(calibrated, correction.joint_angles, wrench)
    for first, second in zip(reached, wanted, strict=True):
        np.testing.assert_allclose(first[usable], second[usable], atol=1e-9)
    assert np.abs(correction.error[usable]).max() < 1e-9
    # The package ends its steps below a nanometre, and soft arms amplify the rest.
    np.testing.assert_allclose(
        correction.joint_angles[usable], by_package.joint_angles[usable], atol=1e-6
    )


def test_commands_beyond_the_campaign_are_those_of_the_package(tmp_path):
    calibrated = make_calibrated("fanuc")
    path = write_made_model(tmp_path / "arm.json", calibrated)
    commands = draw_commands(calibrated)
    beyond = elastocal_model.load_model(path).is_extrapolated(*commands)
    joints, loads = find_extrapolated(calibrated, *commands)
    np.testing.assert_array_equal(beyond, joints | loads)
    assert 0.0 < beyond.mean() < 1.0


def test_a_regression_without_a_formula_is_refused_by_its_name(tmp_path):
    path = write_made_model(tmp_path / "arm.json", make_calibrated("kuka"))
    document = json.loads(path.read_text("utf-8"))
    span = document["range"]
    document["regression"] = {"name": "splines", "range": span, "law": None}
    with pytest.raises(ValueError, match="splines has no formula"):
        elastocal_model.Model(document)
    assert elastocal_model.Model(document, regression=False).joints == 6


def test_another_file_is_refused():
    with pytest.raises(ValueError, match="no elastocal model of version 1"):
        elastocal_model.Model({"format": "elastocal model", "version": 2})


def test_the_file_runs_without_the_package(tmp_path):
    path = write_made_model(tmp_path / "arm.json", make_calibrated("kuka"))
    copied = tmp_path / "elastocal_model.py"
    shutil.copyfile(elastocal_model.__file__, copied)
    program = (
        "import sys, numpy as np, elastocal_model\n"
        f"model = elastocal_model.load_model({str(path)!r})\n"
        "model.predict(np.zeros((2, model.joints)))\n"
        "assert not {'elastocal', 'scipy', 'pandas'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True)
