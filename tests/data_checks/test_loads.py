"""A unit of loads is named where all joints give way by its factor, a sign where they give way against it, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made, with_other_compliances

from elastocal.data_checks.loads import find

GRAVITY, POUND = 9.80665, 4.4482216


@pytest.fixture(scope="module", params=["base", "tracker"])
def campaign(request, fanuc):
    return made(fanuc, 2, Plan(poses=20, tracker=request.param == "tracker"), with_other_compliances(fanuc, 1, 0.3))


def scaled(measurements, force, moment):
    return replace(measurements, wrench=measurements.wrench * np.repeat([force, moment], 3))


@pytest.mark.parametrize("factor", [GRAVITY, 1 / GRAVITY, 1e3, 1e-3, POUND, 1 / POUND])
def test_loads_in_another_unit_are_named_with_its_factor(campaign, factor):
    (fault,) = find(campaign, scaled(campaign.measurements, 1 / factor, 1 / factor))
    assert (fault.name, fault.joints, fault.decisive) == ("wrong_unit", (), True)
    force, moment, slope = fault.parameters
    assert force.value == pytest.approx(factor, rel=1e-3)
    assert moment.value == force.value
    assert slope.value == pytest.approx(factor, rel=0.4)
    assert fault.evidence[1] < 0.5 * fault.evidence[0]


def test_without_known_compliances_no_unit_is_named(campaign):
    unknown = replace(campaign, robot=replace(campaign.robot, compliance_known=False))
    assert find(unknown, scaled(campaign.measurements, 1e-3, 1e-3)) == []


def test_the_sentence_names_what_is_less_likely_too(fanuc):
    campaign = made(fanuc, 2, Plan(poses=20), replace(fanuc, compliance=1.4 * fanuc.compliance))
    (fault,) = find(campaign, scaled(campaign.measurements, 1 / POUND, 1 / POUND))
    assert fault.detail.startswith("the loads look like pounds-force")
    assert "; less likely, the loads look like kilogram-force: measurements fit 9.81 times" in fault.detail


@pytest.mark.parametrize(("force", "moment"), [(1.0, 1e-3), (1e3, 1.0), (GRAVITY, 1.0)])
def test_forces_and_moments_in_units_that_do_not_match_are_named(campaign, force, moment):
    (fault,) = find(campaign, scaled(campaign.measurements, 1 / force, 1 / moment))
    assert [value.value for value in fault.parameters[:2]] == [force, moment]


def test_a_unit_is_named_without_unloaded_measurements(fanuc):
    campaign = made(fanuc, 5, Plan(poses=40, loads=1, tracker=True, oriented=False))
    measurements = campaign.measurements.select(campaign.measurements.load > 0)
    (fault,) = find(campaign, scaled(measurements, 1 / GRAVITY, 1 / GRAVITY))
    assert fault.parameters[0].value == GRAVITY


def test_loads_turned_round_are_named(campaign):
    (fault,) = find(campaign, replace(campaign.measurements, wrench=-campaign.measurements.wrench))
    assert fault.joints == ()
    assert "loads" in fault.detail
    assert -2.0 < fault.parameters[0].value < -0.5


def test_loads_turned_round_are_named_without_unloaded_measurements(fanuc):
    campaign = made(fanuc, 5, Plan(poses=40, loads=1, tracker=True, oriented=False))
    measurements = campaign.measurements.select(campaign.measurements.load > 0)
    assert find(campaign, measurements) == []
    (fault,) = find(campaign, replace(measurements, wrench=-measurements.wrench))
    assert "loads" in fault.detail
