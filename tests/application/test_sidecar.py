"""The sidecar has every effect that the robot file lacks, with errors, and how far these move the robot."""

import json

import numpy as np
from analysed_robots import analysed
from made_calibrated import made_calibrated

from elastocal.application.accuracy import predict_errors
from elastocal.application.calibrated import NEUTRAL
from elastocal.application.sidecar import find_left_out_m, sidecar


def make_calibrated(*keys):
    return made_calibrated(analysed("gp180"), "joint_offset@2", *keys)


def test_effects_and_springs_stand_in_it_with_values_and_standard_errors():
    calibrated = make_calibrated("lost_motion@2")
    accuracy = predict_errors(calibrated, np.zeros((1, 6)), NEUTRAL).accuracy("one pose")
    document = json.loads(json.dumps(sidecar(calibrated, "cell7", "2026-11-23", accuracy)))
    assert document["accuracy"]["rms_m"] == accuracy.rms_m and "Predicted" in document["accuracy"]["words"]
    (effect,) = document["effects"]
    assert effect["key"] == "lost_motion@2" and effect["joints"] == [2]
    values = np.concatenate([calibrated.estimate.coefficients[-1], calibrated.estimate.shapes[-1]])
    assert [parameter["value"] for parameter in effect["parameters"]] == values.tolist()
    errors = np.sqrt(np.diag(calibrated.covariance))[-len(values) :]
    np.testing.assert_allclose([parameter["std_error"] for parameter in effect["parameters"]], errors)
    assert [p["value"] for p in document["joint_compliance"]] == calibrated.estimate.coefficients[0].tolist()
    assert document["date"] == "2026-11-23" and document["campaign"] == "cell7"


def test_what_is_left_out_moves_the_robot_and_nothing_left_out_does_not():
    angles = np.random.default_rng(1).uniform(-1, 1, (10, 6))
    assert find_left_out_m(make_calibrated("transmission_harmonic@1[orders 1-2]"), angles, NEUTRAL).max() > 1e-6
    assert (find_left_out_m(make_calibrated(), angles, NEUTRAL) == 0.0).all()
