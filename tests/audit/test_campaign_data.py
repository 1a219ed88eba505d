"""A simulated campaign is drawn again; measurements that people have made are not."""

import numpy as np
import pandas as pd
import pytest
import yaml
from made_audits import CONFIGURATION, ROBOT, failed

from elastocal.audit.audited import Audited
from elastocal.audit.campaign_data import simulated
from elastocal.campaigns.simulation import Plan, simulated_measurements
from elastocal.mechanics.robot_file import robot_from_document

PLAN = {
    **{"points": ["hand"], "poses": 3, "force_N": 500, "ladder": [0, 1, -1], "offset_m": [0, 0.5, 0], "repeats": 2},
    **{"repeated_poses": 1, "noise_m": 6e-5, "noise_rad": 5e-5},
}
FILE = "data/campaigns/cell/measurements.parquet"


@pytest.fixture
def run(tmp_path):
    for folder in ("config/campaigns", "config/robots", "data/campaigns/cell"):
        (tmp_path / folder).mkdir(parents=True)
    source = {"source": "simulated", "robot": "two", "declared_robot": "two"} | PLAN
    (tmp_path / "config/campaigns/cell.yaml").write_text(yaml.safe_dump(source), encoding="utf-8")
    (tmp_path / "config/robots/two.yaml").write_text(yaml.safe_dump(ROBOT), encoding="utf-8")
    plan = Plan(**{name: tuple(value) if isinstance(value, list) else value for name, value in PLAN.items()})
    columns = simulated_measurements(robot_from_document(ROBOT, "two"), plan, 1, "cell")
    pd.DataFrame(columns).to_parquet(tmp_path / FILE)
    return Audited(tmp_path, CONFIGURATION, {}, {}, 4)


def test_a_simulated_campaign_is_drawn_again(run):
    found = simulated(run, FILE, "cell")
    assert failed(found) == [] and len(found) == 4


@pytest.mark.parametrize(
    ("column", "checked"),
    [("x", "measured poses"), ("rz", "measured poses"), ("my", "wrenches"), ("q2", "joint angles"), ("repeat", "visits")],
)
def test_a_value_altered_is_found(run, column, checked):
    frame = pd.read_parquet(run.folder / FILE)
    frame[column] = frame[column] + np.where(np.arange(len(frame)) == 4, 1, 0) * (1 if column == "repeat" else 1e-6)
    frame.to_parquet(run.folder / FILE)
    assert failed(simulated(run, FILE, "cell")) == [f"{checked} of hand"]


def test_a_measured_campaign_is_left_alone(run):
    (run.folder / "config/campaigns/cell.yaml").write_text("source: public\n", encoding="utf-8")
    assert simulated(run, FILE, "cell") == []
