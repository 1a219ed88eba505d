"""What a user sees of a campaign, and the exit code."""

import json

import numpy as np
import pytest
from analysed_robots import analysed
from made_folders import made_folder, made_table
from typer.testing import CliRunner

from elastocal.command.check import lines
from elastocal.command.main import app
from elastocal.errors import InputError


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return made_folder(tmp_path_factory.mktemp("check") / "made", analysed("kuka"))


def run(*words):
    return CliRunner().invoke(app, ["check", *map(str, words)])


def test_headings_say_what_was_read_identified_and_testable(folder):
    result = run(folder)
    assert result.exit_code == 0, result.output
    for words in ("read", "validation poses", "noise", "compliance", "testable", "suspicious", "diagnosable"):
        assert words in result.output


def test_json_is_all_of_it(folder):
    result = run(folder, "--json")
    assert json.loads(result.stdout)["campaign"] == "made"


@pytest.mark.parametrize(
    ("loads", "force", "words"),
    [
        ([0, 1, 2], 1000.0, "unloaded and 2 loads of up to 1000 N; "),
        ([7], 150.4, "1 load of up to 150 N; "),
        ([0], 0.0, "unloaded; "),
    ],
)
def test_loads_are_counted_for_their_numbers_are_labels(folder, loads, force, words):
    facts = json.loads(run(folder, "--json").stdout) | {"loads": loads, "largest_force_N": force}
    read = [each for _, each in lines(facts)][:3]
    assert read[2].startswith(words)


def test_faults_of_the_data_end_in_exit_code_one(tmp_path):
    table = made_table(analysed("kuka"), "made")
    table["q3"] = -table["q3"]
    result = run(made_folder(tmp_path / "made", analysed("kuka"), table=table))
    assert result.exit_code == 1
    assert "the data are at fault" in result.output


def test_a_sheet_that_is_not_filled_in_is_refused_with_its_row(tmp_path):
    table = {name: values.astype(object) for name, values in made_table(analysed("kuka"), "made").items()}
    table["x"][3] = ""
    result = run(made_folder(tmp_path / "made", analysed("kuka"), table={k: np.asarray(v) for k, v in table.items()}))
    assert isinstance(result.exception, InputError)
    assert "row 4, column x (line 5): found nothing" in str(result.exception)
