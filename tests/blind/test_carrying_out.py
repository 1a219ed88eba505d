"""A further experiment does what was proposed, on the same robot, and changes nothing that was read before."""

import numpy as np
import pytest
import yaml
from analysed_robots import ROBOTS

from elastocal.campaigns.holdout import split
from elastocal.campaigns.reading import read_campaign
from elastocal_proof.blind.carrying_out import carry_out
from elastocal_proof.blind.cases import Case, make_case
from elastocal_proof.blind.follow_up import LADDER
from elastocal_proof.blind.verdicts import ARMS, POSES, folder_of
from elastocal_proof.plant.arm import arm_from_file

CASE = Case("lost motion", "single", "kuka", ("lost_motion",), (50.0,), "usual", 187654321)
STATES = max(POSES)


@pytest.fixture(scope="module")
def experiment():
    """Shown angles and loads."""
    draws = np.random.default_rng(3)
    force, lever = draws.normal(0, 500, (STATES, 3)), np.array([0.0, 0.5, 0.0])
    return draws.uniform(-0.8, 0.8, (STATES, 6)), np.concatenate([force, np.cross(lever, force)], axis=1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, experiment):
    """The first campaign in `blind`, the further ones in `again`."""
    folder = tmp_path_factory.mktemp("follow_up")
    make_case(CASE, folder / "blind", folder / "sealed", ROBOTS)
    carry_out(CASE, *experiment, folder / "again", ROBOTS)
    return folder


def first_and_further(folder, arm, poses, robots=ROBOTS):
    """Campaign before, campaign after, and which measurements of the latter are new."""
    before = read_campaign(folder / "blind" / CASE.name, ROBOTS)
    after = read_campaign(folder_of(folder / "again", arm, poses, CASE.name), robots)
    return before, after, after.measurements.pose > before.measurements.pose.max()


@pytest.mark.parametrize("poses", POSES)
@pytest.mark.parametrize("arm", ARMS)
def test_what_was_read_before_stays_and_the_held_out_poses_too(folder, arm, poses):
    before, after, new = first_and_further(folder, arm, poses)
    for name in ("pose", "position", "rotation_vector", "joint_angles", "wrench", "time_s"):
        np.testing.assert_array_equal(getattr(after.measurements, name)[~new], getattr(before.measurements, name))
    assert len(np.unique(after.measurements.pose[new])) == poses
    training, held_out = split(after)
    np.testing.assert_array_equal(held_out.position, split(before)[1].position)
    assert set(np.unique(after.measurements.pose[new])) <= set(training.pose)


def test_the_proposed_poses_and_loads_are_those_carried_out(folder, experiment):
    shown, wrench = experiment
    _, after, new = first_and_further(folder, "proposed", STATES)
    measurements = after.measurements.select(new)
    for number in range(STATES):
        mine = measurements.pose == np.unique(measurements.pose)[number]
        np.testing.assert_allclose(measurements.joint_angles[mine], np.tile(shown[number], (mine.sum(), 1)), atol=1e-12)
        shares = np.array(LADDER)[measurements.load[mine]]
        assert set(shares) == set(CASE.design.ladder)
        np.testing.assert_allclose(measurements.wrench[mine], shares[:, None] * wrench[number], atol=1e-9)


def test_random_poses_are_read_like_the_proposed_and_others_than_the_campaigns(folder):
    before, after, new = first_and_further(folder, "random", STATES)
    _, proposed, theirs = first_and_further(folder, "proposed", STATES)
    np.testing.assert_array_equal(after.measurements.load[new], proposed.measurements.load[theirs])
    force = np.linalg.norm(after.measurements.wrench[new, :3], axis=1)
    np.testing.assert_allclose(force, np.abs(np.array(LADDER)[after.measurements.load[new]]) * 1000.0, atol=1e-9)
    known = {tuple(row) for row in before.measurements.joint_angles.round(9)}
    assert not known & {tuple(row) for row in after.measurements.joint_angles[new].round(9)}
    low, high = arm_from_file(ROBOTS / "kuka.yaml").limits.T
    assert ((low <= after.measurements.joint_angles[new]) & (after.measurements.joint_angles[new] <= high)).all()


def test_angles_are_those_that_the_controller_shows(tmp_path, experiment):
    """On a robot whose controller counts its second joint the other way round and couples the third to it."""
    matrix = np.eye(6)
    matrix[1, 1], matrix[2, 1] = -1.0, 1.0
    document = yaml.safe_load((ROBOTS / "kuka.yaml").read_text(encoding="utf-8"))
    document["reported_joints"] = {"matrix": matrix.tolist(), "offset_deg": [0, 30, 0, 0, 0, 0]}
    robots = tmp_path / "robots"
    robots.mkdir()
    (robots / "kuka.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    shown, wrench = experiment
    carry_out(CASE, shown, wrench, tmp_path / "again", robots)
    written = read_campaign(folder_of(tmp_path / "again", "proposed", 5, CASE.name), robots)
    new = written.measurements.pose >= CASE.design.poses
    poses = np.unique(written.measurements.pose[new], return_index=True)[1]
    # The campaign is read into angles of the model.
    expected = shown[:5] @ matrix.T + np.radians([0, 30, 0, 0, 0, 0])
    np.testing.assert_allclose(written.measurements.joint_angles[new][poses], expected, atol=1e-9)
