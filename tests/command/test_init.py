"""A campaign's folder to begin with."""

from elastocal.campaigns.reading import read_descriptions


def test_a_new_folder_is_a_campaign_that_lacks_measurements(elastocal, tmp_path):
    result = elastocal("init", tmp_path / "cell")
    assert result.exit_code == 0 and "template" in result.output
    assert {path.name for path in (tmp_path / "cell").iterdir()} == {"campaign.yaml", "robot.yaml", "measurements.csv"}
    document, robot = read_descriptions(tmp_path / "cell", tmp_path)
    assert document["campaign"] == "cell" and robot == tmp_path / "cell" / "robot.yaml"


def test_what_is_there_stays(elastocal, refusal, tmp_path):
    (tmp_path / "measurements.csv").write_text("pose,load,repeat,target\n")
    (tmp_path / "robot.yaml").write_text("name: arm\nchain: Rz(q1) Tx(1.0) [tip]\n")
    result = elastocal("init", tmp_path)
    assert result.exit_code == 0 and "template" not in result.output
    assert (tmp_path / "measurements.csv").read_text() == "pose,load,repeat,target\n"
    assert "point: tip" in (tmp_path / "campaign.yaml").read_text()
    assert refusal("init", tmp_path)


def test_targets_are_those_of_the_measurements_that_lie_there(elastocal, refusal, tmp_path):
    (tmp_path / "robot.yaml").write_text("name: arm\nchain: Rz(q1) Tx(1.0) [tip]\n")
    (tmp_path / "t.csv").write_text("q1,x,y,z,rx,ry,rz,target\n" + "".join(f"{n},1,2,3,0,0,0,TCP\n" for n in range(9)))
    words = ("--folder", tmp_path, "--angles", "deg", "--lengths", "m", "--rotation", "vector")
    assert elastocal("import", "csv", tmp_path / "t.csv", *words).exit_code == 0
    result = elastocal("init", tmp_path)
    assert result.exit_code == 0 and "fill in" not in result.output
    document, _ = read_descriptions(tmp_path, tmp_path)
    assert (document["measured"], document["targets"]) == ("pose", {"TCP": {"point": "tip", "offset_m": "unknown"}})
    # The other way round: what is imported beside a campaign is compared with it.
    assert "! campaign.yaml" not in elastocal("import", "csv", tmp_path / "t.csv", *words, "--force").output
    (tmp_path / "t.csv").write_text((tmp_path / "t.csv").read_text().replace("TCP", "SMR"))
    again = elastocal("import", "csv", tmp_path / "t.csv", *words, "--force")
    assert again.exit_code == 0 and "has no target SMR" in again.output
    (tmp_path / "campaign.yaml").unlink()
    (tmp_path / "measurements.csv").write_text("mine")
    assert "unknown column 'mine'" in refusal("init", tmp_path)


def test_a_robot_that_cannot_be_read_leaves_nothing_behind(refusal, tmp_path):
    (tmp_path / "arm.yaml").write_text("name: arm\n")
    (tmp_path / "latin.yaml").write_bytes(b"name: \xe9\n")
    for name in ("arm.yaml", "none.yaml", "latin.yaml"):
        assert refusal("init", tmp_path / "cell", "--robot", tmp_path / name)
    assert not (tmp_path / "cell").exists()
