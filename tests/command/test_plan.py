"""A plan as a campaign to fill in, and what is refused before any planning."""

import numpy as np
import pandas as pd
import pytest
import yaml
from analysed_robots import ROBOTS, analysed

from elastocal.application.calibrated import compute_nominal_poses

PLAN = (
    "plan",
    ROBOTS / "ur10.yaml",
    "--candidates",
    300,
    "--poses",
    18,
    "--held-out",
    4,
)


@pytest.fixture
def planned(elastocal, tmp_path):
    """What a plan prints, its campaign.yaml, and its sheet."""

    def run(*words):
        result = elastocal(*PLAN, "--folder", tmp_path / "cell", *words)
        assert result.exit_code == 0, result.exception
        document = yaml.safe_load((tmp_path / "cell" / "campaign.yaml").read_text())
        return (
            result.stderr,
            document,
            pd.read_csv(tmp_path / "cell" / "measurements.csv"),
        )

    return run


def heights(table):
    """Of the end effector over the base plane at each row of a plan, m."""
    robot = analysed("ur10")
    return compute_nominal_poses(
        robot, table[[f"q{joint}" for joint in range(1, 7)]].to_numpy()
    )[0][:, 2]


def test_a_plan_is_a_folder_to_fill_in_with_its_pages(
    planned, elastocal, refusal, tmp_path
):
    words = (
        "--force",
        80,
        "--pull",
        "--tracker",
        "3,1,1",
        "--box=-3,3,-3,3,-2,-0.5",
        "--base-known",
    )
    shown, document, sheet = planned(*words, "--target", "6DoF=0,0,0")
    assert (
        "18 poses to fit and 4 held out" in shown and "next: measure, fill in" in shown
    )
    assert {p.name for p in (tmp_path / "cell").iterdir()} == {
        *("campaign.yaml", "robot.yaml", "measurements.csv", "plan.pdf", "plan.png")
    }
    assert (
        document["holdout"] == {"poses": [19, 20, 21, 22]}
        and document["frame"] == "base"
    )
    assert set(sheet["load"]) == {0, 1, 2} and heights(sheet).min() > 0.0
    assert "found nothing" in refusal("check", tmp_path / "cell")
    assert "a folder that is there" in refusal(*PLAN, "--folder", tmp_path)
    # Once it is filled in it can be checked.
    at = compute_nominal_poses(
        analysed("ur10"), sheet[[f"q{joint}" for joint in range(1, 7)]].to_numpy()
    )[0]
    at += 3e-5 * np.random.default_rng(1).standard_normal(at.shape)
    filled = sheet.assign(done="x", **dict(zip("xyz", at.T, strict=True)))
    filled.to_csv(tmp_path / "cell" / "measurements.csv", index=False)
    assert elastocal("check", tmp_path / "cell").exit_code == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--box", "1,0,0,1,0,1"], "--box"),
        (["--tracker", "1,2"], "--tracker"),
        (["--noise", "0.03"], "--noise"),
        (["--target", "elbow"], "--target"),
        (["--target", "A:6DoF", "--target", "A:4DoF"], "'A' twice"),
        (
            [
                "--target",
                "6DoF=0.1,0,0",
                "--target",
                "6DoF=0,0.1,0",
                "--target",
                "6DoF",
            ],
            "A:6DoF and B:6DoF",
        ),
        (["--target", f"{'A' * 81}:6DoF"], "a name of 81"),
        (["--target", "=A:6DoF"], "--target"),
        (["--orientation-noise", "0.01deg"], "--measured pose"),
        (["--measured", "pose", "--orientation-noise", "0.01"], "with its unit"),
        (["--box=-9,9,-9,9,-9,9"], "boxes"),
        (["--floor", "9"], "--floor"),
    ],
)
def test_a_wrong_option_is_refused_by_its_name_and_nothing_is_written(
    refusal, tmp_path, words, message
):
    assert message in refusal(*PLAN, "--folder", tmp_path / "cell", *words)
    assert list(tmp_path.iterdir()) == []


def test_three_reflectors_on_one_flange_are_three_targets_of_a_probe(planned):
    words = [
        word
        for name in "ABC"
        for word in ("--target", f"{name}:6DoF=0.{ord(name) - 64},0,0")
    ]
    shown, document, sheet = planned(
        "--measured", "pose", *words, "--target", "6DoF", "--noise", "50um"
    )
    assert "50 µm, 87.3 µrad" in shown and "Leica" in shown
    assert {
        name: target["offset_m"] for name, target in document["targets"].items()
    } == {
        **{
            "A": [0.1, 0.0, 0.0],
            "B": [0.2, 0.0, 0.0],
            "C": [0.3, 0.0, 0.0],
            "6DoF": "unknown",
        }
    }
    assert document["measured"] == "pose"
    assert document["noise"] == {
        "position_m": pytest.approx(50e-6),
        "orientation_rad": pytest.approx(np.radians(0.005)),
    }
    assert set(sheet["target"].value_counts()) == {len(sheet) // 4} and set(
        sheet["target"]
    ) == {"A", "B", "C", "6DoF"}
