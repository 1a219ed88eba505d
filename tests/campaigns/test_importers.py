"""Public data: only files of the stated digest are used, each format becomes a
campaign, and faults are reported in one line."""

import hashlib
import http.server
import json
import shutil
import threading
from dataclasses import replace
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
from elastocal.mechanics.two_arms import join_arms

CONFIG = Path(__file__).resolve().parents[2] / "config"
ROBOTS = CONFIG / "robots"
BUNDLED_DATA = CONFIG.parent / "data" / "measured"
IMPORTERS = read_importers(CONFIG / "public_data.yaml")
BUNDLED_FILE = "jacobi_ur5_every_seventh"
CONTENTS = b"0 1 2\n"
PUBLIC_FILE = PublicFile(
    "owner/name",
    "c0ffee",
    "data/values.csv",
    hashlib.sha256(CONTENTS).hexdigest(),
    "mine/values.csv",
    "MIT",
)
FILES = {"mine": PUBLIC_FILE}


@pytest.fixture
def folders(monkeypatch, tmp_path):
    """Folders of downloaded and of bundled data on a machine without data."""
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    return {"folder": tmp_path / "cache", "box": tmp_path / "box"}


def find_missing_file(folders):
    """Return where the file of `FILES` is missing, or None."""
    return find_missing(["mine"], FILES, folders["folder"], folders["box"])


def test_a_file_in_the_given_folder_is_used_in_place_and_refused_with_other_contents(
    folders, monkeypatch, tmp_path
):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    assert find_missing_file(folders) == PUBLIC_FILE.local
    path = tmp_path / PUBLIC_FILE.local
    path.parent.mkdir()
    path.write_bytes(CONTENTS)
    assert fetch("mine", FILES, **folders) == path
    assert not folders["folder"].exists()
    assert find_missing_file(folders) is None
    path.write_bytes(CONTENTS + b"\n")
    with refused(path, "", "SHA-256", PUBLIC_FILE.sha256, PUBLIC_FILE.address):
        fetch("mine", FILES, **folders)
    with refused("public data", "", "'yours'", "mine"):
        fetch("yours", FILES, **folders)


def test_a_file_in_no_folder_is_downloaded_once_and_only_with_the_stated_contents(
    folders, monkeypatch, tmp_path
):
    served = tmp_path / "served" / PUBLIC_FILE.path
    served.parent.mkdir(parents=True)
    handler = partial(
        http.server.SimpleHTTPRequestHandler, directory=tmp_path / "served"
    )
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever).start()
        monkeypatch.setattr(
            PublicFile,
            "address",
            f"http://127.0.0.1:{server.server_port}/{PUBLIC_FILE.path}",
        )
        try:
            assert find_missing_file(folders) is None
            with refused(
                PublicFile.address, "", "404", FOLDER_VARIABLE, PUBLIC_FILE.local
            ):
                fetch("mine", FILES, **folders)
            served.write_bytes(b"something else")
            with refused(PublicFile.address, "", "other contents", "SHA-256"):
                fetch("mine", FILES, **folders)
            assert list(folders["folder"].iterdir()) == []
            served.write_bytes(CONTENTS)
            path = fetch("mine", FILES, **folders)
        finally:
            server.shutdown()
    assert path.parent == folders["folder"]
    assert path.read_bytes() == CONTENTS
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "empty"))
    assert fetch("mine", FILES, **folders) == path
    assert find_missing_file(folders) is None


def test_bundled_data_is_used_without_the_network_and_its_origin_is_stated(folders):
    files = IMPORTERS["jacobi"].files
    file = files[BUNDLED_FILE]
    path = BUNDLED_DATA / file.local
    assert fetch(BUNDLED_FILE, files, folders["folder"], BUNDLED_DATA) == path
    licence = path.with_name("LICENSE").read_text(encoding="utf-8")
    assert "MIT License" in licence
    page = (BUNDLED_DATA / "README.md").read_text(encoding="utf-8")
    for fact in (file.repository, file.commit, file.path, file.sha256, file.licence):
        assert fact in page


