"""Both FANUC sources as campaigns: made-up measurements in the files' own formats come back as measurements of the chain."""

import numpy as np
import pytest
import scipy.io
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.campaigns.holdout import split
from elastocal.campaigns.importers import fanuc_cpa, fanuc_joint, fanuc_static
from elastocal.campaigns.reading import held_out_campaign, read_campaign
from elastocal.mechanics.kinematics import poses

OFFSETS = np.array([[0.2, 0.0, 0.05], [0.2, 0.06, -0.02], [0.15, -0.04, -0.04]])
POSES, REPEATS = 8, 3


def reflectors(chain, angles, seed):
    """Positions (N, 3 reflectors, 3) in some tracker's frame."""
    rng = np.random.default_rng(seed)
    position, rotation = poses(chain, angles, chain.end_effector)
    flange = position[:, None] + np.einsum("nij,kj->nki", rotation, OFFSETS)
    return flange @ Rotation.random(rng=rng).as_matrix().T + rng.uniform(-3, 3, 3)


def model_angles(degrees, elbow):
    """The chain's angles in rad from a controller's in degrees, written out; `elbow` is the angle between the arms."""
    j1, j2, _, j4, j5, j6 = degrees.T
    return np.radians(np.column_stack([j1, j2 - 90, 90 - elbow, -j4, -j5, -j6]))


@pytest.fixture
def static(fanuc, tmp_path):
    """File of the static source and what the campaign of it must hold: joint angles and positions, row by row."""
    degrees = np.random.default_rng(1).uniform(-50, 50, (POSES, 6)).repeat(REPEATS, axis=0)
    angles = model_angles(degrees, degrees[:, 2])
    positions = reflectors(fanuc.chain, angles, 2)
    path = tmp_path / "calibration.mat"
    named = {f"m{name}": positions[:, index] for index, name in enumerate("ABC")}
    scipy.io.savemat(path, {"q": np.radians(degrees), **named})
    return path, angles, positions


@pytest.fixture
def cpa(fanuc, tmp_path):
    """The same for the source of one joint at a time."""
    degrees = np.random.default_rng(3).uniform(-50, 50, (POSES, 6))
    angles = model_angles(degrees, degrees[:, 1] + degrees[:, 2])
    positions = reflectors(fanuc.chain, angles, 4)
    path = tmp_path / "values.csv"
    np.savetxt(path, np.hstack([1e3 * positions.reshape(-1, 9), np.zeros((POSES, 6)), degrees]))
    return path, angles, positions


