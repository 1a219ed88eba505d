"""Robot files from URDF and from DH tables, and another program's table as
measurements.csv, as they are typed."""

import pytest
import yaml
from made_urdf import joint, link, written

from elastocal.campaigns.reading import read_robot

ARM = (
    link("base"),
    link("arm", 2.0),
    link("hand"),
    joint("j1", "base", "arm", xyz=(0, 0, 0.5)),
    joint("j2", "arm", "hand"),
)


def test_a_table_becomes_a_robot_file_in_the_units_and_the_notation_asked_for(
    elastocal, tmp_path
):
    (tmp_path / "arm.csv").write_text("d,a,alpha\n100,400,1.5707963267948966\n")
    units = "--angles", "rad", "--lengths", "mm", "--modified", "--name", "arm 1"
    result = elastocal(
        "import", "dh", tmp_path / "arm.csv", "-o", tmp_path / "robot.yaml", *units
    )
    assert (
        result.exit_code == 0
        and "arm 1: 1 joint," in result.output
        and "written:" in result.output
    )
    text = (tmp_path / "robot.yaml").read_text()
    assert (
        "Tx(0.4) Rx(90deg) Rz(q1) Tz(0.1) [flange]" in text
        and "modified" in text.splitlines()[0]
    )
    assert read_robot(tmp_path / "robot.yaml").name == "arm 1"


def test_a_urdf_becomes_a_robot_file_and_is_told(elastocal, tmp_path):
    words = ("--base", "base", "--tip", "hand", "--point", "arm")
    output = tmp_path / "robot.yaml"
    result = elastocal("import", "urdf", written(tmp_path, *ARM), "-o", output, *words)
    assert result.exit_code == 0
    assert (
        "2 joints" in result.output
        and "no compliances" in result.output
        and f"written: {output}" in result.output
    )
    robot = read_robot(output)
    assert [point.name for point in robot.chain.points] == [
        "arm",
        "hand",
    ] and robot.masses[0].relative_std == 0.2
    assert yaml.safe_load(output.read_text())["joint_names"] == ["j1", "j2"]


TEXT = "J1;X;Y;Z\n90;1000,5;2;3\n-90;1000;2;3\n"
OPTIONS = ("--angles", "deg", "--lengths", "mm", "--target", "smr")


@pytest.fixture
def words(tmp_path):
    """Writes the table and gives the words of its import."""

    def written(*more, text=TEXT):
        (tmp_path / "t.csv").write_text(text)
        return "import", "csv", tmp_path / "t.csv", "--folder", tmp_path / "cell", *more

    return written


def test_a_sheet_without_a_reading_is_filled_and_one_with_a_reading_stays_unless_forced(
    elastocal, refusal, words, tmp_path
):
    (tmp_path / "cell").mkdir()
    sheet = tmp_path / "cell" / "measurements.csv"
    sheet.write_text("pose,load\n")
    assert elastocal(*words(*OPTIONS)).exit_code == 0
    assert (
        "--force" in refusal(*words(*OPTIONS))
        and elastocal(*words(*OPTIONS, "--force")).exit_code == 0
    )
    sheet.write_text(
        "# planned\npose,load,repeat,target,done,q1,x,y,z\n1,0,0,smr,x,0.1,,,\n2,0,0,smr,,0.2,,,1.5\n"
    )
    assert "--force" in refusal(*words(*OPTIONS))
    sheet.write_text(sheet.read_text().replace("1.5", ""))
    result = elastocal(*words(*OPTIONS))
    assert result.exit_code == 0, result.exception
    assert len(sheet.read_text().splitlines()) == 3


def test_every_import_ends_with_what_was_read_how_and_what_was_left_out(
    elastocal, words, tmp_path
):
    text = "lab\n# J1;X;Y;Z;Config;Temp;;\n90;1000,5;2;3;FUT;21 C;;\n-90;1000;2;3;NUT;21 C;;\n;;;;;;;\n# 4 more\n"
    result = elastocal(*words(*OPTIONS, "--ignore", "Config", text=text))
    assert result.exit_code == 0, result.exception
    lines = result.output.splitlines()
    assert lines[0] == "2 measurements of smr at 2 poses, 1 joint"
    assert (
        "file: names of columns in line 2, separator semicolon, decimal comma, encoding utf-8"
        in lines
    )
    assert (
        "read: q1 from 'J1' in deg; x from 'X' in mm; y from 'Y' in mm; z from 'Z' in mm"
        in lines
    )
    assert "not used: Temp, Config" in lines
