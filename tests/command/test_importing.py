"""`elastocal import`: robot files from URDF and from DH tables, and the table of another
program as measurements.csv."""

import inspect
import itertools

import numpy as np
import pytest
import yaml
from made_boards import PANDA, make_board_poses
from made_urdf import joint, link, written
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_campaign, read_robot
from elastocal.campaigns.socket_recordings import SOCKET_DISTANCE_M
from elastocal.command import importing

ARM = (
    link("base"),
    link("arm", 2.0),
    link("hand"),
    joint("j1", "base", "arm", xyz=(0, 0, 0.5)),
    joint("j2", "arm", "hand"),
)
TABLE = "J1;X;Y;Z\n90;1000,5;2;3\n-90;1000;2;3\n"
OPTIONS = ("--angles", "deg", "--lengths", "mm", "--target", "smr")


def test_a_dh_table_becomes_a_robot_file_in_its_units_and_its_notation(
    elastocal, tmp_path
):
    table = tmp_path / "arm.csv"
    output = tmp_path / "robot.yaml"
    table.write_text("d,a,alpha\n100,400,1.5707963267948966\n")
    options = ("--angles", "rad", "--lengths", "mm", "--modified", "--name", "arm 1")
    result = elastocal("import", "dh", table, "-o", output, *options)
    assert result.exit_code == 0
    assert "arm 1: 1 joint," in result.output and "written:" in result.output
    text = output.read_text()
    assert "Tx(0.4) Rx(90deg) Rz(q1) Tz(0.1) [flange]" in text
    assert "modified" in text.splitlines()[0]
    assert read_robot(output).name == "arm 1"


def test_two_robot_files_become_one_of_two_arms(elastocal, tmp_path):
    left = tmp_path / "left.yaml"
    right = tmp_path / "right.yaml"
    left.write_text("{name: left, chain: 'Tx(0.3) Rz(q1) Ty(0.5) [hand]'}")
    right.write_text("{name: right, chain: 'Tx(-0.3) Rz(q1) Tz(q2) [tip]', ")
    right.write_text(right.read_text() + "joint_limits_deg: [[-90, 90], [0, 1]]}")
    output = tmp_path / "robot.yaml"
    result = elastocal("import", "arms", left, right, "-o", output)
    assert result.exit_code == 0
    assert "right, seen from left: 3 joints" in result.output
    assert "weights are not modelled" in result.output
    assert "Ty(-0.5) Rz(-q1) Tx(-0.3) Tx(-0.3) Rz(q2) Tz(q3)" in output.read_text()
    assert read_robot(output).base_moves
    refusal = elastocal("import", "arms", right, left, "-o", tmp_path / "other.yaml")
    assert refusal.exit_code == 1
    assert "slides" in str(refusal.exception)


def test_a_urdf_becomes_a_robot_file_that_is_described(elastocal, tmp_path):
    urdf = written(tmp_path, *ARM)
    output = tmp_path / "robot.yaml"
    links = ("--base", "base", "--tip", "hand", "--point", "arm")
    result = elastocal("import", "urdf", urdf, "-o", output, *links)
    assert result.exit_code == 0
    assert "2 joints" in result.output and "no compliances" in result.output
    assert f"written: {output}" in result.output
    robot = read_robot(output)
    assert [point.name for point in robot.chain.points] == ["arm", "hand"]
    assert robot.masses[0].relative_std == 0.2
    assert yaml.safe_load(output.read_text())["joint_names"] == ["j1", "j2"]


@pytest.fixture
def import_table(elastocal, tmp_path):
    """Writes a table and imports it."""

    def run(*options, text=TABLE, command=elastocal):
        table = tmp_path / "t.csv"
        table.write_text(text)
        return command(
            "import", "csv", table, "--folder", tmp_path / "cell", *OPTIONS, *options
        )

    return run


def test_measurements_are_replaced_only_by_force(import_table, refusal):
    assert import_table().exit_code == 0
    assert "--force" in import_table(command=refusal)
    assert import_table("--force").exit_code == 0


def test_a_sheet_is_replaced_unless_it_has_a_measurement(
    import_table, refusal, tmp_path
):
    sheet = tmp_path / "cell" / "measurements.csv"
    sheet.parent.mkdir()
    sheet.write_text("pose,load\n")
    assert import_table().exit_code == 0
    header = "# planned\npose,load,repeat,target,done,q1,x,y,z\n"
    empty_row = "1,0,0,smr,x,0.1,,,\n"
    sheet.write_text(f"{header}{empty_row}2,0,0,smr,,0.2,,,1.5\n")
    assert "--force" in import_table(command=refusal)
    sheet.write_text(f"{header}{empty_row}2,0,0,smr,,0.2,,,\n")
    result = import_table()
    assert result.exit_code == 0, result.exception
    assert len(sheet.read_text().splitlines()) == 3


