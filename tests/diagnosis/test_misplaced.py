"""What is declared wrongly by millimetres is found where it sits, and nothing is on a
robot that is merely inexact."""

import numpy as np
import pytest
from analysed_robots import ROBOTS, analysed
from made_folders import made_folder
from scipy.spatial.transform import Rotation

from elastocal.diagnosis.misplaced import (
    describe_reference_point,
    find_misplaced_frames,
)
from elastocal.fitting.noise import estimate_noise, fit_declared_model
from elastocal.loop.overview import overview
from elastocal.loop.whole import cases_in
from elastocal.mechanics.kinematics import poses
from elastocal.mechanics.sites import sites_of

DECLARED_M = np.array([0.1, 0.0, 0.05])
# A heavy arm, a middling one, a light one.
ARMS = ("kuka", "abb", "ur10")


def misdeclared_folder(folder, robot, name, place, shift_m, poses_measured=40, seed=1):
    """Unloaded poses of one target on the end effector, 60 µm and 60 µrad of noise;
    `place`: "tool", "base", "link 3" or ""."""
    draws = np.random.default_rng(seed)
    sites = sites_of(robot)
    end = robot.chain.end_effector
    low, high = robot.joint_limits.T
    angles = low + (high - low) * draws.random((poses_measured, robot.joints))
    coordinates = np.zeros((poses_measured, sites.chain.coordinates))
    coordinates[:, : robot.joints] = angles + 5e-4 * draws.standard_normal(robot.joints)
    for link in range(1, robot.joints + 1):
        coordinates[:, sites.link_end[link]] += 3e-4 * draws.standard_normal(6)
    if place == "base":
        coordinates[:, sites.base[:3]] += shift_m
    elif place.startswith("link"):
        coordinates[:, sites.link_end[int(place[5:])][:3]] += shift_m
    at, turned = poses(sites.chain, coordinates, sites.chain.end_effector)
    at = at + turned @ (DECLARED_M + (np.array(shift_m) if place == "tool" else 0.0))
    turn = Rotation.from_rotvec(
        6e-5 * draws.standard_normal(at.shape)
    ) * Rotation.from_matrix(turned)
    none = np.zeros(poses_measured, int)
    table = {
        "pose": np.arange(1, poses_measured + 1),
        "load": none,
        "repeat": none,
        "target": np.repeat("A", poses_measured),
    }
    table |= {
        f"q{joint}": column
        for joint, column in enumerate(robot.reported_angles(angles).T, 1)
    }
    table |= dict(
        zip("xyz", (at + 6e-5 * draws.standard_normal(at.shape)).T, strict=True)
    )
    table |= dict(zip(("rx", "ry", "rz"), turn.as_rotvec().T, strict=True))
    targets = {"A": {"point": end.name, "offset_m": DECLARED_M.tolist()}}
    changes = {
        "robot": name,
        "measured": "pose",
        "targets": targets,
        "declared": ["joint_offset", "link_geometry"],
    }
    changes |= {
        "compliance": "nominal",
        "noise": {"position_m": 6e-5, "orientation_rad": 6e-5},
    }
    return made_folder(folder, robot, table=table, **changes)


def findings(folder):
    case, _ = cases_in(folder, ROBOTS)
    return find_misplaced_frames(
        fit_declared_model(case.model, case.observations, estimate_noise(case)[0]),
        case.campaign,
    )


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize(
    ("place", "shift_m"),
    [
        ("tool", [5e-3, 0, 0]),
        ("tool", [0, 4e-3, -5e-3]),
        ("link 3", [15e-3, 0, 0]),
        ("link 1", [0, 0, 0.2]),
    ],
)
def test_a_wrong_target_or_length_is_found_with_its_size(
    tmp_path, name, place, shift_m
):
    (found,) = findings(
        misdeclared_folder(tmp_path / "made", analysed(name), name, place, shift_m)
    )
    # Of parallel axes one link says as well as the other.
    assert place in (found.place, *found.alternatives)
    assert np.linalg.norm(found.shift_m) == pytest.approx(
        np.linalg.norm(shift_m), rel=0.2
    )
    if place == "tool":
        np.testing.assert_allclose(found.shift_m, shift_m, atol=1e-3)
        assert "the flange is not certified, the reflector is" in found.sentence


@pytest.mark.parametrize("name", ARMS)
def test_a_base_that_stands_elsewhere_is_said_before_any_diagnosis_and_a_wrong_target_too(
    tmp_path, name
):
    robot = analysed(name)
    said = overview(
        misdeclared_folder(tmp_path / "base", robot, name, "base", [0, 5e-3, 0]), ROBOTS
    ).attention
    assert "base stands 5." in said[0] or "base stands 4.9" in said[0]
    said = overview(
        misdeclared_folder(tmp_path / "tool", robot, name, "tool", [5e-3, 0, 0]), ROBOTS
    ).attention
    assert "along x of" in said[0] and not any("base stands" in each for each in said)


@pytest.mark.parametrize("name", ARMS)
def test_inexact_geometry_is_nothing_misplaced(tmp_path, name):
    for seed in range(5):
        assert (
            findings(
                misdeclared_folder(
                    tmp_path / f"{seed}", analysed(name), name, "", 0.0, seed=seed
                )
            )
            == []
        )


def test_the_point_is_named_with_what_was_declared_of_its_target(tmp_path):
    case, _ = cases_in(
        misdeclared_folder(tmp_path / "made", analysed("kuka"), "kuka", "", 0.0), ROBOTS
    )
    assert "6DoF" in describe_reference_point(
        case.campaign
    ) and "(100.0, 0.0, 50.0) mm" in describe_reference_point(case.campaign)
