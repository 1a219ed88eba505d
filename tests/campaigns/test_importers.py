"""Public data: only contents of the known digest are used, each format comes back as a
campaign, faults are one line."""

import hashlib
import http.server
import json
import shutil
import threading
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import yaml
from made_fanuc_sources import POSES, REPEATS, assert_holds, cpa_source, static_source
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.importers import (
    FOLDER_VARIABLE,
    PublicFile,
    fetch,
    find_importer,
    find_missing,
    find_user_campaign,
    list_campaigns,
    read_campaign_sources,
    read_importers,
)
from elastocal.campaigns.reading import read_campaign, read_robot
from elastocal.io.documents import read_document

CONFIG = Path(__file__).resolve().parents[2] / "config"
ROBOTS = CONFIG / "robots"
BOX = CONFIG.parent / "data" / "measured"
ALL = read_importers(CONFIG / "public_data.yaml")
BOXED = "jacobi_ur5_every_seventh"
CONTENTS = b"0 1 2\n"
MINE = PublicFile(
    "owner/name",
    "c0ffee",
    "data/values.csv",
    hashlib.sha256(CONTENTS).hexdigest(),
    "mine/values.csv",
    "MIT",
)


@pytest.fixture
def place(monkeypatch, tmp_path):
    """Fetches and looks for MINE, or for a file of FILES, on a machine without other
    data."""
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    return {"folder": tmp_path / "cache", "box": tmp_path / "box"}


def missing(place):
    return find_missing(["mine"], {"mine": MINE}, place["folder"], place["box"])


def test_a_file_of_the_given_folder_is_used_where_it_lies_and_refused_with_other_contents(
    place, monkeypatch, tmp_path
):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    assert missing(place) == MINE.local
    given = tmp_path / MINE.local
    given.parent.mkdir()
    given.write_bytes(CONTENTS)
    assert (
        fetch("mine", {"mine": MINE}, **place) == given
        and not place["folder"].exists()
        and missing(place) is None
    )
    given.write_bytes(CONTENTS + b"\n")
    with refused(given, "", "SHA-256", MINE.sha256, MINE.address):
        fetch("mine", {"mine": MINE}, **place)
    with refused("public data", "", "'yours'", "mine"):
        fetch("yours", {"mine": MINE}, **place)


def test_what_no_folder_has_is_downloaded_once_with_the_known_contents(
    place, monkeypatch, tmp_path
):
    served = tmp_path / "served" / MINE.path
    served.parent.mkdir(parents=True)
    handler = partial(
        http.server.SimpleHTTPRequestHandler, directory=tmp_path / "served"
    )
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever).start()
        monkeypatch.setattr(
            PublicFile, "address", f"http://127.0.0.1:{server.server_port}/{MINE.path}"
        )
        try:
            assert missing(place) is None
            with refused(PublicFile.address, "", "404", FOLDER_VARIABLE, MINE.local):
                fetch("mine", {"mine": MINE}, **place)
            served.write_bytes(b"something else")
            with refused(PublicFile.address, "", "other contents", "SHA-256"):
                fetch("mine", {"mine": MINE}, **place)
            assert list(place["folder"].iterdir()) == []
            served.write_bytes(CONTENTS)
            kept = fetch("mine", {"mine": MINE}, **place)
        finally:
            server.shutdown()
    assert kept.parent == place["folder"] and kept.read_bytes() == CONTENTS
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "empty"))
    assert fetch("mine", {"mine": MINE}, **place) == kept and missing(place) is None


def test_what_comes_with_the_project_is_used_stated_and_not_looked_for_in_the_network(
    place,
):
    files = ALL["jacobi"].files
    file = files[BOXED]
    page = (BOX / "README.md").read_text(encoding="utf-8")
    assert fetch(BOXED, files, place["folder"], BOX) == BOX / file.local
    assert "MIT License" in (BOX / file.local).with_name("LICENSE").read_text(
        encoding="utf-8"
    )
    assert all(
        said in page
        for said in (file.repository, file.commit, file.path, file.sha256, file.licence)
    )


