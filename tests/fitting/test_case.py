"""A campaign put together again from its description and its table."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import POINTS, Plan, made

from elastocal.campaigns.columns import columns_of
from elastocal.fitting.model import case_from
from elastocal.fitting.noise import Noise, noise_facts, noise_from
from elastocal.io.documents import read_document


@pytest.fixture(scope="module")
def campaign(kuka):
    return made(kuka, 1, Plan(poses=5, loads=1, repeats=4, tracker=True))


def described(campaign, config_folder, **changes):
    """What step 1 writes of the campaign."""
    document = {
        "campaign": "cell7",
        "robot": "kuka",
        "measured": campaign.measured,
        "frame": campaign.frame,
        "targets": {f"T{name}": {"point": name, "offset_m": "unknown"} for name in POINTS},
    }
    robot = read_document(config_folder / "robots" / "kuka.yaml")
    return {"source": "cell7/campaign.yaml", "campaign": document | changes, "robot": robot}


def case_of(campaign, config_folder, **changes):
    return case_from(described(campaign, config_folder, **changes), columns_of(campaign.measurements))


def test_the_campaign_is_the_one_described(campaign, config_folder, kuka):
    changes = {"noise": {"position_m": 1e-5}, "holdout": {"fraction": 0.2, "seed": 4}, "declared": ["hysteresis"]}
    found = case_of(campaign, config_folder, compliance="identify", **changes).campaign
    assert (found.name, found.measured, found.frame, found.compliance) == ("cell7", "pose", "tracker", "identify")
    assert (found.declared, found.noise, found.holdout) == (("hysteresis",), changes["noise"], changes["holdout"])
    assert [(target.name, target.point, target.offset_m) for target in found.targets] == [(f"T{n}", n, None) for n in POINTS]
    assert found.robot.chain == kuka.chain
    for name, values in vars(campaign.measurements).items():
        if values is None:
            assert getattr(found.measurements, name) is None, name
        else:
            np.testing.assert_array_equal(getattr(found.measurements, name), values, err_msg=name)


def test_a_model_of_rigid_joints_knows_that_no_compliances_are_known(campaign, config_folder):
    described_ = described(campaign, config_folder)
    del described_["robot"]["compliance_urad_per_Nm"]
    described_["robot"]["masses"] = [{"link": 2, "mass_kg": 10, "centre_m": [0.3, 0, 0], "relative_std": 0.2}]
    case = case_from(described_, columns_of(campaign.measurements))
    assert not case.model.compliance_known and not case.model.nominal_compliance.any() and not case.model.sites.masses
    described_["campaign"]["compliance"] = "identify"
    case = case_from(described_, columns_of(campaign.measurements))
    assert not case.model.compliance_known and (case.model.nominal_compliance > 0).all() and case.model.sites.masses


@pytest.mark.parametrize(("compliance", "springs"), [("identify", ["joint_compliance"]), ("nominal", [])])
def test_the_model_has_the_declared_effects_and_the_candidates_are_all_others(campaign, config_folder, compliance, springs):
    case = case_of(campaign, config_folder, compliance=compliance, declared=["joint_offset", "hysteresis"])
    found = {effect.effect for effect in case.model.effects}
    assert found == {*springs, "hysteresis", "joint_offset"}
    assert [e.key for e in case.model.effects if e.effect == "joint_offset"] == [f"joint_offset@{j}" for j in range(1, 7)]
    missing = {candidate.effect for candidate in case.candidates.values()}
    assert not missing & {"joint_offset", "hysteresis"} and {"lost_motion", "link_weight", "frame_drift"} <= missing
    assert all(key == candidate.key for key, candidate in case.candidates.items())
    more = set(case_of(campaign, config_folder).candidates) - set(case.candidates)
    assert more >= {e.key for e in case.model.effects if e.effect not in springs}
    assert {key.split("@")[0] for key in more} == {"joint_offset", "hysteresis"}


def test_repeats_are_averaged_without_those_far_off_which_the_campaign_keeps(campaign, config_folder):
    seen = campaign.measurements
    wild = np.flatnonzero((seen.pose == 2) & (seen.load == 1) & (seen.repeat == 3) & (seen.target == 1))
    position = seen.position.copy()
    position[wild] += 0.02
    case = case_of(replace(campaign, measurements=replace(seen, position=position)), config_folder)
    np.testing.assert_array_equal(case.campaign.measurements.position, position)
    assert len(case.observations) == len(seen) / 4
    states = case.observations.states
    for state in range(len(states)):
        here = (seen.pose == states.pose[state]) & (seen.load == states.load[state])
        for target in range(4):
            kept = here & (seen.target == target)
            kept[wild] = False
            row = (case.observations.state == state) & (case.observations.target == target)
            np.testing.assert_allclose(case.observations.position[row], [seen.position[kept].mean(axis=0)], atol=1e-12)


def test_noise_comes_back_from_its_document():
    noise = Noise("repeats", 1e-5, 2e-5, np.array([1e-6, 0, 3e-6]), 77, 2e-6)
    back = noise_from({"noise": noise_facts(noise), "warnings": []})
    np.testing.assert_array_equal(back.joint_rad, noise.joint_rad)
    assert replace(back, joint_rad=None) == replace(noise, joint_rad=None)
