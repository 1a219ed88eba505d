from typer.testing import CliRunner

from elastocal.campaigns.reading import read_descriptions
from elastocal.command.main import app
from elastocal.errors import InputError


def run(*words):
    return CliRunner().invoke(app, ["init", *map(str, words)])


def test_a_new_folder_is_a_campaign_that_lacks_measurements(tmp_path):
    result = run(tmp_path / "cell")
    assert result.exit_code == 0 and "template" in result.output
    assert {path.name for path in (tmp_path / "cell").iterdir()} == {"campaign.yaml", "robot.yaml", "measurements.csv"}
    document, robot = read_descriptions(tmp_path / "cell", tmp_path)
    assert document["campaign"] == "cell" and robot == tmp_path / "cell" / "robot.yaml"


def test_what_is_there_stays(tmp_path):
    (tmp_path / "measurements.csv").write_text("mine")
    (tmp_path / "robot.yaml").write_text("name: arm\nchain: Rz(q1) Tx(1.0) [tip]\n")
    result = run(tmp_path)
    assert result.exit_code == 0 and "template" not in result.output
    assert (tmp_path / "measurements.csv").read_text() == "mine"
    assert "point: tip" in (tmp_path / "campaign.yaml").read_text()
    assert isinstance(run(tmp_path).exception, InputError)


def test_a_robot_that_cannot_be_read_leaves_nothing_behind(tmp_path):
    (tmp_path / "arm.yaml").write_text("name: arm\n")
    assert isinstance(run(tmp_path / "cell", "--robot", tmp_path / "arm.yaml").exception, InputError)
    assert isinstance(run(tmp_path / "cell", "--robot", tmp_path / "none.yaml").exception, InputError)
    (tmp_path / "latin.yaml").write_bytes(b"name: \xe9\n")
    assert isinstance(run(tmp_path / "cell", "--robot", tmp_path / "latin.yaml").exception, InputError)
    assert not (tmp_path / "cell").exists()
