"""Campaigns that a configuration names, and the user's own, are checked before any job starts; a fault is one line."""

import json
import shutil

import pytest
import yaml
from support import refused

from elastocal.campaigns.reading import campaign_files
from elastocal.campaigns.sources import campaign_sources, named_campaigns, user_campaign


def test_campaigns_of_the_repository_pass(config, config_folder):
    sources = campaign_sources(config, config_folder)
    assert list(sources) == named_campaigns(config)
    for name, document in sources.items():
        assert document["source"] == ("simulated" if name in config["loop"]["campaigns"] else "public")
        assert ("robot_document" in document) == (document["source"] == "simulated")


def of_one_campaign(config, name="mine"):
    nobody = config["league"] | {"data": {"all": {}}}
    return config | {"loop": config["loop"] | {"main": [name], "campaigns": [], "measured": []}, "league": nobody}


SIMULATED = {"source": "simulated", "robot": "kuka", "declared_robot": "kuka", "points": ["6DoF"], "poses": 8, "force_N": 100}
SIMULATED |= {"ladder": [0, 1], "offset_m": [0, 0, 0], "repeats": 1, "repeated_poses": 0, "noise_m": 0, "noise_rad": 0}
FAULTY_SOURCES = {
    "value out of range": ({"poses": 3}, "poses", ["found 3", "8 or more"]),
    "unknown declared robot": ({"declared_robot": "fanuk"}, "robots", ["'fanuk'", "'fanuc'?"]),
    "unknown importer": (
        {**dict.fromkeys(SIMULATED), "source": "public", "importer": "mine", "files": ["a"]},
        "importer",
        ["'mine'", "fanuc_static, fanuc_cpa, fanuc_joint, jacobi, motoman, ur10_ipa"],
    ),
}


@pytest.fixture
def campaigns_folder(config_folder, tmp_path):
    """The repository's robots and one campaign."""
    for name in ("robots", "public_data.yaml"):
        (tmp_path / name).symlink_to(config_folder / name)
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "campaigns" / "mine.yaml").write_text(yaml.safe_dump(SIMULATED))
    return tmp_path


@pytest.mark.parametrize("fault", FAULTY_SOURCES)
def test_fault_in_a_campaigns_file_is_one_line_that_names_it(fault, config, campaigns_folder):
    changes, key, words = FAULTY_SOURCES[fault]
    path = campaigns_folder / "campaigns" / "mine.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in (SIMULATED | changes).items() if v is not None}))
    with refused(path.as_posix(), key, *words):
        campaign_sources(of_one_campaign(config), campaigns_folder, "study.yaml")


def users_folder(tmp_path, **changes):
    document = {
        "campaign": "cell7",
        "robot": "kuka",
        "measured": "position",
        "frame": "base",
        "targets": {"A": {"point": "6DoF", "offset_m": [0, 0, 0]}},
    }
    folder = tmp_path / "cell"
    folder.mkdir()
    (folder / "campaign.yaml").write_text(yaml.safe_dump(document | changes))
    return folder.as_posix()


def test_a_users_own_campaign_is_known_by_its_name(config, config_folder, tmp_path):
    folder = users_folder(tmp_path)
    assert user_campaign(config | {"campaign": folder}, config_folder / "robots", tmp_path) == {"cell7": folder}
    assert user_campaign(config | {"campaign": ""}, config_folder / "robots", tmp_path) == {}


def test_a_users_own_campaign_has_one_spelling_however_its_folder_is_given(config, config_folder, tmp_path, monkeypatch):
    """Results are of files by their names: `elastocal diagnose` hands on an absolute path, people type any."""
    users_folder(tmp_path)
    (tmp_path / "cell").rename(tmp_path / "2026")
    (tmp_path / "link").symlink_to(tmp_path / "2026")
    (tmp_path / "beside").mkdir()
    everywhere = {"": ["2026", 2026, "./2026", "2026/../2026//", "link"], "beside": ["../2026", "../link/"]}
    for place, given in everywhere.items():
        monkeypatch.chdir(tmp_path / place)
        for each in [*given, f"{tmp_path}/2026/"]:
            found = user_campaign(config | {"campaign": each}, config_folder / "robots", tmp_path / "results")
            assert found == {"cell7": f"{tmp_path}/2026" if place else "2026"}


OWN_FAULTS = {
    "name with a slash": ({"campaign": "cell/7"}, "campaign", ["'cell/7'", "letters, digits"]),
    "a simulated campaign's name": (
        {"campaign": "kuka_nothing_missing"},
        "campaign",
        ["kuka_nothing_missing", "no campaign of"],
    ),
    "another campaign that is not there": ({"holdout": {"campaign": "../other"}}, "holdout.campaign", ["'../other'", "beside"]),
    "itself for the test": ({"holdout": {"campaign": "."}}, "holdout.campaign", ["'.', the campaign itself"]),
}


@pytest.mark.parametrize("fault", OWN_FAULTS)
def test_fault_in_a_users_own_campaign_is_one_line_that_names_its_file(fault, config, config_folder, tmp_path):
    changes, key, words = OWN_FAULTS[fault]
    folder = users_folder(tmp_path, **changes)
    with refused(f"{folder}/campaign.yaml", key, *words):
        user_campaign(config | {"campaign": folder}, config_folder / "robots", tmp_path)


def test_two_campaigns_of_one_name_are_refused_while_both_are_there(config, config_folder, tmp_path):
    """The second would overwrite the reports of the first."""
    folder, results, other = users_folder(tmp_path), tmp_path / "results", tmp_path / "other"
    (results / "cell7").mkdir(parents=True)
    other.mkdir()

    def own(source):
        (results / "cell7/campaign.json").write_text(json.dumps({"source": source}), encoding="utf-8")
        return user_campaign(config | {"campaign": folder}, config_folder / "robots", results)

    with refused(f"{folder}/campaign.yaml", "campaign", "'cell7', whose results are of", str(other), f"{results}/cell7"):
        own(f"{other}/campaign.yaml")
    # The same folder by another path, one that is gone, and results that do not say: nothing is overwritten.
    for source in (f"{other}/../cell/campaign.yaml", f"{tmp_path}/gone/campaign.yaml", 7):
        assert own(source) == {"cell7": folder}


def test_two_campaigns_that_test_each_other_come_with_the_files_of_both(config, config_folder, tmp_path):
    folder = users_folder(tmp_path, holdout={"campaign": "../other"})
    shutil.copytree(folder, tmp_path / "other", symlinks=True)
    (tmp_path / "other/campaign.yaml").write_text(
        (tmp_path / "cell/campaign.yaml").read_text().replace("../other", "../cell").replace("cell7", "cell8")
    )
    robots = config_folder / "robots"
    assert user_campaign(config | {"campaign": folder}, robots, tmp_path) == {"cell7": folder}
    expected = [f"{folder}/campaign.yaml", f"{robots}/kuka.yaml", f"{folder}/../other/campaign.yaml", f"{robots}/kuka.yaml"]
    assert campaign_files(folder, robots) == expected


def test_a_path_with_braces_is_refused_before_snakemake_takes_them_for_wildcards(config, config_folder, tmp_path):
    (tmp_path / "a{x}b").mkdir()
    folder = users_folder(tmp_path / "a{x}b")
    with refused(f"{folder}/campaign.yaml", "", "braces", "without braces"):
        user_campaign(config | {"campaign": folder}, config_folder / "robots", tmp_path)
