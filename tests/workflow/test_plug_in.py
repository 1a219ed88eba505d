"""To add a robot, a strategy or a noise level is to add one file or one entry; every
switch of the configuration runs."""

import re

import numpy as np
import pandas as pd
import pytest

UR10 = """\
name: UR10
chain: >-
  Tz(0.1273) Rz(q1) Ty(0.1639) Ry(q2) Tx(0.612) [2DoF] Ry(q3) Tx(0.5723) [3DoF]
  Ry(q4) Rz(q5) Tz(-0.1157) [5DoF] Ry(q6) Ty(0.0922) [6DoF]
joint_limits_deg: [[-360, 360], [-360, 360], [-180, 180], [-360, 360], [-360, 360], [-360, 360]]
compliance_urad_per_Nm: [11, 12, 13, 21, 22, 23]
"""
SIX_AFTER_FIVE = """\
name: 6DoF after 5DoF
stages:
  - {points: [5DoF], joints: [1, 2, 3, 4, 5]}
  - {points: [6DoF], joints: [6], held: [1, 2, 3, 4, 5]}
"""
pytestmark = pytest.mark.slow
TABLE4 = "reports/tables/table4.csv"


def table(study, name):
    return pd.read_csv(study.path(name))


def add(study, name, text):
    study.path(name).write_text(text, encoding="utf-8")


def test_another_robot_strategy_and_noise_level_make_a_study_of_their_own(unstarted):
    """A robot and points that the paper knows nothing of, without any of its robots,
    through every table and figure."""
    add(unstarted, "config/robots/ur10.yaml", UR10)
    add(unstarted, "config/strategies/6DoF-after-5DoF.yaml", SIX_AFTER_FIVE)
    unstarted.configure(
        {
            "robots": ["ur10"],
            "strategies": ["6DoF", "6DoF-after-5DoF"],
            "noise_um": [12.5, 200],
        }
    )
    unstarted.run("paper", "study")
    assert set(table(unstarted, "reports/tables/table1.csv").robot) == {"ur10"}
    table4 = table(unstarted, TABLE4)
    assert set(zip(table4.robot, table4.strategy, strict=True)) == {
        ("ur10", "6DoF"),
        ("ur10", "6DoF after 5DoF"),
    }
    assert unstarted.path(
        "results/identified/ur10/12.5um/6DoF-after-5DoF.parquet"
    ).exists()
    assert unstarted.path("reports/study.pdf").exists()


# Beside each switch, the first step whose results it changes: the steps before it have
# nothing to do.
SWITCHES = {
    "joint_range limits": (
        {"interpretations": {"joint_range": "limits"}},
        "draw_experiments",
    ),
    "offset_frame tool": (
        {"interpretations": {"offset_frame": "tool"}},
        "draw_experiments",
    ),
    "tool offset": (
        {"interpretations": {"tool_offset_m": [0.1, 0.05, 0.02]}},
        "simulate",
    ),
    "wrench_at measuring_point": (
        {"interpretations": {"wrench_at": "measuring_point"}},
        "simulate",
    ),
    "position with tool offset": (
        {
            "interpretations": {
                "measured": "position",
                "tool_offset_m": [0.1, 0.05, 0.02],
            }
        },
        "simulate",
    ),
    "average compliance": ({"interpretations": {"average": "compliance"}}, "identify"),
}
STEPS = ["draw_experiments", "simulate", "measure", "identify", "tabulate_strategies"]


@pytest.mark.parametrize("switch", SWITCHES)
def test_a_switch_runs_and_changes_the_results(switch, paper, tmp_path):
    """Where the wrench acts is a question of partial points alone."""
    changes, first = SWITCHES[switch]
    study = paper.copied_to(tmp_path / "study")
    study.configure(changes)
    ran = study.run(TABLE4).stderr
    for step in STEPS:
        assert bool(re.search(rf": {step}\b", ran)) == (
            STEPS.index(step) >= STEPS.index(first)
        ), step
    before = table(paper, TABLE4)
    after = table(study, TABLE4)
    assert list(before.columns) == list(after.columns)
    assert (before.strategy == after.strategy).all()
    measure = "k_sigma_20_percent"
    assert np.isfinite(after[measure]).all()
    changed = set(before.strategy[before[measure] != after[measure]])
    assert changed == (
        {"4-6DoF after 3DoF"}
        if "wrench_at" in switch
        else {"6DoF", "4-6DoF after 3DoF"}
    )
