"""Contents of a certificate: its decision, and its error budget, what each effect costs and what a correction leaves."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_calibrated import USUAL, made_calibrated

from elastocal.application.calibrated import OperatingConditions, forward, nominal_forward
from elastocal.loop.calibrated_files import load_diagnosed
from elastocal.loop.certificate import Wanted, certificate, error_budget

WANTED = Wanted(2e-4, 0.05, "SN 7", "2026-11-23")


@pytest.mark.parametrize(("share", "judged", "decision"), [(0.2, 8, "fail"), (2.0, 8, "pass"), (2.0, 3, "undecided")])
def test_a_certificate_passes_below_and_fails_above_what_is_predicted_if_enough_configurations_judge(
    checkout, share, judged, decision
):
    found = load_diagnosed(checkout / "made", ROBOTS, checkout)
    found = replace(found, verdict=found.verdict | {"heldout": found.verdict["heldout"] | {"configurations": judged}})
    wanted = replace(WANTED, tolerance_m=share * found.verdict["accuracy"]["rms_m"])
    conformity = certificate(checkout / "made", ROBOTS, found, wanted)["conformity"]
    assert conformity["decision"] == decision
    assert [line.startswith("too few: 3 configurations") for line in conformity["shortfalls"]] == [True] * (judged == 3)


def rms(one, other):
    return np.sqrt(((one - other) ** 2).sum(axis=1).mean())


@pytest.fixture
def states(fanuc):
    rng = np.random.default_rng(0)
    low, high = fanuc.joint_limits.T
    wrench = np.hstack([300.0 * rng.standard_normal((60, 3)), np.zeros((60, 3))])
    return fanuc.reported_angles(rng.uniform(0.6 * low, 0.6 * high, (60, 6))), OperatingConditions(wrench)


def test_each_line_of_the_budget_is_what_the_robot_misses_without_that_effect(fanuc, states):
    calibrated = made_calibrated(fanuc, *USUAL)
    found, (whole, _) = error_budget(calibrated, *states), forward(calibrated, *states)
    assert found["uncorrected"] == pytest.approx(rms(whole, nominal_forward(fanuc, states[0])[0]))
    for name in ("joint_offset", "link_geometry", "joint_compliance", "link_weight"):
        values = tuple(
            0.0 * value if effect.effect == name else value
            for effect, value in zip(calibrated.model.effects, calibrated.estimate.coefficients, strict=True)
        )
        without = replace(calibrated, estimate=replace(calibrated.estimate, coefficients=values))
        assert found[name] == pytest.approx(rms(whole, forward(without, *states)[0]))
    names = list(found)
    assert names[0] == "uncorrected" and names[-2:] == ["uncertainty of the parameters", "repeatability"]
    middle = [found[name] for name in names[1:-2]]
    assert middle == sorted(middle, reverse=True)


def test_springs_of_the_robot_file_cost_what_they_give_under_load(fanuc, states):
    calibrated = made_calibrated(fanuc, "joint_offset@2", identified=False)
    rigid = replace(calibrated, model=replace(calibrated.model, nominal_compliance=np.zeros(6)))
    expected = rms(*(forward(each, *states)[0] for each in (calibrated, rigid)))
    assert error_budget(calibrated, *states)["joint_compliance"] == pytest.approx(expected) and expected > 1e-5