def test_an_import_states_how_the_table_was_read_and_what_was_left_out(import_table):
    text = (
        "lab\n"
        "# J1;X;Y;Z;Config;Temp;;\n"
        "90;1000,5;2;3;FUT;21 C;;\n"
        "-90;1000;2;3;NUT;21 C;;\n"
        ";;;;;;;\n"
        "# 4 more\n"
    )
    result = import_table("--ignore", "Config", text=text)
    assert result.exit_code == 0, result.exception
    lines = result.output.splitlines()
    assert lines[0] == "2 measurements of smr at 2 poses, 1 joint"
    assert (
        "file: names of columns in line 2, separator semicolon, decimal comma,"
        " encoding utf-8"
    ) in lines
    assert (
        "read: q1 from 'J1' in deg; x from 'X' in mm; y from 'Y' in mm;"
        " z from 'Z' in mm"
    ) in lines
    assert "not used: Temp, Config" in lines


def test_a_target_of_several_in_a_row_needs_three_columns(refusal, tmp_path):
    table = tmp_path / "t.csv"
    table.write_text(TABLE)
    targets = ("--target", "A=X,Y", "--target", "B=U,V,W")
    message = refusal("import", "csv", table, "--folder", tmp_path / "cell", *targets)
    assert "found A=X,Y" in message


SHEET = """pose,load,repeat,target,done,q1_deg,q1,x,y,z
1,0,0,smr,,57.296,1.0,,,
2,0,0,smr,,114.592,2.0,,,
"""
TRACKER = """Name;X [mm];Y [mm];Z [mm];Time
P1;1 203,114;-88,021;1 410,556;09:14:22
P2;1 204,114;-88,021;1 410,556;09:15:22
"""


@pytest.fixture
def sheet(tmp_path):
    (tmp_path / "cell").mkdir()
    path = tmp_path / "cell" / "measurements.csv"
    path.write_text(SHEET)
    return path


def test_a_tracker_without_joint_angles_fills_the_planned_sheet(
    elastocal, refusal, tmp_path, sheet
):
    tracker = tmp_path / "tracker.csv"
    tracker.write_text(TRACKER)
    arguments = ("import", "csv", tracker, "--folder", tmp_path / "cell")
    message = refusal(*arguments)
    assert "line 2 is pose 1" in message and "--join order" in message
    assert sheet.read_text() == SHEET
    for options in (("--join", "order"), ("--column", "pose=Name", "--force")):
        result = elastocal(*arguments, *options)
        assert result.exit_code == 0, result.exception
        assert "line 2 is pose 1, load 0, repeat 0, target smr" in result.output
        header, first, second = sheet.read_text().splitlines()
        assert header == "pose,load,repeat,target,q1,x,y,z,time_s"
        assert first.startswith("1,0,0,smr,1.0,1.203") and first.endswith(",33262.0")
        assert second.startswith("2,0,0,smr,2.0,1.204")


def test_files_of_several_sessions_are_imported_at_once(elastocal, tmp_path, sheet):
    header, *rows = TRACKER.splitlines()
    files = []
    for number, row in enumerate(rows):
        files.append(tmp_path / f"session{number}.csv")
        files[-1].write_text(f"{header}\n{row}\n")
    folder = ("--folder", tmp_path / "cell", "--column", "pose=Name")
    result = elastocal("import", "csv", *files, *folder)
    assert result.exit_code == 0, result.exception
    header, first, second = sheet.read_text().splitlines()
    assert header.startswith("session,pose")
    assert first.startswith("0,1,0,0,smr") and second.startswith("1,2,0,0,smr")


def test_an_import_names_the_next_command(elastocal, tmp_path, sheet):
    tracker = tmp_path / "tracker.csv"
    tracker.write_text(TRACKER)
    command = ("import", "csv", tracker, "--folder", tmp_path / "cell")
    result = elastocal(*command, "--join", "order")
    # Without a campaign.yaml the campaign is begun first.
    assert f"next: elastocal init {tmp_path / 'cell'} --robot" in result.output