def test_importers_name_their_robots_and_campaigns_name_their_files():
    for importer in IMPORTERS.values():
        for robot in importer.robots:
            assert (ROBOTS / f"{robot}.yaml").is_file()
    assert IMPORTERS["fanuc_joint"].robots == (
        "fanuc_measured",
        "fanuc_static",
        "fanuc_cpa",
    )
    documents = map(read_document, (CONFIG / "campaigns").glob("*.yaml"))
    public = [document for document in documents if document["source"] == "public"]
    assert {document["importer"] for document in public} == set(IMPORTERS)
    for document in public:
        assert set(document["files"]) <= set(IMPORTERS[document["importer"]].files)
    with refused("mine.yaml", "importer", "'nobody'", ", ".join(IMPORTERS)):
        find_importer("nobody", CONFIG, "mine.yaml")


def import_campaign(tmp_path, name, *paths, **options):
    """Import files as a campaign's folder, and read the campaign."""
    IMPORTERS[name].write_campaign(
        paths, tmp_path / "campaign", ROBOTS, name, **options
    )
    return read_campaign(read_campaign_folder(tmp_path / "campaign", ROBOTS))


def write_table(path, columns, separator=",", decimal="."):
    """Write a table of columns by their headers."""
    cells = []
    for header, column in columns.items():
        cells.append([header, *(str(cell).replace(".", decimal) for cell in column)])
    lines = [separator.join(row) + "\r\n" for row in zip(*cells, strict=True)]
    path.write_text("".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "letters", "make_source"),
    [("fanuc_static", "ABC", static_source), ("fanuc_cpa", "DEF", cpa_source)],
)
def test_a_session_of_the_fanuc_is_a_campaign(
    fanuc, tmp_path, name, letters, make_source
):
    path, angles, positions = make_source(fanuc, tmp_path)
    campaign = import_campaign(tmp_path, name, path)
    targets = [
        (target.name, target.point, target.offset_m) for target in campaign.targets
    ]
    assert targets == [(letter, "6DoF", None) for letter in letters]
    assert not campaign.measures_poses
    assert campaign.frame == "tracker"
    assert campaign.noise == IMPORTERS[name].noise
    assert campaign.compliance == "nominal"
    assert campaign.declared == ("joint_offset", "link_geometry")
    assert_holds(campaign.measurements, angles, positions)
    assert campaign.robot.chain == fanuc.chain


def test_both_sessions_of_the_fanuc_are_one_campaign_of_one_robot(fanuc, tmp_path):
    sources = static_source(fanuc, tmp_path), cpa_source(fanuc, tmp_path)
    paths = [source[0] for source in sources]
    campaign = import_campaign(tmp_path, "fanuc_joint", *paths)
    assert campaign.robot.chain == fanuc.chain
    poses = [np.arange(POSES).repeat(3 * REPEATS), np.arange(POSES).repeat(3)]
    for session, (_, angles, positions) in enumerate(sources):
        measurements = campaign.measurements.select(
            campaign.measurements.session == session
        )
        assert_holds(measurements, angles, positions)
        np.testing.assert_array_equal(measurements.pose, poses[session])
        names = {campaign.targets[index].name for index in measurements.target}
        assert names == set(("ABC", "DEF")[session])
        assert measurements.repeat.max() == (REPEATS - 1, 0)[session]


