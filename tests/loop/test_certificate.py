"""Contents of a certificate: those of the report where both state them, and what is wanted of it."""

from dataclasses import replace

import pytest
from analysed_robots import ROBOTS

from elastocal.loop.calibrated_files import load_diagnosed
from elastocal.loop.certificate import Wanted, certificate

WANTED = Wanted(2e-4, 0.05, "SN 7", "2026-11-23")


@pytest.fixture(scope="module")
def diagnosed(checkout):
    return load_diagnosed(checkout / "made", ROBOTS, checkout)


@pytest.fixture(scope="module")
def found(checkout, diagnosed):
    return certificate(checkout / "made", ROBOTS, diagnosed, WANTED)


def test_a_certificate_passes_below_and_fails_above_what_is_predicted(found, checkout, diagnosed):
    for share, decision in ((0.2, "fail"), (2.0, "pass")):
        wanted = replace(WANTED, tolerance_m=share * found["accuracy"]["rms_m"])
        assert certificate(checkout / "made", ROBOTS, diagnosed, wanted)["conformity"]["decision"] == decision


def test_a_robot_that_few_configurations_judge_does_not_pass(found, checkout, diagnosed):
    few = replace(diagnosed, verdict=diagnosed.verdict | {"heldout": diagnosed.verdict["heldout"] | {"configurations": 3}})
    wanted = replace(WANTED, tolerance_m=2.0 * found["accuracy"]["rms_m"])
    conformity = certificate(checkout / "made", ROBOTS, few, wanted)["conformity"]
    assert conformity["decision"] == "undecided" and conformity["shortfalls"][0].startswith("too few: 3 configurations")