def test_importers_name_robots_and_campaigns_name_their_files():
    assert all(
        (ROBOTS / f"{robot}.yaml").is_file()
        for each in ALL.values()
        for robot in each.robots
    )
    assert ALL["fanuc_joint"].robots == ("fanuc_measured", "fanuc_static", "fanuc_cpa")
    documents = map(read_document, (CONFIG / "campaigns").glob("*.yaml"))
    public = [document for document in documents if document["source"] == "public"]
    assert {document["importer"] for document in public} == set(ALL)
    assert all(
        set(document["files"]) <= set(ALL[document["importer"]].files)
        for document in public
    )
    with refused("mine.yaml", "importer", "'nobody'", ", ".join(ALL)):
        find_importer("nobody", CONFIG, "mine.yaml")


def made(tmp_path, name, *paths, **test):
    ALL[name].write_campaign(paths, tmp_path / "campaign", ROBOTS, name, **test)
    return read_campaign(read_campaign_folder(tmp_path / "campaign", ROBOTS))


def text(path, columns, separator=",", decimal="."):
    cells = [
        [name, *(str(cell).replace(".", decimal) for cell in column)]
        for name, column in columns.items()
    ]
    path.write_text(
        "".join(separator.join(row) + "\r\n" for row in zip(*cells, strict=True)),
        encoding="utf-8",
    )
    return path


