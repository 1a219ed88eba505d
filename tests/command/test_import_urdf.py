import yaml
from made_urdf import joint, link, written
from typer.testing import CliRunner

from elastocal.campaigns.reading import read_robot
from elastocal.command.main import app
from elastocal.errors import InputError

ARM = (link("base"), link("arm", 2.0), link("hand"), joint("j1", "base", "arm", xyz=(0, 0, 0.5)), joint("j2", "arm", "hand"))


def run(path, output, *more):
    return CliRunner().invoke(app, ["import", "urdf", str(path), "--base", "base", "--tip", "hand", "-o", str(output), *more])


def test_a_urdf_becomes_a_robot_file_and_is_told(tmp_path):
    path, output = written(tmp_path, *ARM), tmp_path / "robot.yaml"
    result = run(path, output, "--point", "arm", "--mass-std", "0.4")
    assert result.exit_code == 0
    assert "2 joints" in result.output and "no compliances" in result.output and f"written: {output}" in result.output
    robot = read_robot(output)
    assert [point.name for point in robot.chain.points] == ["arm", "hand"] and robot.masses[0].relative_std == 0.4


def test_a_file_that_is_there_stays_unless_forced(tmp_path):
    path, output = written(tmp_path, *ARM), tmp_path / "robot.yaml"
    output.write_text("mine")
    result = run(path, output)
    assert isinstance(result.exception, InputError) and "--force" in str(result.exception) and output.read_text() == "mine"
    assert run(path, output, "--force").exit_code == 0
    assert yaml.safe_load(output.read_text())["joint_names"] == ["j1", "j2"]


def test_nothing_is_written_of_what_is_refused(tmp_path):
    result = run(written(tmp_path, *ARM[:2], ARM[3]), tmp_path / "robot.yaml")
    assert isinstance(result.exception, InputError) and "tip" in str(result.exception)
    assert not (tmp_path / "robot.yaml").exists()
