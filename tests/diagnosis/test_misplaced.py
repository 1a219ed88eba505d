"""Frames that are declared wrongly by millimetres are found where they are, and none on
a robot with inexact geometry."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS, analysed
from made_folders import make_folder
from scipy.spatial.transform import Rotation

from elastocal.diagnosis.misplaced import (
    describe_reference_point,
    find_misplaced_frames,
)
from elastocal.fitting.noise import estimate_noise, fit_declared_model
from elastocal.loop.overview import inspect_campaign
from elastocal.loop.whole import read_cases
from elastocal.mechanics.kinematics import compute_poses
from elastocal.mechanics.sites import build_sites

DECLARED_M = np.array([0.1, 0.0, 0.05])
POSES = 40
# A heavy arm, a medium one and a light one.
ARMS = ("kuka", "abb", "ur10")


def deviating_coordinates(robot, angles, place, shift_m, draws):
    """Coordinates (P, C) of a robot with usual errors of geometry, at some joint angles
    (P, n), whose base or link is shifted."""
    sites = build_sites(robot)
    coordinates = np.zeros((len(angles), sites.chain.coordinates))
    offsets = 5e-4 * draws.standard_normal(robot.joints)
    coordinates[:, : robot.joints] = angles + offsets
    for link in range(1, robot.joints + 1):
        coordinates[:, sites.link_end[link]] += 3e-4 * draws.standard_normal(6)
    if place == "base":
        coordinates[:, sites.base[:3]] += shift_m
    elif place.startswith("link"):
        link = int(place.removeprefix("link "))
        coordinates[:, sites.link_end[link][:3]] += shift_m
    return coordinates


def misdeclared_folder(folder, robot, name, place, shift_m, seed=1):
    """A campaign of unloaded poses of one target on the end effector, with 60 µm and
    60 µrad of noise.

    `place`: what is not where it is declared: "tool", "base", "link 3" or "" for
    nothing.
    """
    draws = np.random.default_rng(seed)
    low, high = robot.joint_limits.T
    angles = low + (high - low) * draws.random((POSES, robot.joints))
    coordinates = deviating_coordinates(robot, angles, place, shift_m, draws)
    chain = build_sites(robot).chain
    end = chain.end_effector
    position, rotation = compute_poses(chain, coordinates, end)
    target_m = DECLARED_M + (np.array(shift_m) if place == "tool" else 0.0)
    position = position + rotation @ target_m
    turn = Rotation.from_rotvec(6e-5 * draws.standard_normal(position.shape))
    measured_turn = (turn * Rotation.from_matrix(rotation)).as_rotvec()
    position = position + 6e-5 * draws.standard_normal(position.shape)
    zeros = np.zeros(POSES, int)
    table = {
        "pose": np.arange(1, POSES + 1),
        "load": zeros,
        "repeat": zeros,
        "target": np.repeat("A", POSES),
    }
    reported = robot.reported_angles(angles).T
    table |= {f"q{joint}": column for joint, column in enumerate(reported, 1)}
    table |= dict(zip("xyz", position.T, strict=True))
    table |= dict(zip(("rx", "ry", "rz"), measured_turn.T, strict=True))
    return make_folder(
        folder,
        robot,
        table=table,
        robot=name,
        measured="pose",
        targets={"A": {"point": end.name, "offset_m": DECLARED_M.tolist()}},
        declared=["joint_offset", "link_geometry"],
        compliance="nominal",
        noise={"position_m": 6e-5, "orientation_rad": 6e-5},
    )


def find_in(folder):
    """Misplaced frames of a campaign."""
    case, _ = read_cases(folder, ROBOTS)
    noise, _ = estimate_noise(case)
    fitted = fit_declared_model(case.model, case.observations, noise)
    return find_misplaced_frames(fitted, case.campaign)


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
    folder = misdeclared_folder(tmp_path / "made", analysed(name), name, place, shift_m)
    (frame,) = find_in(folder)
    # Of links with parallel axes, either explains the measurements as well.
    assert place in (frame.place, *frame.alternatives)
    length_m = np.linalg.norm(shift_m)
    assert np.linalg.norm(frame.shift_m) == pytest.approx(length_m, rel=0.2)
    if place == "tool":
        np.testing.assert_allclose(frame.shift_m, shift_m, atol=1e-3)
        assert "results hold for the reflector, not for the flange" in frame.sentence


@pytest.mark.parametrize("name", ARMS)
def test_a_misplaced_base_or_target_is_reported_before_any_diagnosis(tmp_path, name):
    robot = analysed(name)
    base = misdeclared_folder(tmp_path / "base", robot, name, "base", [0, 5e-3, 0])
    first = inspect_campaign(base, ROBOTS).attention[0]
    assert "base stands 5." in first or "base stands 4.9" in first
    tool = misdeclared_folder(tmp_path / "tool", robot, name, "tool", [5e-3, 0, 0])
    sentences = inspect_campaign(tool, ROBOTS).attention
    assert "along x of" in sentences[0]
    assert not any("base stands" in sentence for sentence in sentences)


def test_squares_that_are_too_small_are_a_possible_cause_of_a_wrong_length(tmp_path):
    folder = tmp_path / "scaled_board"
    shutil.copytree(ROBOTS.parents[1] / "data/measured/fr3_board", folder)
    document = (folder / "campaign.yaml").read_text()
    document = re.sub("campaign: .*", "campaign: scaled_board", document)
    (folder / "campaign.yaml").write_text(document)
    table = pd.read_csv(folder / "measurements.csv", comment="#")
    table[["x", "y", "z"]] *= 1.08
    table.to_csv(folder / "measurements.csv", index=False)
    frames = find_in(folder)
    assert any("a board or a distance of another size" in f.sentence for f in frames)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", ARMS)
def test_nothing_is_misplaced_on_a_robot_with_inexact_geometry(tmp_path, name, seed):
    folder = misdeclared_folder(
        tmp_path / "made", analysed(name), name, "", 0.0, seed=seed
    )
    assert find_in(folder) == []


def test_the_reference_point_is_described_with_the_declared_offset_of_its_target(
    tmp_path,
):
    folder = misdeclared_folder(tmp_path / "made", analysed("kuka"), "kuka", "", 0.0)
    case, _ = read_cases(folder, ROBOTS)
    sentence = describe_reference_point(case.campaign)
    assert "6DoF" in sentence
    assert "offset (100.0, 0.0, 50.0) mm, known to 0.2 mm" in sentence