def test_sessions_of_the_fanuc_are_campaigns_alone_and_one_of_one_robot_together(
    fanuc, tmp_path
):
    static = static_source(fanuc, tmp_path)
    cpa = cpa_source(fanuc, tmp_path)
    for name, source, letters in (
        ("fanuc_static", static, "ABC"),
        ("fanuc_cpa", cpa, "DEF"),
    ):
        campaign = made(tmp_path, name, source[0])
        assert [(t.name, t.point, t.offset_m) for t in campaign.targets] == [
            (letter, "6DoF", None) for letter in letters
        ]
        assert (campaign.measured, campaign.frame, campaign.noise) == (
            "position",
            "tracker",
            ALL[name].noise,
        )
        assert (campaign.compliance, campaign.declared) == (
            "nominal",
            ("joint_offset", "link_geometry"),
        )
        assert_holds(campaign.measurements, *source[1:])
        assert campaign.robot.chain == fanuc.chain
    both = made(tmp_path, "fanuc_joint", static[0], cpa[0])
    assert both.robot.chain == fanuc.chain
    counted = [np.arange(POSES).repeat(3 * REPEATS), np.arange(POSES).repeat(3)]
    for session, (_, angles, positions) in enumerate((static, cpa)):
        measurements = both.measurements.select(both.measurements.session == session)
        assert_holds(measurements, angles, positions)
        np.testing.assert_array_equal(measurements.pose, counted[session])
        assert {both.targets[index].name for index in measurements.target} == set(
            ("ABC", "DEF")[session]
        )
        assert measurements.repeat.max() == (REPEATS - 1, 0)[session]
    # Dealt out in turn, folds hold every pose of every session once, each spread over
    # the campaign.
    folds = [
        made(
            tmp_path, "fanuc_joint", static[0], cpa[0], fold={"number": n, "of": 3}
        ).holdout["poses"]
        for n in (1, 2, 3)
    ]
    there = [[session, pose] for session in (0, 1) for pose in range(POSES)]
    assert [folds[n % 3][n // 3] for n in range(len(there))] == there and sum(
        map(len, folds)
    ) == len(there)


@pytest.mark.parametrize(("joints", "robot"), [(6, "ur5"), (7, "wam")])
def test_commanded_positions_and_differences_are_measured_positions(
    tmp_path, joints, robot
):
    rng = np.random.default_rng(1)
    degrees = rng.uniform(-49, 70, (9, joints))
    wanted = rng.uniform(-600, 600, (9, 3))
    measured = (wanted + rng.normal(0, 2, (9, 3))).round(6)
    columns = {f"{axis}_t": wanted[:, i] for i, axis in enumerate("xyz")}
    columns |= {
        f"{axis}_dif": (measured - wanted)[:, i] for i, axis in enumerate("xyz")
    }
    columns |= {f"joint_{j + 1}": degrees[:, j] for j in range(joints)}
    campaign = made(tmp_path, "jacobi", text(tmp_path / "grid.csv", columns))
    assert (
        campaign.robot.name == read_robot(ROBOTS / f"{robot}.yaml").name
        and campaign.targets[0].point == f"{joints}DoF"
    )
    np.testing.assert_allclose(
        campaign.measurements.joint_angles, np.radians(degrees), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(
        campaign.measurements.position, 1e-3 * measured, rtol=0, atol=1e-12
    )
    path = text(
        tmp_path / "other.csv",
        {name: column for name, column in columns.items() if name != "z_dif"},
    )
    with refused(path, "", "z_dif", "serial_robots_datasets"):
        ALL["jacobi"].read(path)


def series(tmp_path, **changes):
    """A file of the UR10's format, of which poses 2 and 5 are approached again, as near
    as the controller comes."""
    rng = np.random.default_rng(6)
    angles = rng.uniform(-3, 3, (9, 6)).round(9)
    angles = np.vstack([angles, angles[[2, 5]] + 4e-5])
    position = rng.uniform(-3000, 3000, (11, 3)).round(5)
    degrees = rng.uniform(-89, 89, (11, 3)).round(6)
    columns = {
        "Timestamp": [f"2020071416{39 + i // 6}{10 * (i % 6):02d}" for i in range(11)],
        "other": np.zeros(11),
    }
    columns |= dict(
        zip(
            read_document(CONFIG / "public_data.yaml")["ur10_ipa"]["table"]["angles"],
            angles.T,
            strict=True,
        )
    )
    columns |= {f"measurement_{axis}": position[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"measurement_r{axis}": degrees[:, i] for i, axis in enumerate("xyz")}
    columns |= {"measurement_temperature": 20 + 0.25 * np.arange(11)} | changes
    return text(tmp_path / "series.csv", columns, ";", ","), angles, position, degrees


def test_series_of_the_ur10_become_campaigns_of_poses_with_time_and_temperature(
    tmp_path,
):
    path, angles, position, degrees = series(tmp_path)
    campaign = made(tmp_path, "ur10_ipa", path)
    found = campaign.measurements
    assert (campaign.measured, campaign.noise) == (
        "pose",
        {"position_m": 2.1e-5, "orientation_rad": 3.0e-5},
    )
    np.testing.assert_allclose(found.joint_angles, angles, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.position, 1e-3 * position, rtol=0, atol=1e-15)
    turned = Rotation.from_euler("XYZ", degrees, degrees=True)
    np.testing.assert_allclose(
        (Rotation.from_rotvec(found.rotation_vector) * turned.inv()).magnitude(),
        0,
        atol=1e-12,
    )
    np.testing.assert_array_equal(found.temperature_c, 20 + 0.25 * np.arange(11))
    np.testing.assert_array_equal(found.time_s, 10.0 * np.arange(11))
    assert found.pose.tolist() == [*range(9), 2, 5] and found.repeat.tolist() == 9 * [
        0
    ] + [1, 1]
    cut = series(tmp_path, Timestamp=11 * ["2,02011E+13"])[0]
    assert made(tmp_path, "ur10_ipa", cut).measurements.time_s is None


@pytest.mark.parametrize(
    "contents", [b"", b'a;b\n"1;2\n', b"a;b\n1;\xff\n", "1 2", "x"]
)
def test_text_that_is_no_such_table_is_refused(tmp_path, contents):
    path = tmp_path / "series.csv"
    if isinstance(contents, str):
        series(tmp_path, elbow_joint=[1, contents, *range(9)])
    else:
        path.write_bytes(contents)
    with refused(path, "", "a series of ipa-robot-accuracy"):
        ALL["ur10_ipa"].read(path)


def test_each_pose_of_the_motoman_counts_once_and_those_that_nobody_saw_not_at_all(
    tmp_path,
):
    draws = np.random.default_rng(1)
    path = tmp_path / "some.mat"

    def write(poses, images, unseen=None):
        each = draws.uniform(-0.5, 0.5, (poses, 26))
        each[:, 0] = np.arange(1, poses + 1)
        values = draws.permutation(np.repeat(each, images, axis=0))
        values[values[:, 0] == unseen, 19:] = np.nan
        scipy.io.savemat(path, {"dataset": values})
        return each

    each = np.delete(write(9, 3, unseen=4), 3, axis=0)
    measurements = made(tmp_path, "motoman", path).measurements
    np.testing.assert_array_equal(measurements.joint_angles, each[:, 7:13])
    np.testing.assert_array_equal(measurements.position, each[:, 19:22])
    # The source's own reader leaves out the 13th of the larger file.
    each = write(587, 1)
    np.testing.assert_array_equal(
        ALL["motoman"].read(path).angles, np.delete(each, 12, axis=0)[:, 7:13]
    )


def test_campaigns_of_the_repository_pass(config, config_folder):
    sources = read_campaign_sources(config, config_folder)
    assert list(sources) == list_campaigns(config)
    for name, document in sources.items():
        assert document["source"] == (
            "simulated" if name in config["loop"]["campaigns"] else "public"
        )
        assert ("robot_document" in document) == (document["source"] == "simulated")


def of_one_campaign(config, name="mine"):
    nobody = config["league"] | {"data": {"all": {}}}
    return config | {
        "loop": config["loop"] | {"main": [name], "campaigns": [], "measured": []},
        "league": nobody,
    }


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"poses": 3}, "poses", ["found 3", "8 or more"]),
        ({"declared_robot": "fanuk"}, "robots", ["'fanuk'", "'fanuc'?"]),
        (
            None,
            "importer",
            [
                "'mine'",
                "fanuc_static, fanuc_cpa, fanuc_joint, jacobi, motoman, ur10_ipa",
            ],
        ),
    ],
)
def test_fault_in_a_campaigns_file_is_one_line_that_names_it(
    changes, key, words, config, config_folder, tmp_path
):
    for name in ("robots", "public_data.yaml"):
        (tmp_path / name).symlink_to(config_folder / name)
    simulated = read_document(
        config_folder / "campaigns" / f"{config['loop']['campaigns'][0]}.yaml"
    )
    document = (
        {"source": "public", "importer": "mine", "files": ["a"]}
        if changes is None
        else simulated | changes
    )
    path = tmp_path / "campaigns" / "mine.yaml"
    path.parent.mkdir()
    path.write_text(yaml.safe_dump(document))
    with refused(path.as_posix(), key, *words):
        read_campaign_sources(of_one_campaign(config), tmp_path, "study.yaml")