def test_folds_deal_out_the_poses_of_all_sessions_in_turn(fanuc, tmp_path):
    """The folds contain every pose once, and each is spread over the campaign."""
    paths = static_source(fanuc, tmp_path)[0], cpa_source(fanuc, tmp_path)[0]
    folds = []
    for number in (1, 2, 3):
        campaign = import_campaign(
            tmp_path, "fanuc_joint", *paths, fold={"number": number, "of": 3}
        )
        folds.append(campaign.holdout["poses"])
    poses = [[session, pose] for session in (0, 1) for pose in range(POSES)]
    dealt = [folds[index % 3][index // 3] for index in range(len(poses))]
    assert dealt == poses
    assert sum(map(len, folds)) == len(poses)


@pytest.mark.parametrize(("joints", "robot"), [(6, "ur5"), (7, "wam")])
def test_commanded_positions_plus_differences_are_measured_positions(
    tmp_path, joints, robot
):
    rng = np.random.default_rng(1)
    degrees = rng.uniform(-49, 70, (9, joints))
    commanded = rng.uniform(-600, 600, (9, 3))
    measured = (commanded + rng.normal(0, 2, (9, 3))).round(6)
    difference = measured - commanded
    columns = {f"{axis}_t": commanded[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"{axis}_dif": difference[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"joint_{j + 1}": degrees[:, j] for j in range(joints)}
    path = write_table(tmp_path / "grid.csv", columns)
    campaign = import_campaign(tmp_path, "jacobi", path)
    assert campaign.robot.name == read_robot(ROBOTS / f"{robot}.yaml").name
    assert campaign.targets[0].point == f"{joints}DoF"
    np.testing.assert_allclose(
        campaign.measurements.joint_angles, np.radians(degrees), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(
        campaign.measurements.position, 1e-3 * measured, rtol=0, atol=1e-12
    )
    del columns["z_dif"]
    path = write_table(tmp_path / "other.csv", columns)
    with refused(path, "", "z_dif", "serial_robots_datasets"):
        IMPORTERS["jacobi"].read(path)


def write_series(tmp_path, **changes):
    """Write a file in the format of the UR10, in which poses 2 and 5 are approached
    again, as closely as the controller does.

    Returns its path, the joint angles (rad), positions (mm) and Euler angles (deg).
    """
    rng = np.random.default_rng(6)
    angles = rng.uniform(-3, 3, (9, 6)).round(9)
    angles = np.vstack([angles, angles[[2, 5]] + 4e-5])
    position = rng.uniform(-3000, 3000, (11, 3)).round(5)
    degrees = rng.uniform(-89, 89, (11, 3)).round(6)
    times = [f"2020071416{39 + i // 6}{10 * (i % 6):02d}" for i in range(11)]
    columns = {"Timestamp": times, "other": np.zeros(11)}
    names = read_document(CONFIG / "public_data.yaml")["ur10_ipa"]["table"]["angles"]
    columns |= dict(zip(names, angles.T, strict=True))
    columns |= {f"measurement_{axis}": position[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"measurement_r{axis}": degrees[:, i] for i, axis in enumerate("xyz")}
    columns |= {"measurement_temperature": 20 + 0.25 * np.arange(11)} | changes
    path = write_table(tmp_path / "series.csv", columns, ";", ",")
    return path, angles, position, degrees


def test_series_of_the_ur10_become_campaigns_of_poses_with_time_and_temperature(
    tmp_path,
):
    path, angles, position, degrees = write_series(tmp_path)
    campaign = import_campaign(tmp_path, "ur10_ipa", path)
    measurements = campaign.measurements
    assert campaign.measures_poses
    assert campaign.noise == {"position_m": 2.1e-5, "orientation_rad": 3.0e-5}
    np.testing.assert_allclose(measurements.joint_angles, angles, rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        measurements.position, 1e-3 * position, rtol=0, atol=1e-15
    )
    expected = Rotation.from_euler("XYZ", degrees, degrees=True)
    rotation = Rotation.from_rotvec(measurements.rotation_vector)
    np.testing.assert_allclose((rotation * expected.inv()).magnitude(), 0, atol=1e-12)
    np.testing.assert_array_equal(measurements.temperature_c, 20 + 0.25 * np.arange(11))
    np.testing.assert_array_equal(measurements.time_s, 10.0 * np.arange(11))
    assert measurements.pose.tolist() == [*range(9), 2, 5]
    assert measurements.repeat.tolist() == 9 * [0] + [1, 1]


def test_rounded_time_stamps_of_the_ur10_are_no_times(tmp_path):
    path = write_series(tmp_path, Timestamp=11 * ["2,02011E+13"])[0]
    assert import_campaign(tmp_path, "ur10_ipa", path).measurements.time_s is None


@pytest.mark.parametrize(
    "contents", [b"", b'a;b\n"1;2\n', b"a;b\n1;\xff\n", "1 2", "x"]
)
def test_a_text_that_is_no_series_of_the_ur10_is_refused(tmp_path, contents):
    path = tmp_path / "series.csv"
    if isinstance(contents, str):
        write_series(tmp_path, elbow_joint=[1, contents, *range(9)])
    else:
        path.write_bytes(contents)
    with refused(path, "", "a series of ipa-robot-accuracy"):
        IMPORTERS["ur10_ipa"].read(path)


def test_each_pose_of_the_motoman_counts_once_and_poses_without_images_do_not_count(
    tmp_path,
):
    rng = np.random.default_rng(1)
    path = tmp_path / "some.mat"

    def write(poses, images, unseen=None):
        """Write a number of images of each pose, and return the poses."""
        rows = rng.uniform(-0.5, 0.5, (poses, 26))
        rows[:, 0] = np.arange(1, poses + 1)
        values = rng.permutation(np.repeat(rows, images, axis=0))
        values[values[:, 0] == unseen, 19:] = np.nan
        scipy.io.savemat(path, {"dataset": values})
        return rows

    poses = np.delete(write(9, 3, unseen=4), 3, axis=0)
    measurements = import_campaign(tmp_path, "motoman", path).measurements
    np.testing.assert_array_equal(measurements.joint_angles, poses[:, 7:13])
    np.testing.assert_array_equal(measurements.position, poses[:, 19:22])
    # The reader of the data's authors leaves out the 13th pose of the larger file.
    poses = write(587, 1)
    np.testing.assert_array_equal(
        IMPORTERS["motoman"].read(path).angles, np.delete(poses, 12, axis=0)[:, 7:13]
    )


@pytest.fixture
def recordings(tmp_path):
    """Return files of 12 poses in each of two sockets."""
    paths = [tmp_path / "front" / f"hole_{socket}.csv" for socket in (0, 1)]
    paths[0].parent.mkdir()
    for path in paths:
        angles = np.random.default_rng(1).uniform(-1, 1, (12, 7))
        np.savetxt(path, angles, delimiter=",")
    return paths


def test_files_of_sockets_become_a_campaign_of_the_last_joint(recordings, tmp_path):
    importer = IMPORTERS["mukca_panda"]
    folder = tmp_path / "mine"
    importer.write_campaign(
        recordings, folder, ROBOTS, "mine", holdout={"fraction": 0.3, "seed": 1}
    )
    campaign = read_campaign(read_campaign_folder(folder, ROBOTS))
    assert campaign.robot.joints == 7
    document = yaml.safe_load((folder / "campaign.yaml").read_text())
    assert document["distances"][0]["distance_m"] == 0.05
    with refused(recordings[0], "", "joint angles alone"):
        importer.read(recordings[0])


def test_the_declared_noise_of_sockets_is_that_of_their_importer(recordings, tmp_path):
    importer = replace(IMPORTERS["mukca_panda"], noise={"position_m": 3e-5})
    folder = tmp_path / "mine"
    importer.write_campaign(recordings, folder, ROBOTS, "mine")
    document = yaml.safe_load((folder / "campaign.yaml").read_text())
    assert document["noise"] == {"position_m": 3e-5}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("same_pose_rad", 0.01),
        ("parts", []),
        ("table", {"kind": "table", "angles": ["q1"], "positions": {"A": ["x"]}}),
    ],
)
def test_keys_of_tables_are_refused_beside_sockets(tmp_path, key, value):
    entry = {"robots": ["panda"], "sockets": {"distance_m": 0.05}, key: value}
    path = tmp_path / "public_data.yaml"
    path.write_text(yaml.safe_dump({"mine": entry}))
    with refused(path, f"mine.{key}", "a key beside sockets"):
        read_importers(path)


@pytest.fixture
def contacts(tmp_path):
    """Return files of the contacts of two arms, with two rows for each pose."""
    names = ["no_leica_wall_table1_5x5_dataset", "no_leica_self_upper1_4x4_dataset"]
    paths = [tmp_path / f"{name}.mat" for name in names]
    for number, path in enumerate(paths):
        rows = np.full((40, 26), np.nan)
        rows[:, 0] = np.repeat(np.arange(20), 2)
        rows[:, 6:19] = 0.1 * (number + np.arange(13) + rows[:, :1])
        scipy.io.savemat(path, {"dataset": rows})
    return paths


def test_contacts_of_two_arms_become_rows_of_their_features(contacts, tmp_path):
    folder = tmp_path / "mine"
    IMPORTERS["motoman_contacts"].write_campaign(contacts, folder, ROBOTS, "mine")
    campaign = read_campaign(read_campaign_folder(folder, ROBOTS))
    # The left arm, which comes first, has the last six columns of the file.
    np.testing.assert_allclose(
        IMPORTERS["motoman_contacts"].read(contacts[1]).angles[0],
        [0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7],
    )
    assert len(campaign.measurements) == 40
    assert [feature.name for feature in campaign.measuring.features] == [
        "wall_1",
        "other_arm",
    ]
    assert campaign.measuring.features[1].stated["radius_m"] == 0.116


def test_contacts_with_planes_are_those_of_the_right_arm(contacts, tmp_path):
    planes = replace(IMPORTERS["motoman_planes"], noise={"position_m": 3e-5})
    planes.write_campaign(contacts[:1], tmp_path / "mine", ROBOTS, "mine")
    campaign = read_campaign(read_campaign_folder(tmp_path / "mine", ROBOTS))
    assert campaign.noise == {"position_m": 3e-5}
    np.testing.assert_allclose(
        campaign.measurements.joint_angles[0], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    )
    with refused(contacts[1], "name", "no_leica_self", "no_leica_wall"):
        planes.write_campaign(contacts, tmp_path / "other", ROBOTS, "other")


def test_the_two_arms_of_the_motoman_are_its_arms_joined():
    arms = [
        read_robot(ROBOTS / f"motoman_{side}_arm.yaml") for side in ("left", "right")
    ]
    joined = join_arms(*arms)
    robot = read_robot(ROBOTS / "motoman_two_arms.yaml")
    assert robot.chain.points == joined.chain.points
    assert robot.base_moves
    np.testing.assert_array_equal(robot.reported_matrix, joined.reported_matrix)
    for transform, expected in zip(
        robot.chain.transforms, joined.chain.transforms, strict=True
    ):
        assert transform == replace(
            expected, constant=pytest.approx(expected.constant, abs=1e-12)
        )


def test_folds_hold_out_poses_of_recordings_in_sockets_too(recordings, tmp_path):
    folder = tmp_path / "mine"
    IMPORTERS["mukca_panda"].write_campaign(
        recordings, folder, ROBOTS, "mine", fold={"number": 2, "of": 3}
    )
    campaign = read_campaign(read_campaign_folder(folder, ROBOTS))
    assert campaign.holdout["poses"] == [[0, pose] for pose in range(1, 24, 3)]


def test_the_campaigns_of_the_repository_are_read(config, config_folder):
    sources = read_campaign_sources(config, config_folder)
    assert list(sources) == list_campaigns(config)
    for name, document in sources.items():
        expected = {"public", "included"}
        if name in config["loop"]["campaigns"]:
            expected = {"simulated"}
        assert document["source"] in expected
        assert ("robot_document" in document) == (document["source"] == "simulated")


def keep_one_campaign(config, name="mine"):
    """Return a configuration with one campaign and no data of the benchmark."""
    no_others = dict.fromkeys(("campaigns", "measured", "cameras", "sockets"), ())
    return config | {
        "loop": config["loop"] | {"main": [name]} | no_others,
        "league": config["league"] | {"data": {"all": {}}},
    }


@pytest.mark.parametrize(
    ("changes", "key", "phrases"),
    [
        ({"poses": 3}, "poses", ["found 3", "8 or more"]),
        ({"declared_robot": "fanuk"}, "robots", ["'fanuk'", "'fanuc'?"]),
        (
            None,
            "importer",
            [
                "'mine'",
                "fanuc_static, fanuc_cpa, fanuc_joint, jacobi, motoman, motoman_planes,",
            ],
        ),
    ],
)
def test_a_fault_in_a_campaigns_file_is_one_line_that_names_it(
    changes, key, phrases, config, config_folder, tmp_path
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
    with refused(path.as_posix(), key, *phrases):
        read_campaign_sources(keep_one_campaign(config), tmp_path, "study.yaml")


def write_users_campaign(tmp_path, **changes):
    """Write the folder of a user's campaign without measurements, and return its
    path."""
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


def find_users_campaign(config, robots, results):
    """Return the path of the folder of the user's own campaign, by its name."""
    campaigns = find_user_campaign(config, robots, results)
    return {name: folder.path.as_posix() for name, folder in campaigns.items()}


def test_a_users_own_campaign_has_one_spelling_however_its_folder_is_given(
    config, config_folder, tmp_path, monkeypatch
):
    """Results depend on the names of files. `elastocal diagnose` passes on an absolute
    path, and users type any path."""
    write_users_campaign(tmp_path)
    (tmp_path / "cell").rename(tmp_path / "2026")
    (tmp_path / "link").symlink_to(tmp_path / "2026")
    (tmp_path / "sibling").mkdir()
    assert (
        find_users_campaign(
            config | {"campaign": ""}, config_folder / "robots", tmp_path
        )
        == {}
    )
    spellings_by_directory = {
        "": ["2026", 2026, "./2026", "2026/../2026//", "link"],
        "sibling": ["../2026", "../link/"],
    }
    for directory, spellings in spellings_by_directory.items():
        monkeypatch.chdir(tmp_path / directory)
        for spelling in [*spellings, f"{tmp_path}/2026/"]:
            paths = find_users_campaign(
                config | {"campaign": spelling},
                config_folder / "robots",
                tmp_path / "results",
            )
            assert paths == {"cell7": f"{tmp_path}/2026" if directory else "2026"}


@pytest.mark.parametrize(
    ("changes", "key", "phrases"),
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
def test_a_fault_in_a_users_own_campaign_is_one_line_that_names_its_file(
    changes, key, phrases, config, config_folder, tmp_path
):
    folder = write_users_campaign(tmp_path, **changes)
    with refused(f"{folder}/campaign.yaml", key, *phrases):
        find_users_campaign(
            config | {"campaign": folder}, config_folder / "robots", tmp_path
        )
    (tmp_path / "a{x}b").mkdir()
    folder = write_users_campaign(tmp_path / "a{x}b")
    with refused(f"{folder}/campaign.yaml", "", "'{'", "a path without it"):
        find_users_campaign(
            config | {"campaign": folder}, config_folder / "robots", tmp_path
        )


def test_two_campaigns_of_one_name_are_refused_while_both_exist(
    config, config_folder, tmp_path
):
    """The second would overwrite the reports of the first."""
    folder = write_users_campaign(tmp_path)
    results = tmp_path / "results"
    earlier = tmp_path / "other"
    (results / "cell7").mkdir(parents=True)
    earlier.mkdir()

    def find_with_results_of(source):
        """Find the campaign while the results of its name have another source."""
        (results / "cell7/campaign.json").write_text(
            json.dumps({"source": source}), encoding="utf-8"
        )
        return find_users_campaign(
            config | {"campaign": folder}, config_folder / "robots", results
        )

    with refused(
        f"{folder}/campaign.yaml",
        "campaign",
        "'cell7', whose results are of",
        str(earlier),
        f"{results}/cell7",
    ):
        find_with_results_of(f"{earlier}/campaign.yaml")
    # Nothing is overwritten if the results are of the same folder by another path, of a
    # folder that does not exist any more, or of an unknown folder.
    for source in (
        f"{earlier}/../cell/campaign.yaml",
        f"{tmp_path}/gone/campaign.yaml",
        7,
    ):
        assert find_with_results_of(source) == {"cell7": folder}


def test_campaigns_that_validate_each_other_have_the_files_of_both(
    config, config_folder, tmp_path
):
    folder = write_users_campaign(tmp_path, holdout={"campaign": "../other"})
    shutil.copytree(folder, tmp_path / "other", symlinks=True)
    (tmp_path / "other/campaign.yaml").write_text(
        (tmp_path / "cell/campaign.yaml")
        .read_text()
        .replace("../other", "../cell")
        .replace("cell7", "cell8")
    )
    robots = config_folder / "robots"
    campaigns = find_user_campaign(config | {"campaign": folder}, robots, tmp_path)
    expected = [
        f"{folder}/campaign.yaml",
        f"{robots}/kuka.yaml",
        f"{folder}/../other/campaign.yaml",
        f"{robots}/kuka.yaml",
    ]
    assert campaigns["cell7"].files() == expected
