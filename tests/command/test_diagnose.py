"""The subcommand hands a campaign to its Snakemake target and shows what that says."""

import pytest

from elastocal.command import diagnose


@pytest.fixture
def run(elastocal, tmp_path, monkeypatch):
    """Diagnose a campaign with a pipeline and in a workplace; what is called, and the exit code of that."""

    def called(pipeline, code=0, prints=""):
        # In place of Python: shows its arguments and where it runs.
        stand_in = tmp_path / "python"
        stand_in.write_text(f'#!/bin/sh\necho "$PWD" "$@"\necho "{prints}"\nexit {code}\n')
        stand_in.chmod(0o755)
        monkeypatch.setattr(diagnose.sys, "executable", str(stand_in))
        monkeypatch.setattr(diagnose, "pipeline", lambda: pipeline)
        monkeypatch.setattr(diagnose, "workplace", lambda: tmp_path)
        return elastocal("diagnose", tmp_path / "cell7", "-j", 1)

    return called


@pytest.mark.parametrize("code", [0, 3])
def test_the_target_of_the_campaign_runs_in_the_checkout_and_its_exit_code_counts(tmp_path, run, code):
    result = run(tmp_path, code)
    assert result.exit_code == code
    assert result.stderr.strip() == f"{tmp_path} -m snakemake -j1 diagnose --config campaign={tmp_path}/cell7"


def test_without_a_checkout_the_installed_pipeline_runs_in_the_working_directory(tmp_path, run):
    shown = run(tmp_path / "installed").stderr.strip()
    assert shown.startswith(f"{tmp_path} -m snakemake -j1 diagnose --config campaign={tmp_path}/cell7")
    assert shown.endswith(f" --snakefile {tmp_path}/installed/Snakefile")


def test_lines_of_a_run_are_printed_as_they_are_but_for_the_profile(run, tmp_path):
    shown = run(tmp_path, prints="1 of 3: read_campaign [bold]\nUsing workflow specific profile x").stderr
    assert "1 of 3: read_campaign [bold]\n" in shown and "profile" not in shown


def test_where_everything_is_up_to_date_the_outcome_is_printed_again(monkeypatch, run, tmp_path):
    monkeypatch.setattr(diagnose, "_outcome", lambda folder, place: [f"the outcome of {folder.name}"])
    assert "the outcome of cell7" not in run(tmp_path).stderr
    assert run(tmp_path, prints="Nothing to be done (all requested files are present and up to date).").stderr.endswith(
        "the outcome of cell7\n"
    )


@pytest.mark.parametrize("mark", ["{x}", ": ", " #", "\n", "\x1b", "\u202e"])
def test_a_path_that_snakemake_takes_for_something_else_is_refused(refusal, tmp_path, mark):
    assert "a path without it" in refusal("diagnose", f"{tmp_path}/a{mark}b")
