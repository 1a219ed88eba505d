"""Files of a campaign that contradict each other are found."""

import json

import numpy as np
import pandas as pd
import pytest
import yaml
from audited_campaigns import altered, failed_once_altered
from made_audits import CONFIGURATION, ROBOT, failed

from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.mechanics.robot_file import robot_from_document
from elastocal_proof.audit import campaigns
from elastocal_proof.audit.audited import Audited

FOLDER, REPORTS = "results/loop/cell", "reports/loop/cell"


@pytest.fixture
def run(tmp_path):
    for folder in (FOLDER, REPORTS, "data/campaigns/cell"):
        (tmp_path / folder).mkdir(parents=True)
    rng = np.random.default_rng(1)
    rows = pd.DataFrame(rng.normal(size=(8, 3)), columns=list("xyz")).assign(pose=range(8), load=0, session=0, target=0)
    rows.to_parquet(tmp_path / "data/campaigns/cell/measurements.parquet")
    numbered = rows.assign(row=range(1, 9))
    numbered[:5].to_parquet(tmp_path / FOLDER / "training.parquet")
    numbered[5:].to_parquet(tmp_path / FOLDER / "held_out.parquet")
    (tmp_path / FOLDER / "campaign.json").write_text(json.dumps({"held_out": None}))
    models = {"probability": [0.7, 0.3], "mechanisms": ["joint_offset", "joint_offset + payload"]}
    pd.DataFrame(models).to_parquet(tmp_path / FOLDER / "models.parquet")
    pd.DataFrame({"correlation": [0.5, -1.0]}).to_parquet(tmp_path / FOLDER / "correlations.parquet")
    return Audited(tmp_path, CONFIGURATION, {}, {}, 4)


def state(run, **mechanisms):
    document = {"document": {"probabilities": {"mechanisms": mechanisms}}}
    (run.folder / FOLDER / "diagnosis.json").write_text(json.dumps(document))
    return failed(campaigns.diagnosis(run, f"{FOLDER}/diagnosis.json", "cell"))


def test_a_campaign_in_which_all_agrees_holds(run):
    assert failed(campaigns.measurements(run, f"{FOLDER}/training.parquet", "cell")) == []
    assert state(run, joint_offset=1.0, payload=0.3) == []


def test_a_held_out_pose_that_was_fitted_is_found(run):
    frame = pd.read_parquet(run.folder / FOLDER / "training.parquet")
    frame.loc[4, "pose"] = 6
    frame.to_parquet(run.folder / FOLDER / "training.parquet")
    assert "no pose is fitted and held out" in failed(campaigns.measurements(run, f"{FOLDER}/training.parquet", "cell"))


def test_a_held_out_pose_that_repeats_a_configuration_fitted_is_found(run):
    """A pose of its own number, with the joint angles of one that was fitted, in a campaign whose poses are drawn."""
    (run.folder / FOLDER / "campaign.json").write_text(
        json.dumps({"campaign": {"holdout": {"fraction": 0.4}}, "held_out": None})
    )
    for name in ("training", "held_out"):
        frame = pd.read_parquet(run.folder / FOLDER / f"{name}.parquet")
        frame["q1"] = frame["pose"].astype(float)
        frame.to_parquet(run.folder / FOLDER / f"{name}.parquet")
    assert failed(campaigns.measurements(run, f"{FOLDER}/training.parquet", "cell")) == []
    run.table.cache_clear()
    frame.assign(q1=[5.0, 1.01, 7.0]).to_parquet(run.folder / FOLDER / "held_out.parquet")
    found = failed(campaigns.measurements(run, f"{FOLDER}/training.parquet", "cell"))
    assert found == ["no configuration is fitted and held out"]


def test_a_pose_of_another_campaign_may_have_the_same_number_but_not_the_same_measurement(run):
    (run.folder / FOLDER / "campaign.json").write_text(json.dumps({"held_out": "other"}))
    frame = pd.read_parquet(run.folder / FOLDER / "held_out.parquet")
    frame.assign(pose=range(3)).to_parquet(run.folder / FOLDER / "held_out.parquet")
    assert failed(campaigns.measurements(run, f"{FOLDER}/training.parquet", "cell")) == []
    run.table.cache_clear()
    fitted = pd.read_parquet(run.folder / FOLDER / "training.parquet")
    pd.concat([frame, fitted[:1]]).to_parquet(run.folder / FOLDER / "held_out.parquet")
    found = failed(campaigns.measurements(run, f"{FOLDER}/training.parquet", "cell"))
    assert found == ["no measurement is fitted and held out"]