def test_joint_angles_come_from_a_file_of_their_own(elastocal, refusal, tmp_path):
    joints = tmp_path / "joints.csv"
    joints.write_text("Nr,J1\n1,10\n2,20\n")
    tracker = tmp_path / "tracker.txt"
    tracker.write_text("2 1.5 2 3\n1 1.0 2 3\n")
    arguments = ["import", "csv", tracker, "--folder", tmp_path / "cell"]
    arguments += ["--joints", joints, "--columns", "Nr,x,y,z", *OPTIONS]
    result = elastocal(*arguments)
    assert result.exit_code == 0, result.exception
    assert "rows joined to" in result.output and "by 'Nr'" in result.output
    rows = (tmp_path / "cell" / "measurements.csv").read_text().splitlines()
    assert rows[1].split(",")[4].startswith("0.349")
    assert "--joints FILE" in refusal("import", "csv", joints, "--folder", tmp_path)


def write_sockets(folder, poses=6, joints=7):
    """Write recordings of a ball in two sockets at two places."""
    rng = np.random.default_rng(1)
    for place, socket in itertools.product(("front", "left"), (0, 1)):
        (folder / place).mkdir(parents=True, exist_ok=True)
        angles = rng.uniform(-1, 1, (poses, joints))
        np.savetxt(folder / place / f"hole_{socket}.csv", angles, delimiter=",")
    return folder


def test_recordings_in_sockets_become_a_campaign_that_can_be_read(
    elastocal, refusal, tmp_path
):
    folder = tmp_path / "arm"
    command = ("import", "sockets", write_sockets(tmp_path / "panda_1"))
    command += ("--folder", folder, "--robot", PANDA)
    result = elastocal(*command, "--distance", "0.06")
    assert result.exit_code == 0, result.exception
    assert "24 poses in 4 sockets at 2 places, 60 mm apart" in result.output
    read_campaign(read_campaign_folder(folder, PANDA.parent))
    document = yaml.safe_load((folder / "campaign.yaml").read_text())
    assert document["distances"][0]["distance_m"] == 0.06
    assert "that are there already" in refusal(*command)
    assert elastocal(*command, "--force").exit_code == 0
    assert "less than 1 m" in refusal(*command, "--force", "--distance", "50")
    short = write_sockets(tmp_path / "short", joints=6)
    command = ("import", "sockets", short, "--folder", tmp_path / "b", "--robot", PANDA)
    message = refusal(*command)
    assert "front/hole_0.csv: found 6 angles in a line; allowed: 7" in message


def test_the_measured_target_sits_at_the_last_point_of_a_robot_from_a_urdf(
    elastocal, tmp_path
):
    # `import urdf` names this point as the URDF names the link.
    robot = tmp_path / "robot.yaml"
    robot.write_text(PANDA.read_text().replace("[7DoF]", "[tool0]"))
    angles, rotation, position = make_board_poses()
    seen = tmp_path / "calib.npz"
    vectors = Rotation.from_matrix(rotation).as_rotvec()
    np.savez(seen, rvecs=vectors, tvecs=position, q=angles)
    imports = {"sockets": write_sockets(tmp_path / "recordings"), "board": seen}
    for kind, source in imports.items():
        folder = tmp_path / kind
        result = elastocal("import", kind, source, "--folder", folder, "--robot", robot)
        assert result.exit_code == 0, result.exception
        read_campaign(read_campaign_folder(folder, PANDA.parent))
        document = yaml.safe_load((folder / "campaign.yaml").read_text())
        (target,) = document["targets"].values()
        assert target["point"] == "tool0"


def test_sockets_are_by_default_as_far_apart_as_mukca_prints_them():
    # The command states the number itself, because it starts without numpy.
    default = inspect.signature(importing.sockets).parameters["distance"].default
    assert default == SOCKET_DISTANCE_M


def test_poses_of_a_board_become_a_campaign_that_can_be_read(
    elastocal, refusal, tmp_path
):
    angles, rotation, position = make_board_poses()
    path = tmp_path / "calib.npz"
    vectors = Rotation.from_matrix(rotation).as_rotvec()
    np.savez(path, rvecs=vectors, tvecs=position, q=angles)
    folder = tmp_path / "arm"
    command = ("import", "board", path, "--folder", folder)
    assert "no robot file" in refusal(*command)
    result = elastocal(*command, "--robot", PANDA, "--camera", "beside-robot")
    assert result.exit_code == 0, result.exception
    assert "12 poses of a board, camera beside-robot" in result.output
    campaign = read_campaign(read_campaign_folder(folder, PANDA.parent))
    np.testing.assert_array_equal(campaign.measurements.position, position)
