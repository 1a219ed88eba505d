"""Defects as a whole: each kind changes the measurements as its size says, by its seed, where it is put and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS, analysed

from elastocal.effects.catalogue import effects
from elastocal.effects.conditions import conditions_of
from elastocal.errors import InputError
from elastocal.fitting.observations import States
from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.mechanics.sites import sites_of
from elastocal_proof.plant.arm import arm_from_file, rotation_vector
from elastocal_proof.plant.kinds import KINDS, OUTSIDE, Defect, drawn_defect, truth_of, with_defects
from elastocal_proof.plant.physical_robot import seen_poses

NAMED = sorted(kind for kind in KINDS if not kind.startswith(OUTSIDE))
# Their first order is what the catalogue's law says it is, to so much of its root mean square.
COMPARABLE = {
    "joint_offset": 0.02,
    "link_geometry": 0.02,
    "payload": 0.02,
    "transmission_ratio": 0.02,
    "joint_tilt": 0.02,
    "cross_compliance": 0.02,
    "flange_flexibility": 0.02,
    "tracker_scale": 0.02,
    # A dead band with edges is not a tanh where the torque is small.
    "lost_motion": 0.3,
    "force_scale": 0.02,
    "force_misalignment": 0.05,
    "force_bias": 0.05,
    "application_point": 0.02,
}


def test_every_effect_of_the_catalogue_can_be_a_defect():
    # A base that stands elsewhere than declared is none of the robot: the tracker of a setting sees it there.
    assert {*NAMED, "base_placement"} == set(effects())
    # Else what the catalogue finds rightly would count as a wrong name.
    assert not {kind.removeprefix(OUTSIDE) for kind in set(KINDS) - set(NAMED)} & set(effects())


def states_of(schedule):
    """A schedule as the catalogue sees it."""
    return States(
        session=0 * schedule.pose,
        pose=schedule.pose,
        load=schedule.load,
        joint_angles=schedule.angle,
        wrench=schedule.shown_wrench,
        repeats=1 + 0 * schedule.pose,
    )


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_defect_of_no_size_leaves_the_robot_as_it_was_and_a_plausible_one_does_not(yardstick, fanuc_specimen, kind):
    defect = drawn_defect(kind, fanuc_specimen.arm, 3)
    tiny = replace(defect, size=1e-9 * defect.size)
    assert yardstick.signal(with_defects(fanuc_specimen, [tiny])).rms_m < 1e-9
    signal = yardstick.signal(with_defects(fanuc_specimen, [defect]))
    assert signal.raw > 0.1
    assert 0 <= signal.retained <= signal.raw * (1 + 1e-9)


@pytest.mark.parametrize("kind", NAMED)
def test_what_acts_without_a_load_is_what_the_catalogue_counts_as_such(weightless, schedule, kind):
    """Class A of the catalogue at load zero; the elastic, the gearbox but for hysteresis, and the load not."""
    defect = drawn_defect(kind, weightless.arm, 3)
    # As slow as a campaign of usual length, in which a stand that is knocked is so between two of its poses.
    schedule = replace(schedule, time_s=3.0 * schedule.time_s)
    unloaded = schedule.load == 0
    change = np.abs(seen_poses(with_defects(weightless, [defect]), schedule)[0] - seen_poses(weightless, schedule)[0]).max(
        axis=(1, 2)
    )[unloaded]
    family = effects()[kind].family
    without_load = family in ("geometry", "gravity", "transmission", "drift") or kind == "hysteresis"
    assert (change.max() > 1e-9) == without_load or (kind == "transmission_ratio" and defect.joints == (6,))


@pytest.mark.parametrize("kind", sorted(COMPARABLE))
def test_the_parameters_of_the_truth_are_those_of_the_catalogues_law(weightless, schedule, kind):
    """The catalogue's law with the truth's parameters foretells what the plant does, to first order."""
    # A load cell in the pull has nothing comparable: the first seed that has.
    defects = (drawn_defect(kind, weightless.arm, seed) for seed in range(3, 20))
    defect = next(defect for defect in defects if truth_of(weightless, defect)["parameters"])
    parameters = truth_of(weightless, defect)["parameters"]
    states = states_of(schedule)
    sites = sites_of(analysed("fanuc").chain)
    given = conditions_of(sites, weightless.compliance, states)
    change = seen_poses(with_defects(weightless, [defect]), schedule)
    nominal = seen_poses(weightless, schedule)
    found = np.concatenate([change[0] - nominal[0], rotation_vector(change[1] @ np.swapaxes(nominal[1], -1, -2))], axis=-1)
    coordinates = np.zeros((len(schedule.pose), sites.chain.coordinates))
    coordinates[:, : sites.joints] = schedule.angle
    best = np.inf
    # In which frame a load's error is fixed the truth does not say: one of the variants must fit.
    for candidate in effects()[kind].candidates(sites):
        if candidate.joints != defect.joints:
            continue
        shapes = [60.0] * len(candidate.shapes)
        turn = np.zeros_like(coordinates)
        for parameter, columns in zip(candidate.parameters, candidate.displacement(given, *shapes), strict=True):
            for coordinate, column in columns.items():
                turn[:, coordinate] += parameters[parameter.name] * column
        jacobians = [poses_and_jacobians(sites.chain, coordinates, point)[2] for point in sites.chain.points]
        wanted = np.stack([np.einsum("sij,sj->si", jacobian, turn) for jacobian in jacobians], axis=1)
        best = min(best, np.linalg.norm(found - wanted) / np.linalg.norm(wanted))
    assert best < COMPARABLE[kind]


def test_a_defect_is_refused_where_it_cannot_be_or_is_too_large(fanuc_specimen):
    for wrong in (Defect("joint_offset", (7,), 1e-3), Defect("nonsense", (), 1.0), Defect("stiffening", (1,), 1.5)):
        with pytest.raises(InputError):
            with_defects(fanuc_specimen, [wrong])


def test_weight_is_of_the_upper_arm_of_the_forearm_or_of_all_links_by_the_joints_that_it_turns(fanuc_arm):
    upper, fore, everything = KINDS["link_weight"].locations(fanuc_arm)
    assert upper == (2,) and fore == (2, 3) and everything == (2, 3, 4, 5)


@pytest.mark.parametrize(
    ("kind", "soft", "light"), [("joint_tilt", 1, 0), ("payload", 0, 1), ("outside:stiffening_link", 1, -2)]
)
def test_a_plausible_size_goes_with_how_soft_an_arm_is_and_what_it_carries(kind, soft, light):
    arm = arm_from_file(ROBOTS / "iiwa14.yaml")
    assert arm.softness > 1 and arm.load_share < 1
    found = KINDS[kind].plausible_on(arm) / KINDS[kind].plausible
    assert found == pytest.approx(arm.softness**soft * arm.load_share**light)
