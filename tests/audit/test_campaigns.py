"""Unaltered simulated campaigns hold; an altered value, a leaked pose and a broken seal
do not."""

import hashlib
import json

import numpy as np
import pandas as pd
import pytest
import yaml
from made_audits import CONFIGURATION, ROBOT, altered, failed

from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.mechanics.robot_file import parse_robot
from elastocal_proof.audit.campaigns import (
    check_seals,
    check_simulated_campaign,
    check_split,
)
from elastocal_proof.audit.finished_run import FinishedRun

PLAN = {
    **{
        "points": ["hand"],
        "poses": 3,
        "force_N": 500,
        "ladder": [0, 1, -1],
        "offset_m": [0, 0.5, 0],
        "repeats": 2,
    },
    **{"repeated_poses": 1, "noise_m": 6e-5, "noise_rad": 5e-5},
}
DRAWN = "data/campaigns/cell/measurements.parquet"
TRAINING = "results/loop/cell/training.parquet"


@pytest.fixture
def drawn(tmp_path):
    for folder in (
        "config/campaigns",
        "config/robots",
        "data/campaigns/cell",
        "results/loop/cell",
    ):
        (tmp_path / folder).mkdir(parents=True)
    source = {"source": "simulated", "robot": "two", "declared_robot": "two"} | PLAN
    (tmp_path / "config/campaigns/cell.yaml").write_text(
        yaml.safe_dump(source), encoding="utf-8"
    )
    (tmp_path / "config/robots/two.yaml").write_text(
        yaml.safe_dump(ROBOT), encoding="utf-8"
    )
    plan = Plan(
        **{
            name: tuple(value) if isinstance(value, list) else value
            for name, value in PLAN.items()
        }
    )
    table = pd.DataFrame(draw_measurements(parse_robot(ROBOT, "two"), plan, 1, "cell"))
    table.to_parquet(tmp_path / DRAWN)
    table = table.assign(row=np.arange(1, len(table) + 1), session=0)
    table[table["pose"] < 2].to_parquet(tmp_path / TRAINING)
    table[table["pose"] == 2].to_parquet(
        tmp_path / TRAINING.replace("training", "held_out")
    )
    (tmp_path / "results/loop/cell/campaign.json").write_text(
        json.dumps({"held_out": None}), encoding="utf-8"
    )
    return FinishedRun(tmp_path, CONFIGURATION, {}, {}, 4)


def find_failures(run):
    run.table.cache_clear()
    return failed(
        [
            *check_simulated_campaign(run, DRAWN, "cell"),
            *check_split(run, TRAINING, "cell"),
        ]
    )


def test_a_simulated_campaign_is_drawn_again_and_no_measured_one(drawn):
    assert (
        find_failures(drawn) == []
        and len([*check_simulated_campaign(drawn, DRAWN, "cell")]) == 4
    )


@pytest.mark.parametrize(
    ("file", "column", "change", "checked"),
    [
        (DRAWN, "rz", lambda v: v + 1e-6, "measured poses of hand"),
        (DRAWN, "my", lambda v: v + 1e-6, "wrenches of hand"),
        (DRAWN, "q2", lambda v: v + 1e-6, "joint angles of hand"),
        (DRAWN, "repeat", lambda v: v + 1, "visits of hand"),
        (TRAINING, "pose", lambda v: 2, "no pose is fitted and held out"),
        (TRAINING, "row", lambda v: 1, "every row of the campaign once"),
        (TRAINING, "z", lambda v: v + 1e-6, "angles, loads and positions as measured"),
    ],
)
def test_an_altered_value_does_not_hold(drawn, file, column, change, checked):
    with altered(drawn.folder, file, (column, 4), change):
        assert checked in find_failures(drawn)
    # A measured campaign has no simulation to check.
    (drawn.folder / "config/campaigns/cell.yaml").write_text(
        "source: public\n", encoding="utf-8"
    )
    assert [*check_simulated_campaign(drawn, DRAWN, "cell")] == []


def test_a_ground_truth_altered_after_its_seal_does_not_hold(drawn):
    sealed = drawn.folder / "data/sealed/some_1/case.json"
    manifest = drawn.folder / "reports/blind/manifest.sha256"
    sealed.parent.mkdir(parents=True)
    manifest.parent.mkdir(parents=True)
    sealed.write_bytes(b'{"size": 1.0}')
    manifest.write_text(
        f"{hashlib.sha256(sealed.read_bytes()).hexdigest()}  case.json\n",
        encoding="utf-8",
    )
    assert failed(check_seals(drawn, "reports/blind/manifest.sha256")) == []
    sealed.write_bytes(b'{"size": 1.1}')
    assert [
        finding.note for finding in check_seals(drawn, "reports/blind/manifest.sha256")
    ] == ["case.json"]
