"""A fit made by scipy is one; its parameters or standard errors altered are none."""

import json

import numpy as np
import pandas as pd
import pytest
from made_audits import CONFIGURATION, ROBOT, failed
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from elastocal_proof.audit import fits
from elastocal_proof.audit.audited import COMPONENTS, WRENCH, Audited
from elastocal_proof.audit.elastic import Robot, Springs, averages

FOLDER, REPORTS = "results/loop/cell", "reports/loop/cell"
TARGETS = {"hand": {"point": "hand", "offset_m": [0.0, 0.1, 0.0]}}
SIGMA = np.repeat([6e-5, 5e-5], 3)


def measured(robot):
    """Two loads at ten poses, the first approached four times, with noise."""
    draws, rows = np.random.default_rng(3), []
    springs = Springs(1e-6 * np.array([0.6, 0.7]))
    for pose in range(10):
        angles, force = draws.uniform(-1, 1, 2), draws.normal(size=3)
        for load, repeats in ((0, 2), (1, 4)):
            wrench = load * 800 * np.concatenate([force, np.cross([0, 0.5, 0], force)])
            coordinates, _ = robot.loaded(robot.compliance(springs), angles, wrench)
            position, rotation = robot.arms[0].pose(coordinates, "hand")
            for repeat in range(repeats):
                off = SIGMA * draws.normal(size=6)
                turn = (Rotation.from_rotvec(off[3:]) * Rotation.from_matrix(rotation)).as_rotvec()
                rows.append([0, pose, load, repeat, 0, *angles, *wrench, *(position + off[:3]), *turn])
    names = ["session", "pose", "load", "repeat", "target", "q1", "q2", *WRENCH, "x", "y", "z", "rx", "ry", "rz"]
    frame = pd.DataFrame(rows, columns=names)
    return frame.assign(row=range(1, len(frame) + 1), approach1=np.nan)


def noise_of(frame):
    """Scatter of the repeats about their means, of positions and of rotations."""
    state = frame.groupby(["pose", "load"])
    free = len(frame) - state.ngroups
    rotations = Rotation.from_rotvec(frame[["rx", "ry", "rz"]].to_numpy(copy=True))
    first = state.ngroup().drop_duplicates().index
    turns = (rotations * rotations[first[np.searchsorted(first, frame.index, side="right") - 1]].inv()).as_rotvec()
    off = [frame[list("xyz")], pd.DataFrame(turns, frame.index)]
    sums = [((part - part.groupby([frame["pose"], frame["load"]]).transform("mean")) ** 2).to_numpy().sum() for part in off]
    position, orientation = np.sqrt(np.array(sums) / (3 * free))
    stated = {"position_m": position, "orientation_rad": orientation, "degrees_of_freedom": 6 * free}
    return stated | {"source": "repeats", "joint_rad": [0.0, 0.0], "pose_rad": 0.0, "usual_m": 0.0}


@pytest.fixture(scope="module")
def made():
    """Measurements, the compliances that scipy fits to some of them, and their standard errors."""
    robot = Robot(ROBOT, list(TARGETS.values()))
    frame = measured(robot)
    training = frame[frame["pose"] < 7]
    seen = averages(training, True)
    noise = noise_of(training)
    scale = np.repeat([noise["position_m"], noise["orientation_rad"]], 3) / np.sqrt(seen.repeats)[:, None]

    def residual(values):
        return (robot.residuals(robot.all_loaded(Springs(1e-6 * values), seen), seen) / scale).ravel()

    # Huber's weights belong to distances of whole poses: none of these is far off.
    found = least_squares(residual, [0.5, 0.5], xtol=1e-12, ftol=1e-12, gtol=1e-12)
    error = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    return robot, frame, 1e-6 * found.x, 1e-6 * error, noise