def users_folder(tmp_path, **changes):
    document = {
        "campaign": "cell7",
        "robot": "kuka",
        "measured": "position",
        "frame": "base",
    } | changes
    folder = tmp_path / "cell"
    folder.mkdir()
    (folder / "campaign.yaml").write_text(
        yaml.safe_dump(
            document | {"targets": {"A": {"point": "6DoF", "offset_m": [0, 0, 0]}}}
        )
    )
    return folder.as_posix()


def users_own(config, robots, results):
    """The user's own campaign: path of its folder by its name."""
    campaigns = find_user_campaign(config, robots, results)
    return {name: folder.path.as_posix() for name, folder in campaigns.items()}


def test_a_users_own_campaign_has_one_spelling_however_its_folder_is_given(
    config, config_folder, tmp_path, monkeypatch
):
    """Results are of files by their names: `elastocal diagnose` hands on an absolute
    path, people type any."""
    users_folder(tmp_path)
    (tmp_path / "cell").rename(tmp_path / "2026")
    (tmp_path / "link").symlink_to(tmp_path / "2026")
    (tmp_path / "beside").mkdir()
    assert (
        users_own(config | {"campaign": ""}, config_folder / "robots", tmp_path) == {}
    )
    everywhere = {
        "": ["2026", 2026, "./2026", "2026/../2026//", "link"],
        "beside": ["../2026", "../link/"],
    }
    for place, given in everywhere.items():
        monkeypatch.chdir(tmp_path / place)
        for each in [*given, f"{tmp_path}/2026/"]:
            found = users_own(
                config | {"campaign": each},
                config_folder / "robots",
                tmp_path / "results",
            )
            assert found == {"cell7": f"{tmp_path}/2026" if place else "2026"}


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"campaign": "cell/7"}, "campaign", ["'cell/7'", "letters, digits"]),
        (
            {"campaign": "kuka_nothing_missing"},
            "campaign",
            ["kuka_nothing_missing", "no campaign of"],
        ),
        (
            {"holdout": {"campaign": "../other"}},
            "holdout.campaign",
            ["'../other'", "beside"],
        ),
        (
            {"holdout": {"campaign": "."}},
            "holdout.campaign",
            ["'.', the campaign itself"],
        ),
    ],
)
def test_fault_in_a_users_own_campaign_is_one_line_that_names_its_file(
    changes, key, words, config, config_folder, tmp_path
):
    folder = users_folder(tmp_path, **changes)
    with refused(f"{folder}/campaign.yaml", key, *words):
        users_own(config | {"campaign": folder}, config_folder / "robots", tmp_path)
    (tmp_path / "a{x}b").mkdir()
    folder = users_folder(tmp_path / "a{x}b")
    with refused(f"{folder}/campaign.yaml", "", "braces", "without braces"):
        users_own(config | {"campaign": folder}, config_folder / "robots", tmp_path)


