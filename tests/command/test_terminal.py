"""Quantities need their unit, printed lines do not steer a terminal, and the folders of
the pipeline and of its results are found."""

import io
from importlib import metadata
from importlib.metadata import PathDistribution

import pytest
from analysed_robots import ROBOTS
from certified import record_jobs
from rich.console import Console
from support import refused

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.command import terminal
from elastocal.command.terminal import (
    find_pipeline,
    find_robots_folder,
    find_workplace,
    load_diagnosed_campaign,
    parse_angle_rad,
    parse_length_m,
    print_answer,
    print_lines,
)
from elastocal.errors import InputError
from elastocal.io.origin import list_versions


@pytest.mark.parametrize(
    ("parse", "text", "value"),
    [
        (parse_length_m, "0.2mm", 2e-4),
        (parse_length_m, "60um", 6e-5),
        (parse_length_m, "60 µm", 6e-5),
        (parse_length_m, ".5mm", 5e-4),
        (parse_length_m, "0.01m", 0.01),
        (parse_angle_rad, "0.01deg", 1.745329e-4),
        (parse_angle_rad, "0.1mrad", 1e-4),
        (parse_angle_rad, "60 µrad", 6e-5),
        (parse_angle_rad, ".001rad", 1e-3),
    ],
)
def test_a_quantity_is_read_with_its_unit(parse, text, value):
    assert parse("--noise", text) == pytest.approx(value)


@pytest.mark.parametrize("parse", [parse_length_m, parse_angle_rad])
@pytest.mark.parametrize(
    "text",
    [
        "0.2",
        "0mm",
        "-1mm",
        "200mm",
        "mm",
        "1e3mm",
        "nan mm",
        "0.000000000001mm",
        "90deg",
        "1",
    ],
)
def test_a_quantity_without_a_unit_or_of_an_impossible_size_is_refused(parse, text):
    with refused("--tolerance", "", "with its unit"):
        parse("--tolerance", text)


def test_lines_are_printed_as_they_are_except_for_control_characters():
    console = Console(file=io.StringIO())
    print_lines(["    [bold] a\x1b[2Jb\u202ec 4.00\u00a0mm"], console)
    assert console.file.getvalue() == "    [bold] a\\x1b[2Jb\\u202ec 4.00\u00a0mm\n"


def test_an_answer_has_its_mark_and_its_warnings_stand_out():
    console = Console(file=io.StringIO())
    print_answer("pass", ["detail", "! warning"], "", console)
    print_answer("fail", [], "measure", console, passed=False)
    lines = console.file.getvalue().splitlines()
    assert lines == ["✓ pass", "  detail", "! warning", "! fail", "next: measure"]


def test_an_installed_package_has_its_pipeline_and_results_in_the_working_directory(
    tmp_path, monkeypatch
):
    """The package is in a folder without a checkout, with the record of a wheel."""
    library = tmp_path / "lib"
    module = library / "elastocal" / "command" / "terminal.py"
    monkeypatch.setattr(terminal, "__file__", str(module))
    monkeypatch.setattr(
        metadata,
        "distribution",
        lambda name: PathDistribution(library / f"{name}-1.dist-info"),
    )
    (library / "elastocal-1.dist-info").mkdir(parents=True)
    record = "elastocal/__init__.py,,\n../share/elastocal/Snakefile,,\n"
    (library / "elastocal-1.dist-info" / "RECORD").write_text(record)
    installed = tmp_path / "share" / "elastocal"
    installed.mkdir(parents=True)
    (installed / "Snakefile").write_text("")
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path / "mine")
    assert find_pipeline() == installed and find_workplace() == tmp_path / "mine"
    (installed / "Snakefile").unlink()
    with pytest.raises(InputError, match="no Snakefile here or above"):
        find_pipeline()


def test_a_checkout_above_the_working_directory_is_preferred_to_that_of_the_package(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert (find_pipeline() / "src" / "elastocal").is_dir()
    assert find_workplace() == find_pipeline()
    for folder in ("config/robots", "campaigns/cell7"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "Snakefile").write_text("")
    monkeypatch.chdir(tmp_path / "campaigns" / "cell7")
    assert find_pipeline() == find_workplace() == tmp_path
    assert find_robots_folder() == tmp_path / "config" / "robots"


def test_results_of_another_environment_come_with_a_warning(in_checkout, capsys):
    folder = in_checkout / "made"
    assert load_diagnosed_campaign(folder).name == "made"
    assert not capsys.readouterr().err
    files = read_campaign_folder("made", ROBOTS).files()
    record_jobs("made", files, list_versions(".") | {"numpy": "1.0"})
    assert load_diagnosed_campaign(folder).name == "made"
    version = list_versions(".")["numpy"]
    assert capsys.readouterr().err == (
        f"warning: {folder} was diagnosed with numpy 1.0; here are numpy {version}\n"
    )
