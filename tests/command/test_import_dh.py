import pytest
from typer.testing import CliRunner

from elastocal.campaigns.reading import read_robot
from elastocal.command.main import app
from elastocal.errors import InputError


def run(folder, text, *more):
    (folder / "arm.csv").write_text(text)
    words = ["import", "dh", str(folder / "arm.csv"), "-o", str(folder / "robot.yaml"), *more]
    return CliRunner().invoke(app, words)


def test_a_table_becomes_a_robot_file_in_the_units_and_the_notation_asked_for(tmp_path):
    result = run(tmp_path, "d,a,alpha\n100,400,pi/2\n", "--angles", "rad", "--lengths", "mm", "--modified", "--name", "arm 1")
    assert result.exit_code == 0 and "arm 1: 1 joint," in result.output and "written:" in result.output
    text = (tmp_path / "robot.yaml").read_text()
    assert "Tx(0.4) Rx(90deg) Rz(q1) Tz(0.1) [flange]" in text and "modified" in text.splitlines()[0]
    assert read_robot(tmp_path / "robot.yaml").name == "arm 1"


def test_a_file_that_is_there_stays_unless_forced(tmp_path):
    (tmp_path / "robot.yaml").write_text("mine")
    result = run(tmp_path, "d_m,a_m,alpha_deg\n0,1,0\n")
    assert isinstance(result.exception, InputError) and "--force" in str(result.exception)
    assert (tmp_path / "robot.yaml").read_text() == "mine"
    assert run(tmp_path, "d_m,a_m,alpha_deg\n0,1,0\n", "--force").exit_code == 0


@pytest.mark.parametrize("option", [("--angles", "gon"), ("--lengths", "inch")])
def test_other_units_are_no_options(tmp_path, option):
    assert run(tmp_path, "d_m,a_m,alpha_deg\n0,1,0\n", *option).exit_code == 2


def test_decimal_commas_are_stated(tmp_path):
    text = "d_m;a_m;alpha_deg\n0;1,5;0\n"
    assert "--decimal comma" in str(run(tmp_path, text).exception)
    assert run(tmp_path, text, "--decimal", "comma").exit_code == 0
    assert "Tx(1.5)" in (tmp_path / "robot.yaml").read_text()


def test_the_help_shows_a_row():
    assert "0.1625" in CliRunner().invoke(app, ["import", "dh", "--help"]).output
