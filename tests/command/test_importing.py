"""Robot files from URDF and from DH tables, as they are typed."""

import pytest
import yaml
from made_urdf import joint, link, written

from elastocal.campaigns.reading import read_robot

PLAIN = "d_m,a_m,alpha_deg\n0,1,0\n"
ARM = (link("base"), link("arm", 2.0), link("hand"), joint("j1", "base", "arm", xyz=(0, 0, 0.5)), joint("j2", "arm", "hand"))


@pytest.fixture
def output(tmp_path):
    return tmp_path / "robot.yaml"


def of_table(output, text, *more):
    (output.parent / "arm.csv").write_text(text)
    return "import", "dh", output.parent / "arm.csv", "-o", output, *more


def of_urdf(output, *more, parts=ARM):
    return "import", "urdf", written(output.parent, *parts), "--base", "base", "--tip", "hand", "-o", output, *more


def test_a_table_becomes_a_robot_file_in_the_units_and_the_notation_asked_for(elastocal, output):
    units = "--angles", "rad", "--lengths", "mm", "--modified", "--name", "arm 1"
    result = elastocal(*of_table(output, "d,a,alpha\n100,400,pi/2\n", *units))
    assert result.exit_code == 0 and "arm 1: 1 joint," in result.output and "written:" in result.output
    text = output.read_text()
    assert "Tx(0.4) Rx(90deg) Rz(q1) Tz(0.1) [flange]" in text and "modified" in text.splitlines()[0]
    assert read_robot(output).name == "arm 1"


def test_a_urdf_becomes_a_robot_file_and_is_told(elastocal, output):
    result = elastocal(*of_urdf(output, "--point", "arm", "--mass-std", "0.4"))
    assert result.exit_code == 0
    assert "2 joints" in result.output and "no compliances" in result.output and f"written: {output}" in result.output
    robot = read_robot(output)
    assert [point.name for point in robot.chain.points] == ["arm", "hand"] and robot.masses[0].relative_std == 0.4
    assert yaml.safe_load(output.read_text())["joint_names"] == ["j1", "j2"]


@pytest.mark.parametrize("words", [lambda output: of_table(output, PLAIN), of_urdf], ids=["dh", "urdf"])
def test_a_file_that_is_there_stays_unless_forced(elastocal, refusal, output, words):
    output.write_text("mine")
    assert "--force" in refusal(*words(output)) and output.read_text() == "mine"
    assert elastocal(*words(output), "--force").exit_code == 0 and read_robot(output)


def test_nothing_is_written_of_what_is_refused(refusal, output):
    assert "tip" in refusal(*of_urdf(output, parts=(*ARM[:2], ARM[3]))) and not output.exists()
