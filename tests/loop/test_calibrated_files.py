"""The calibrated robot comes from the tables of a diagnosis as it was fitted, and only while the campaign is as it was."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest
from diagnosed_folders import diagnosed_folder
from support import refused

from elastocal.application.calibrated import calibrated_from
from elastocal.io.checksums import record_checksums
from elastocal.io.json_files import read_json
from elastocal.io.storage import read_table
from elastocal.loop.calibrated_files import load_diagnosed
from elastocal.loop.diagnosis_tables import diagnosis_from
from elastocal.loop.schemas import STEPS


@pytest.fixture(scope="module")
def made(kuka, config_folder, tmp_path_factory):
    return diagnosed_folder(tmp_path_factory.mktemp("calibrated"), kuka, config_folder / "robots")


def test_the_robot_is_that_of_the_final_fit(made, config_folder):
    folder, results = made
    found = load_diagnosed(folder, config_folder / "robots", results)
    tables = results / "made"
    steps = read_table(tables / "steps.parquet", STEPS)
    again = diagnosis_from(found.case, read_json(tables / "diagnosis.json"), steps)
    expected = calibrated_from(again.final, found.case.campaign.robot)
    assert [e.key for e in found.calibrated.model.effects] == ["joint_compliance", "joint_offset@3"]
    for mine, theirs in zip(found.calibrated.estimate.coefficients, expected.estimate.coefficients, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-6)
    np.testing.assert_allclose(found.calibrated.covariance, expected.covariance, rtol=1e-3)
    assert (found.calibrated.noise.joint_rad >= expected.noise.joint_rad).all()
    assert found.calibrated.scope.frame == ("robot" if found.case.model.fitted_frames else "base")
    assert found.verdict["campaign"] == found.name == "made"


def test_the_folder_may_have_moved(made, config_folder, tmp_path):
    folder, results = made
    shutil.copytree(folder, tmp_path / "elsewhere")
    assert load_diagnosed(tmp_path / "elsewhere", config_folder / "robots", results).name == "made"


def another_seed(folder):
    path = folder / "campaign.yaml"
    path.write_text(path.read_text().replace("seed: 1", "seed: 2"))


def moved_row(row):
    def change(folder):
        table = pd.read_csv(folder / "measurements.csv")
        table.loc[row, "x"] += 1e-9
        table.to_csv(folder / "measurements.csv", index=False)

    return change


@pytest.mark.parametrize("change", [another_seed, *(moved_row(row) for row in range(0, 60, 12))])
def test_a_campaign_that_has_changed_since_is_refused_be_it_in_a_held_out_row(made, config_folder, tmp_path, change):
    folder, results = made
    shutil.copytree(folder, tmp_path / "changed")
    change(tmp_path / "changed")
    with refused((tmp_path / "changed").as_posix(), "", "changes since its diagnosis", "elastocal diagnose"):
        load_diagnosed(tmp_path / "changed", config_folder / "robots", results)


def test_a_campaign_that_was_never_diagnosed_is_refused(made, config_folder, tmp_path):
    with refused(made[0].as_posix(), "", "no diagnosis of it in ", tmp_path.as_posix(), "elastocal diagnose"):
        load_diagnosed(made[0], config_folder / "robots", tmp_path)


def test_a_file_of_the_diagnosis_that_was_altered_is_refused(made, config_folder, tmp_path, monkeypatch):
    """Where the pipeline has them, in results/loop; a number of diagnosis.json alone would move every target."""
    folder, results = made
    shutil.copytree(results / "made", tmp_path / "results/loop/made")
    monkeypatch.chdir(tmp_path)
    record_checksums(path.relative_to(tmp_path).as_posix() for path in (tmp_path / "results/loop/made").iterdir())
    assert load_diagnosed(folder, config_folder / "robots", "results/loop").name == "made"
    diagnosis = tmp_path / "results/loop/made/diagnosis.json"
    text = diagnosis.read_text(encoding="utf-8")
    place = re.search(r"\.\d*(\d)", text).start(1)
    diagnosis.write_text(text[:place] + str((int(text[place]) + 1) % 10) + text[place + 1 :], encoding="utf-8")
    monkeypatch.chdir(tmp_path.parent)
    with refused(diagnosis, "", "other contents than were written"):
        load_diagnosed(folder, config_folder / "robots", tmp_path / "results/loop")
