"""Where the pipeline and its results are: in a checkout, beside an installed package, nowhere; by which libraries."""

from importlib import metadata
from importlib.metadata import PackageNotFoundError, PathDistribution

import pytest
from analysed_robots import ROBOTS
from certified import record_jobs

from elastocal.campaigns.reading import campaign_files
from elastocal.command import pipeline as module
from elastocal.command.pipeline import diagnosed_campaign, pipeline, robots, workplace
from elastocal.errors import InputError
from elastocal.io.origin import environment


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The package in a folder of no checkout, with the record of a wheel; the folder of its pipeline."""
    monkeypatch.setattr(module, "__file__", str(tmp_path / "lib" / "elastocal" / "command" / "pipeline.py"))
    monkeypatch.setattr(metadata, "distribution", lambda name: PathDistribution(tmp_path / "lib" / f"{name}-1.dist-info"))
    (tmp_path / "lib" / "elastocal-1.dist-info").mkdir(parents=True)
    record = "elastocal/__init__.py,,\n../share/elastocal/Snakefile,,\n"
    (tmp_path / "lib" / "elastocal-1.dist-info" / "RECORD").write_text(record)
    found = tmp_path / "share" / "elastocal"
    found.mkdir(parents=True)
    (found / "Snakefile").write_text("")
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path / "mine")
    return found


def test_a_checkout_above_the_working_directory_is_found_before_that_of_the_package(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert (pipeline() / "src" / "elastocal").is_dir() and workplace() == pipeline()
    for folder in ("config/robots", "campaigns/cell7"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "Snakefile").write_text("")
    monkeypatch.chdir(tmp_path / "campaigns" / "cell7")
    assert pipeline() == workplace() == tmp_path and robots() == tmp_path / "config" / "robots"


def test_an_installed_package_has_its_pipeline_and_the_results_are_in_the_working_directory(installed, tmp_path, monkeypatch):
    assert pipeline() == installed and workplace() == tmp_path / "mine"
    (installed / "Snakefile").unlink()
    with pytest.raises(InputError, match="no Snakefile here or above"):
        pipeline()

    def not_installed(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", not_installed)
    with pytest.raises(InputError, match="no Snakefile here or above"):
        pipeline()


def test_results_of_another_environment_come_with_a_warning(in_checkout, capsys):
    assert diagnosed_campaign(in_checkout / "made").name == "made" and not capsys.readouterr().err
    record_jobs("made", campaign_files("made", ROBOTS), environment(".") | {"numpy": "1.0"})
    assert diagnosed_campaign(in_checkout / "made").name == "made"
    here = environment(".")["numpy"]
    assert capsys.readouterr().err == (f"warning: {in_checkout}/made was diagnosed with numpy 1.0; here are numpy {here}\n")