@pytest.fixture
def run(made, tmp_path):
    robot, frame, value, error, noise = made
    for folder in (FOLDER, REPORTS):
        (tmp_path / folder).mkdir(parents=True)
    parts = {"training": frame[frame["pose"] < 7], "held_out": frame[frame["pose"] >= 7]}
    for name, part in parts.items():
        part.to_parquet(tmp_path / FOLDER / f"{name}.parquet")
    asked = {"frame": "base", "targets": TARGETS, "declared": [], "measured": "pose", "campaign": "cell"}
    (tmp_path / FOLDER / "campaign.json").write_text(json.dumps({"campaign": asked, "robot": ROBOT, "held_out": None}))
    steps = [
        {"name": "frames", "kind": "frames", "noise": noise, "effects": []},
        {"name": "declared", "kind": "declared", "noise": noise, "effects": ["joint_compliance"]},
    ]
    (tmp_path / FOLDER / "diagnosis.json").write_text(json.dumps({"steps": steps, "document": {"gross_errors": []}}))
    table = pd.DataFrame({"step": 1, "owner": "joint_compliance", "parameter": ["c1", "c2"], "value": value})
    table.assign(std_error=error, held=False, prior_std=np.nan).to_parquet(tmp_path / FOLDER / "steps.parquet")
    known = fits.Campaign(robot, True, [], parts["training"], averages(parts["training"], True))
    step = fits.Step("declared", table, noise, Springs(value))
    for unseen, part in ((False, parts["training"]), (True, parts["held_out"])):
        off = fits.residuals_of(known, step, part)
        for state in ("before", "after"):
            part = part.assign(**{f"{state}_{name}": off[:, place] for place, name in enumerate(COMPONENTS)})
        parts["held_out" if unseen else "training"] = part.assign(held_out=unseen)
    pd.concat(parts.values()).assign(gross_error=False).to_parquet(tmp_path / REPORTS / "residuals.parquet")
    return Audited(tmp_path, CONFIGURATION, {}, {}, 4)


def changed(run, file, row, column, change):
    path = run.folder / file
    frame = pd.read_parquet(path)
    frame.loc[frame.index[row], column] = change(frame.iloc[row][column])
    frame.to_parquet(path)


def checked(run):
    found = fits.fits(run, f"{FOLDER}/steps.parquet", "cell"), fits.predictions(run, f"{REPORTS}/residuals.parquet", "cell")
    return [name for each in found for name in failed(each)]


def test_a_fit_by_scipy_stands_still_with_its_standard_errors(run):
    assert checked(run) == []


def test_a_parameter_off_by_a_hundredth_of_its_standard_error_is_found(run, made):
    changed(run, f"{FOLDER}/steps.parquet", 1, "value", lambda value: value + 0.01 * made[3][1])
    assert "estimates of step 1 (declared) stand still, in standard errors" in checked(run)


def test_a_standard_error_halved_is_found(run):
    changed(run, f"{FOLDER}/steps.parquet", 0, "std_error", lambda value: 0.5 * value)
    assert checked(run) == ["standard errors of step 1 (declared)"]


def test_a_residual_of_a_held_out_pose_is_found(run):
    changed(run, f"{REPORTS}/residuals.parquet", -1, "after_ry", lambda value: value + 1e-7)
    assert checked(run) == ["residuals after, fitted and held out, all rows"]


def test_noise_that_is_not_that_of_the_repeats_is_found(run):
    path = run.folder / FOLDER / "diagnosis.json"
    document = json.loads(path.read_text())
    document["steps"][0]["noise"]["orientation_rad"] *= 1.01
    path.write_text(json.dumps(document))
    assert checked(run) == ["noise of step 0, from repeats"]


@pytest.mark.parametrize(("stated", "expected"), [(1.3, []), (1.31, ["noise of step 1, from repeats"])])
def test_noise_may_be_that_of_the_repeats_times_the_factor_that_is_stated(run, stated, expected):
    """Of a step about which measurements scatter more than about each other."""
    path = run.folder / FOLDER / "diagnosis.json"
    document = json.loads(path.read_text())
    noise = document["steps"][1]["noise"]
    document["steps"][1]["noise"] = noise | {name: 1.3 * noise[name] for name in ("position_m", "orientation_rad")}
    document["document"] = {"noise": {"factor": stated}, "gross_errors": []}
    path.write_text(json.dumps(document))
    found = [name for name in checked(run) if name.startswith("noise")]
    assert found == expected


@pytest.mark.parametrize(
    "other",
    [{"frame": "tracker"}, {"declared": ["joint_offset"]}, {"targets": {"hand": {"point": "hand", "offset_m": "unknown"}}}],
)
def test_what_is_not_written_down_here_is_left_out(run, other):
    path = run.folder / FOLDER / "campaign.json"
    document = json.loads(path.read_text())
    document["campaign"] |= other
    path.write_text(json.dumps(document))
    assert [*fits.fits(run, f"{FOLDER}/steps.parquet", "cell")] == []