def test_a_probability_that_is_no_sum_over_models_is_found(run):
    assert state(run, joint_offset=1.0, payload=0.6) == ["probability of payload"]


@pytest.mark.parametrize(
    ("units", "stated", "found"),
    [
        ("joint_offset@2; other[2] own", "joint_offset + other", []),
        ("joint_offset@2; other[2] own", "joint_offset", []),
        ("joint_offset@2; other[2] own", "other", []),
        ("joint_offset@2; payload", "joint_offset", ["mechanisms of the parts of each model"]),
        ("joint_offset@2", "other", ["mechanisms of the parts of each model"]),
        ("other[2] own", "nothing", ["mechanisms of the parts of each model"]),
    ],
)
def test_a_model_states_its_parts_or_of_a_smooth_error_and_laws_one_alone(run, units, stated, found):
    frame = pd.DataFrame({"probability": [1.0], "log_odds": [0.0], "mechanisms": [stated], "units": [units]})
    frame.to_parquet(run.folder / FOLDER / "models.parquet")
    assert failed(campaigns.models(run, f"{FOLDER}/models.parquet", "cell")) == found


@pytest.mark.parametrize(("named", "expected"), [("link_elasticity", ["heldout errors after"]), ("setup_step", [])])
def test_errors_before_and_after_are_those_of_the_means_of_repeats(diagnosed, named, expected):
    """Of a model that goes with the row each repeat has a prediction of its own."""
    with altered(diagnosed, f"{REPORTS}/verdict.json", ["effects", 0, "name"], lambda _: named):
        table, cell = f"{REPORTS}/before_after.csv", ("heldout_rms_m", -1)
        found = failed_once_altered(diagnosed, table, cell, lambda value: 0.999 * value, f"{REPORTS}/residuals.parquet")
    assert found == expected


PLAN = {
    **{"points": ["hand"], "poses": 3, "force_N": 500, "ladder": [0, 1, -1], "offset_m": [0, 0.5, 0], "repeats": 2},
    **{"repeated_poses": 1, "noise_m": 6e-5, "noise_rad": 5e-5},
}
DRAWN = "data/campaigns/cell/measurements.parquet"


@pytest.fixture
def drawn(tmp_path):
    for folder in ("config/campaigns", "config/robots", "data/campaigns/cell"):
        (tmp_path / folder).mkdir(parents=True)
    source = {"source": "simulated", "robot": "two", "declared_robot": "two"} | PLAN
    (tmp_path / "config/campaigns/cell.yaml").write_text(yaml.safe_dump(source), encoding="utf-8")
    (tmp_path / "config/robots/two.yaml").write_text(yaml.safe_dump(ROBOT), encoding="utf-8")
    plan = Plan(**{name: tuple(value) if isinstance(value, list) else value for name, value in PLAN.items()})
    columns = draw_measurements(robot_from_document(ROBOT, "two"), plan, 1, "cell")
    pd.DataFrame(columns).to_parquet(tmp_path / DRAWN)
    return Audited(tmp_path, CONFIGURATION, {}, {}, 4)


def test_a_simulated_campaign_is_drawn_again(drawn):
    found = [*campaigns.simulated(drawn, DRAWN, "cell")]
    assert failed(found) == [] and len(found) == 4


@pytest.mark.parametrize(
    ("column", "checked"),
    [("x", "measured poses"), ("rz", "measured poses"), ("my", "wrenches"), ("q2", "joint angles"), ("repeat", "visits")],
)
def test_a_value_altered_is_found(drawn, column, checked):
    frame = pd.read_parquet(drawn.folder / DRAWN)
    frame[column] = frame[column] + np.where(np.arange(len(frame)) == 4, 1, 0) * (1 if column == "repeat" else 1e-6)
    frame.to_parquet(drawn.folder / DRAWN)
    assert failed(campaigns.simulated(drawn, DRAWN, "cell")) == [f"{checked} of hand"]


def test_a_measured_campaign_is_left_alone(drawn):
    (drawn.folder / "config/campaigns/cell.yaml").write_text("source: public\n", encoding="utf-8")
    assert [*campaigns.simulated(drawn, DRAWN, "cell")] == []
