"""What is declared wrongly by millimetres is found where it sits, and nothing is on a robot that is merely inexact."""

import numpy as np
import pytest
from analysed_robots import ROBOTS, analysed
from misdeclared import misdeclared_folder

from elastocal.diagnosis.misplaced import misplaced, point_sentence
from elastocal.fitting.tolerances import estimated_noise, fit_declared
from elastocal.loop.overview import overview
from elastocal.loop.whole import cases_in

# A heavy arm, a middling one, a light one.
ARMS = ("kuka", "abb", "ur10")


def findings(folder):
    case, _ = cases_in(folder, ROBOTS)
    return misplaced(fit_declared(case.model, case.observations, estimated_noise(case)[0]), case.campaign)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize(
    ("place", "shift_m"),
    [("tool", [5e-3, 0, 0]), ("tool", [0, 4e-3, -5e-3]), ("link 3", [15e-3, 0, 0]), ("link 1", [0, 0, 0.2])],
)
def test_a_wrong_target_or_length_is_found_with_its_size(tmp_path, name, place, shift_m):
    (found,) = findings(misdeclared_folder(tmp_path / "made", analysed(name), name, place, shift_m))
    # Of parallel axes one link says as well as the other.
    assert place in (found["place"], *found["alternatives"])
    assert np.linalg.norm(found["shift_m"]) == pytest.approx(np.linalg.norm(shift_m), rel=0.2)
    if place == "tool":
        np.testing.assert_allclose(found["shift_m"], shift_m, atol=1e-3)
        assert "the flange is not certified, the reflector is" in found["sentence"]


@pytest.mark.parametrize("name", ARMS)
def test_a_base_that_stands_elsewhere_is_said_before_any_diagnosis_and_a_wrong_target_too(tmp_path, name):
    robot = analysed(name)
    facts = overview(misdeclared_folder(tmp_path / "base", robot, name, "base", [0, 5e-3, 0]), ROBOTS)
    assert [each["place"] for each in facts["misplaced"]] == ["base"]
    assert "base stands 5." in facts["suspicious"][0] or "base stands 4.9" in facts["suspicious"][0]
    facts = overview(misdeclared_folder(tmp_path / "tool", robot, name, "tool", [5e-3, 0, 0]), ROBOTS)
    assert [each["place"] for each in facts["misplaced"]] == ["tool"] and "along x of" in facts["suspicious"][0]


@pytest.mark.parametrize("name", ARMS)
def test_inexact_geometry_is_nothing_misplaced(tmp_path, name):
    for seed in range(5):
        assert findings(misdeclared_folder(tmp_path / f"{seed}", analysed(name), name, "", 0.0, seed=seed)) == []


def test_the_point_is_named_with_what_was_declared_of_its_target(tmp_path):
    case, _ = cases_in(misdeclared_folder(tmp_path / "made", analysed("kuka"), "kuka", "", 0.0), ROBOTS)
    assert "6DoF" in point_sentence(case.campaign) and "(100.0, 0.0, 50.0) mm" in point_sentence(case.campaign)
