"""A unit of loads is named where all joints give way by its factor, a sign where they give way against it, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made, with_geometric_errors, with_other_compliances

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


def test_the_sentence_names_kilogram_force(campaign):
    (fault,) = find(campaign, scaled(campaign.measurements, 1 / GRAVITY, 1 / GRAVITY))
    assert fault.detail == "the loads look like kilogram-force: measurements fit 9.81 times the written loads"


def test_the_sentence_names_what_is_less_likely_too(fanuc):
    campaign = made(fanuc, 2, Plan(poses=20), replace(fanuc, compliance=1.4 * fanuc.compliance))
    (fault,) = find(campaign, scaled(campaign.measurements, 1 / POUND, 1 / POUND))
    assert fault.detail.startswith("the loads look like pounds-force")
    assert "; less likely, the loads look like kilogram-force: measurements fit 9.81 times" in fault.detail


@pytest.mark.parametrize(("force", "moment"), [(1.0, 1e-3), (1e3, 1.0), (GRAVITY, 1.0)])
def test_forces_and_moments_in_units_that_do_not_match_are_named(campaign, force, moment):
    (fault,) = find(campaign, scaled(campaign.measurements, 1 / force, 1 / moment))
    assert [value.value for value in fault.parameters[:2]] == [force, moment]


def test_a_unit_is_named_of_loads_that_are_turned_round_too(campaign):
    sign, unit = find(campaign, scaled(campaign.measurements, -1 / GRAVITY, -1 / GRAVITY))
    assert (sign.name, unit.name, unit.parameters[0].value) == ("wrong_sign", "wrong_unit", GRAVITY)


def test_a_unit_is_named_beside_heavy_geometric_errors(fanuc):
    campaign = made(fanuc, 3, Plan(), with_geometric_errors(fanuc, 3, 0.006))
    (fault,) = find(campaign, scaled(campaign.measurements, 1 / GRAVITY, 1 / GRAVITY))
    assert fault.parameters[0].value == GRAVITY


def test_a_unit_is_named_without_unloaded_measurements(fanuc):
    campaign = made(fanuc, 5, Plan(poses=40, loads=1, tracker=True, oriented=False))
    measurements = campaign.measurements.select(campaign.measurements.load > 0)
    (fault,) = find(campaign, scaled(measurements, 1 / GRAVITY, 1 / GRAVITY))
    assert fault.parameters[0].value == GRAVITY


@pytest.mark.parametrize("factor", [0.5, 0.7, 1.5, 2.0, 3.0])
def test_a_factor_that_is_no_unit_is_none(campaign, factor):
    assert find(campaign, scaled(campaign.measurements, factor, factor)) == []


def test_joints_that_give_way_by_different_factors_are_no_unit(fanuc):
    softer = replace(fanuc, compliance=fanuc.compliance * [2.0, 20.0, 4.0, 9.0, 30.0, 9.0])
    campaign = made(fanuc, 4, Plan(), softer)
    assert find(campaign, campaign.measurements) == []


def test_no_unit_is_named_without_loads(campaign):
    assert find(campaign, campaign.measurements.select(campaign.measurements.load == 0)) == []


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
