"""What a method is, and what it predicts of poses that it has not seen."""

import numpy as np
import pytest
from made_leagues import made_data_set

from elastocal.errors import InputError
from elastocal.validation.held_out import position_errors
from elastocal.validation.placing import placed
from elastocal_proof.league.methods import FRAMES, GEOMETRY, Method, entered, fitted_physics, method_from
from elastocal_proof.league.rounds import held_out_rounds, training_rounds


@pytest.fixture(scope="module")
def fold(kuka, config_folder, tmp_path_factory):
    data = made_data_set(tmp_path_factory.mktemp("methods"), kuka, config_folder / "robots", poses=60)
    _, training = next(training_rounds("random", data))
    _, (held_out,) = next(held_out_rounds("random", data, []))
    return training, held_out


def rms(entry):
    return np.sqrt((entry.residual**2).sum(axis=1).mean())


def test_frames_alone_have_no_parameters_of_the_robot_and_geometry_has(fold):
    training, _ = fold
    owners = [{owner for owner, _ in fitted_physics(physics, training).parameters} for physics in (FRAMES, GEOMETRY)]
    assert all(owner.startswith(("frame ", "target ")) for owner in owners[0])
    assert {owner.partition("@")[0] for owner in owners[1] - owners[0]} == {"joint_offset"}


def test_without_a_regression_the_errors_are_those_of_the_fit(fold):
    training, held_out = fold
    fitted = fitted_physics(GEOMETRY, training)
    entry = entered(Method(GEOMETRY), fitted, training, held_out, "random", 1)
    plain = position_errors(*placed(fitted, training, held_out), held_out.observations).distance
    np.testing.assert_array_equal(np.linalg.norm(entry.residual, axis=1), plain)
    assert np.isnan(entry.std).all() and entry.setting is None


def test_a_regression_lowers_what_geometry_leaves_of_something_smooth(fold):
    training, held_out = fold
    fitted = fitted_physics(GEOMETRY, training)
    alone, process = (
        entered(Method(GEOMETRY, name), fitted, training, held_out, "random", 1) for name in (None, "gaussian_process")
    )
    assert rms(process) < 0.8 * rms(alone)
    assert np.isfinite(process.std).all()


def test_a_regression_that_is_not_there_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"league\.methods\.mine\.regression.*'magic'.*gaussian_process"):
        method_from({"physics": "geometry", "regression": "magic", "words": ""}, "mine", "config.yaml")
    assert method_from({"physics": "frames", "words": "frames only"}, "mine", "config.yaml").words == "frames only"
