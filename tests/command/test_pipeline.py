"""Where the pipeline and its results are: in a checkout, beside an installed package, nowhere."""

from importlib import metadata
from importlib.metadata import PackageNotFoundError, PathDistribution

import pytest

from elastocal.command import pipeline as module
from elastocal.command.pipeline import pipeline, workplace
from elastocal.errors import InputError


@pytest.fixture
def made(tmp_path):
    """What a checkout is recognized by."""
    (tmp_path / "config" / "robots").mkdir(parents=True)
    (tmp_path / "Snakefile").write_text("")
    (tmp_path / "campaigns" / "cell7").mkdir(parents=True)
    return tmp_path


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


def test_a_checkout_above_the_working_directory_is_found(made, monkeypatch):
    monkeypatch.chdir(made / "campaigns" / "cell7")
    assert pipeline() == workplace() == made


def test_without_a_checkout_here_the_one_of_the_package_is_used(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert (pipeline() / "src" / "elastocal").is_dir()
    assert workplace() == pipeline()


def test_an_installed_package_has_its_pipeline_and_the_results_are_in_the_working_directory(installed, tmp_path):
    assert pipeline() == installed
    assert workplace() == tmp_path / "mine"


def test_a_package_without_a_pipeline_is_refused_in_one_line(installed, monkeypatch):
    (installed / "Snakefile").unlink()
    with pytest.raises(InputError, match="no Snakefile here or above"):
        pipeline()

    def not_installed(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", not_installed)
    with pytest.raises(InputError, match="no Snakefile here or above"):
        pipeline()
