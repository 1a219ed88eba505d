"""What a user sees of a campaign, and the exit code."""

import numpy as np
import pytest
from analysed_robots import analysed
from made_folders import made_folder, made_table


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return made_folder(tmp_path_factory.mktemp("check") / "made", analysed("kuka"))


def test_headings_say_what_was_read_identified_and_testable(elastocal, folder):
    result = elastocal("check", folder)
    assert result.exit_code == 0, result.output
    answer, *rest = result.output.splitlines()
    assert answer.startswith("✓ made can be diagnosed: ")
    for words in ("read", "validation poses", "noise", "compliance", "testable"):
        assert any(line.startswith(f"  {words}") or words in line for line in rest), words
    assert any(line.startswith("! ") for line in rest)
    assert "not determined by these poses: joint 6" in result.output
    assert rest[-1] == f"next: elastocal diagnose {folder}"


def test_faults_of_the_data_end_in_exit_code_one(elastocal, tmp_path):
    table = made_table(analysed("kuka"), "made")
    table["q3"] = -table["q3"]
    result = elastocal("check", made_folder(tmp_path / "made", analysed("kuka"), table=table))
    assert result.exit_code == 1
    assert result.output.startswith("! made cannot be diagnosed: the data are at fault")
    assert "next: mend the data" in result.output


def test_a_sheet_that_is_not_filled_in_is_refused_with_its_row(refusal, tmp_path):
    table = {name: values.astype(object) for name, values in made_table(analysed("kuka"), "made").items()}
    table["x"][3] = ""
    folder = made_folder(tmp_path / "made", analysed("kuka"), table={k: np.asarray(v) for k, v in table.items()})
    assert "row 4, column x (line 5): found nothing" in refusal("check", folder)