def test_two_campaigns_of_one_name_are_refused_while_both_are_there(
    config, config_folder, tmp_path
):
    """The second would overwrite the reports of the first."""
    folder = users_folder(tmp_path)
    results = tmp_path / "results"
    other = tmp_path / "other"
    (results / "cell7").mkdir(parents=True)
    other.mkdir()

    def own(source):
        (results / "cell7/campaign.json").write_text(
            json.dumps({"source": source}), encoding="utf-8"
        )
        return users_own(
            config | {"campaign": folder}, config_folder / "robots", results
        )

    with refused(
        f"{folder}/campaign.yaml",
        "campaign",
        "'cell7', whose results are of",
        str(other),
        f"{results}/cell7",
    ):
        own(f"{other}/campaign.yaml")
    # The same folder by another path, one that is gone, and results that do not say:
    # nothing is overwritten.
    for source in (
        f"{other}/../cell/campaign.yaml",
        f"{tmp_path}/gone/campaign.yaml",
        7,
    ):
        assert own(source) == {"cell7": folder}


def test_two_campaigns_that_test_each_other_come_with_the_files_of_both(
    config, config_folder, tmp_path
):
    folder = users_folder(tmp_path, holdout={"campaign": "../other"})
    shutil.copytree(folder, tmp_path / "other", symlinks=True)
    (tmp_path / "other/campaign.yaml").write_text(
        (tmp_path / "cell/campaign.yaml")
        .read_text()
        .replace("../other", "../cell")
        .replace("cell7", "cell8")
    )
    robots = config_folder / "robots"
    own = find_user_campaign(config | {"campaign": folder}, robots, tmp_path)["cell7"]
    expected = [
        f"{folder}/campaign.yaml",
        f"{robots}/kuka.yaml",
        f"{folder}/../other/campaign.yaml",
        f"{robots}/kuka.yaml",
    ]
    assert own.files() == expected
