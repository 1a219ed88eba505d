"""From a plan through a filled sheet to a check, over robots and options: a result or one line, never a traceback."""

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from elastocal.application.planning.plan import SENSORS
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.writing import write_campaign
from elastocal.command.main import app
from elastocal.errors import InputError
from elastocal.mechanics.kinematics import poses

ROBOTS = yaml.safe_load(Path(__file__).with_name("planned_robots.yaml").read_text(encoding="utf-8"))

OFFSETS = ("", "=0,0,0", "=0.1,0,0", "=0,-0.1,0.05")
BASE = Rotation.from_rotvec([0.3, -0.2, 1.0]), np.array([2.0, -1.0, 0.5])


@st.composite
def calls(draw):
    """A robot and the options of a plan."""
    words = ["--criterion", draw(st.sampled_from("DAI"))]
    words += ["--poses", str(draw(st.sampled_from([5, 12, 30])))]
    words += draw(st.sampled_from([[], ["--force", "80"], ["--force", "80", "--pull"]]))
    words += draw(st.sampled_from([[], ["--base-known"]]))
    words += draw(st.sampled_from([[], ["--measured", "position"], ["--measured", "pose"]]))
    words += draw(st.sampled_from([[], *(["--sensor", name] for name in SENSORS)]))
    words += draw(st.sampled_from([[], ["--noise", "0.01um"], ["--noise", "100mm"]]))
    words += draw(st.sampled_from([[], [], ["--orientation-noise", "0.01deg"], ["--orientation-noise", "0.01urad"]]))
    words += draw(st.sampled_from([[], [], ["--tracker", "3,1,1"], ["--tracker", "0,0,0"]]))
    words += draw(st.sampled_from([[], [], ["--accuracy", "1mm"]]))
    names = draw(st.sampled_from(["", "A", "AB", "ABC"]))
    for name in names:
        words += ["--target", f"{name}:{draw(st.sampled_from(['elbow', 'tool0']))}{draw(st.sampled_from(OFFSETS))}"]
    return draw(st.sampled_from(sorted(ROBOTS))), words


def run_command(*words):
    """Output of a command, or the line in which it refused."""
    result = CliRunner().invoke(app, [*map(str, words)])
    if isinstance(result.exception, InputError):
        assert len(str(result.exception).splitlines()) == 1
        return str(result.exception)
    assert result.exception is None or isinstance(result.exception, SystemExit), (words, result.exception)
    return result


def fill(folder, seed):
    """Write to each row of a sheet what the nominal robot shows, with noise."""
    draws = np.random.default_rng(seed)
    document = yaml.safe_load((folder / "campaign.yaml").read_text(encoding="utf-8"))
    robot = read_robot(folder / "robot.yaml")
    sheet = pd.read_csv(folder / "measurements.csv", dtype={"target": str})
    joints = sheet[[f"q{joint}" for joint in range(1, robot.joints + 1)]].to_numpy(float)
    noise = document["noise"]
    for name, target in document["targets"].items():
        rows = np.flatnonzero(sheet["target"] == name)
        assert len(rows)
        at, turned = poses(robot.chain, robot.model_angles(joints[rows]), robot.chain.point(target["point"]))
        offset = [0.02, 0.03, 0.04] if target["offset_m"] == "unknown" else target["offset_m"]
        at, turned = at + turned @ np.array(offset), Rotation.from_matrix(turned)
        if document["frame"] == "tracker":
            at, turned = BASE[0].apply(at) + BASE[1], BASE[0] * turned
        at = at + noise["position_m"] * draws.standard_normal(at.shape)
        sheet.loc[rows, ["x", "y", "z"]] = at
        if document["measured"] == "pose":
            turn = noise["orientation_rad"] * draws.standard_normal(at.shape)
            sheet.loc[rows, ["rx", "ry", "rz"]] = (Rotation.from_rotvec(turn) * turned).as_rotvec()
    sheet.assign(done="x").to_csv(folder / "measurements.csv", index=False)


@settings(max_examples=3, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True, phases=[Phase.generate])
@given(calls())
def test_every_plan_is_a_sheet_that_is_checked_once_it_is_filled(call):
    name, words = call
    with tempfile.TemporaryDirectory() as place:
        folder, robot = Path(place, "cell"), Path(place, "robot.yaml")
        robot.write_text(ROBOTS[name], encoding="utf-8")
        planned = run_command("plan", robot, "--folder", folder, "--candidates", 80, "--held-out", 4, *words)
        if isinstance(planned, str):
            assert not folder.exists()
            return
        document = yaml.safe_load((folder / "campaign.yaml").read_text(encoding="utf-8"))
        assert len(document["targets"]) == max(words.count("--target"), 1)
        # Nothing is measured yet.
        assert "found nothing" in run_command("check", folder)
        fill(folder, 1)
        assert not isinstance(checked := run_command("check", folder), str), checked


def test_a_campaign_of_what_no_joint_moves_is_refused_by_check(tmp_path):
    (tmp_path / "robot.yaml").write_text(ROBOTS["turntable"], encoding="utf-8")
    draws, poses_there = np.random.default_rng(1), np.arange(1, 19)
    table = {"pose": poses_there, "load": 0 * poses_there, "repeat": 0 * poses_there, "target": ["foot"] * len(poses_there)}
    table |= {"q1": np.linspace(-2.0, 2.0, len(poses_there))}
    table |= {
        axis: at + 3e-5 * draws.standard_normal(len(poses_there)) for axis, at in zip("xyz", (0.1, 0.0, 0.4), strict=True)
    }
    document = {"campaign": "still", "robot": "robot.yaml", "measured": "position", "frame": "base"}
    document |= {
        "targets": {"foot": {"point": "elbow", "offset_m": [0.1, 0.0, 0.0]}},
        "declared": ["joint_offset", "link_geometry"],
    }
    write_campaign(tmp_path, document | {"holdout": {"fraction": 0.3, "seed": 1}}, table, 1, "csv")
    assert "no joint moves" in run_command("check", tmp_path)
