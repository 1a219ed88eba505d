"""What CONTRIBUTING.md shows works as it stands there: robot, strategy, effect,
importer, language, one entry each."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support import refused
from synthetic import displacements, make_states

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.importers import find_importer
from elastocal.campaigns.reading import read_campaign, read_robot
from elastocal.effects.conditions import build_conditions
from elastocal.effects.protocol import Effect
from elastocal.exchange.controllers import CONTROLLERS, build_targets, find_axes
from elastocal.io.documents import check_document, read_document
from elastocal.mechanics.sites import build_sites
from elastocal.study.strategies import check_strategy, strategy_from_document

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def examples(heading):
    """The blocks of code below a heading."""
    section = TEXT.split(f"\n## {heading}")[1].split("\n## ")[0]
    return re.findall(r"^```\w+\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)


def example(heading):
    """The one block of code below a heading."""
    (block,) = examples(heading)
    return block


@pytest.fixture
def import_example(tmp_path, monkeypatch):
    """Import a block as a module of its own."""

    def import_block(block):
        path = tmp_path / "shown.py"
        path.write_text(block, encoding="utf-8")
        spec = importlib.util.spec_from_file_location("shown", path)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "shown", module)
        spec.loader.exec_module(module)
        return module

    return import_block


def test_the_robot_is_the_file_that_it_is_said_to_be_without_what_its_comment_is_about(
    config_folder, tmp_path
):
    path = tmp_path / "ur10.yaml"
    path.write_text(example("A robot"), encoding="utf-8")
    shown = read_document(path)
    whole = read_document(config_folder / "robots" / "ur10.yaml")
    assert shown == {
        key: value
        for key, value in whole.items()
        if key not in ("compliance_urad_per_Nm", "payload_kg")
    }
    robot = read_robot(path)
    assert robot.joints == 6 and not robot.compliance_known


def test_the_strategy_is_one_that_the_papers_robots_can_carry_out_and_none_of_theirs(
    tmp_path, robot, strategies
):
    path = tmp_path / "mine.yaml"
    path.write_text(example("A strategy"), encoding="utf-8")
    document = read_document(path)
    check_document(document, "strategy", path)
    strategy = strategy_from_document(document)
    assert strategy.name not in {known.name for known in strategies.values()}
    check_strategy(strategy, robot.chain, path)


def test_the_effect_displaces_each_joint_as_its_formula_says(import_example, kuka):
    effect = import_example(examples("An effect")[0]).hoses
    assert isinstance(effect, Effect) and "k q^3" in effect.doc
    sites = build_sites(kuka)
    states = make_states(6, 5)
    candidates = effect.candidates(sites)
    keys = [candidate.key for candidate in candidates]
    assert keys == [f"hoses@{joint}" for joint in range(1, 7)]
    conditions = build_conditions(sites, kuka.compliance, states)
    (displacement,) = displacements(candidates[2], conditions)
    np.testing.assert_array_equal(displacement[:, 2], states.joint_angles[:, 2] ** 3)
    assert not np.delete(displacement, 2, axis=1).any()


# Tests that go through the catalogue, and those that look for files.
CATALOGUE_TESTS = [
    *("tests/effects", "tests/plant/test_kinds.py", "tests/test_mirrors.py"),
    *("tests/report/test_words.py", "tests/figures/test_effect_signatures.py"),
    *("tests/diagnosis/test_hypotheses.py", "tests/project/test_written_names.py"),
]


@pytest.mark.slow
def test_the_effect_and_its_test_copied_pass_lint_and_all_tests_of_the_catalogue(
    tmp_path,
):
    """As a contributor copies them; nothing else changes."""
    copied = ["src", "tests", "config", "docs", "workflow", "pyproject.toml"]
    for name in [*copied, "CONTRIBUTING.md", "Snakefile", "config.yaml"]:
        source = ROOT / name
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, tmp_path / name)
    module, test = examples("An effect")
    new_files = ["src/elastocal/effects/hoses.py", "tests/effects/test_hoses.py"]
    for name, text in zip(new_files, (module, test), strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    commands = [
        ["ruff", "check", *new_files],
        ["ruff", "format", "--check", *new_files],
        ["mypy", new_files[0]],
        ["pytest", "-q", "-p", "no:cacheprovider", *CATALOGUE_TESTS],
    ]
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "src")}
    for command in commands:
        finished = subprocess.run(
            [sys.executable, "-m", *command],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
        )
        assert finished.returncode == 0, finished.stdout[-3000:] + finished.stderr


def test_the_importer_makes_a_campaign_and_refuses_a_file_of_another_kind(
    config_folder, tmp_path
):
    (tmp_path / "public_data.yaml").write_text(example("An importer"), encoding="utf-8")
    mine = find_importer("mine", tmp_path, "a test")
    robots = config_folder / "robots"
    angles = np.linspace(-90, 90, 12)[:, None] + np.arange(6)
    positions = np.arange(36.0).reshape(12, 3)
    path = tmp_path / "values.csv"
    rows = [
        ";".join(map(str, [*row, *place]))
        for row, place in zip(angles, positions, strict=True)
    ]
    path.write_text(
        "\n".join(["J1;J2;J3;J4;J5;J6;X;Y;Z", *rows]) + "\n", encoding="utf-8"
    )
    mine.write_campaign([path], tmp_path / "mine", robots, "mine")
    folder = read_campaign_folder(tmp_path / "mine", robots)
    measurements = read_campaign(folder).measurements
    np.testing.assert_allclose(np.degrees(measurements.joint_angles), angles, atol=1e-9)
    np.testing.assert_allclose(1e3 * measurements.position, positions, atol=1e-9)
    path.write_text("J1;J2\n1;2\n", encoding="utf-8")
    with refused(path, "", "a table of owner/repository"):
        mine.write_campaign([path], tmp_path / "other", robots, "other")


def test_the_language_writes_targets(import_example):
    language = import_example(example("A controller's language")).LINES
    assert language.name not in CONTROLLERS
    shifts = (True, *6 * (False,))
    targets = build_targets(
        np.array([[0.5, *6 * (np.pi / 6,)]]), shifts, find_axes(language, shifts, "")
    )
    assert language.program("GO", targets) == f"GO\n{6 * '30.000000 '}500.000000\n"