def assert_holds(measurements, angles, positions):
    assert len(measurements) == 3 * len(angles)
    np.testing.assert_allclose(measurements.joint_angles, angles.repeat(3, axis=0), rtol=0, atol=1e-12)
    np.testing.assert_allclose(measurements.position, positions.reshape(-1, 3), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(measurements.wrench, 0)
    np.testing.assert_array_equal(measurements.load, 0)


def test_static_source_becomes_a_campaign_with_repeats(static, config_folder, tmp_path):
    path, angles, positions = static
    fanuc_static.write_campaign(path, tmp_path / "campaign")
    campaign = read_campaign(tmp_path / "campaign", config_folder / "robots")
    assert (campaign.name, campaign.measured, campaign.frame) == ("fanuc_static", "position", "tracker")
    assert [(target.name, target.point, target.offset_m) for target in campaign.targets] == [(n, "6DoF", None) for n in "ABC"]
    assert (campaign.compliance, campaign.declared) == ("nominal", ("joint_offset", "link_geometry"))
    assert_holds(campaign.measurements, angles, positions)
    np.testing.assert_array_equal(campaign.measurements.pose, np.arange(POSES).repeat(3 * REPEATS))
    np.testing.assert_array_equal(campaign.measurements.repeat, np.tile(np.arange(REPEATS).repeat(3), POSES))


def test_cpa_source_becomes_a_campaign_of_the_controllers_angles(cpa, config_folder, tmp_path):
    path, angles, positions = cpa
    fanuc_cpa.write_campaign(path, tmp_path / "campaign")
    campaign = read_campaign(tmp_path / "campaign", config_folder / "robots")
    assert [target.name for target in campaign.targets] == list("DEF")
    assert campaign.noise == fanuc_cpa.NOISE
    assert_holds(campaign.measurements, angles, positions)


def test_joint_campaign_holds_both_as_sessions_of_one_robot(static, cpa, config_folder, tmp_path):
    fanuc_joint.write_campaign(static[0], cpa[0], tmp_path / "campaign", config_folder / "robots")
    campaign = read_campaign(tmp_path / "campaign", config_folder / "robots")
    for session, (_, angles, positions) in enumerate((static, cpa)):
        measurements = campaign.measurements.select(campaign.measurements.session == session)
        assert_holds(measurements, angles, positions)
        assert {campaign.targets[index].name for index in measurements.target} == set(("ABC", "DEF")[session])


def test_each_session_can_test_the_other(static, cpa, config_folder, tmp_path):
    robots = config_folder / "robots"
    fanuc_static.write_campaign(static[0], tmp_path / "static", "static_to_cpa", {"campaign": "../cpa"})
    fanuc_cpa.write_campaign(cpa[0], tmp_path / "cpa", "cpa_to_static", {"campaign": "../static"})
    for here, there in (("static", "cpa"), ("cpa", "static")):
        campaign = read_campaign(tmp_path / here, robots)
        training, held_out = split(campaign)
        assert len(training) == len(campaign.measurements) and len(held_out) == 0
        assert held_out_campaign(campaign, tmp_path / here, robots).name == f"{there}_to_{here}"


def test_robot_files_of_the_sources_are_one_robot(fanuc, config_folder, tmp_path, static, cpa):
    fanuc_static.write_campaign(static[0], tmp_path / "a")
    fanuc_cpa.write_campaign(cpa[0], tmp_path / "b")
    fanuc_joint.write_campaign(static[0], cpa[0], tmp_path / "c", config_folder / "robots")
    robots = [read_campaign(tmp_path / name, config_folder / "robots").robot for name in "abc"]
    for robot in robots:
        assert robot.chain == fanuc.chain
        np.testing.assert_array_equal(robot.compliance, fanuc.compliance)
        np.testing.assert_array_equal(robot.joint_limits, robots[0].joint_limits)


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"q": None}, "q", ["nothing", "6) numbers"]),
        ({"q": np.zeros((24, 5))}, "q", ["(24, 5)"]),
        ({"q": np.zeros((0, 6))}, "q", ["(0, 6)"]),
        ({"mB": np.zeros((23, 3))}, "mB", ["(23, 3)", "3) numbers"]),
        ({"mC": "text"}, "mC", ["numbers"]),
    ],
)
def test_mat_file_of_other_variables_is_refused(static, tmp_path, changes, key, words):
    contents = {name: value for name, value in scipy.io.loadmat(static[0]).items() if not name.startswith("__")} | changes
    path = tmp_path / "other.mat"
    scipy.io.savemat(path, {name: value for name, value in contents.items() if value is not None})
    with refused(path, key, *words):
        fanuc_static.write_campaign(path, tmp_path / "campaign")
    assert not (tmp_path / "campaign").exists()


@pytest.mark.parametrize("contents", [b"", b"no MAT file at all, but long enough to be asked for its header. " * 4])
def test_file_that_is_no_mat_file_is_refused(tmp_path, contents):
    path = tmp_path / "other.mat"
    path.write_bytes(contents)
    with refused(path, "", "MAT file"):
        fanuc_static.read(path)


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("", "", ["no row"]),
        ("1 2 3\n", "line 1", ["3 numbers", "21 finite numbers"]),
        (" ".join(21 * ["1"]) + "\n\n" + " ".join(20 * ["1"]) + " x\n", "line 3", ["no number"]),
        (" ".join(20 * ["1"]) + " nan\n", "line 1", ["21 finite numbers"]),
    ],
)
def test_text_of_other_rows_is_refused(tmp_path, text, key, words):
    path = tmp_path / "values.csv"
    path.write_text(text, encoding="utf-8")
    with refused(path, key, *words):
        fanuc_cpa.read(path)


@pytest.mark.parametrize("source", [fanuc_static, fanuc_cpa])
def test_missing_source_is_refused(tmp_path, source):
    with refused(tmp_path / "nowhere", "", "readable file"):
        source.read(tmp_path / "nowhere")
