"""Campaigns that a configuration names, and the user's own, are checked before any job starts; a fault is one line."""

import json
import shutil

import pytest
import yaml
from support import refused

from elastocal.campaigns.reading import campaign_files
from elastocal.campaigns.sources import campaign_sources, named_campaigns, user_campaign
from elastocal.io.documents import read_document


def test_campaigns_of_the_repository_pass(config, config_folder):
    sources = campaign_sources(config, config_folder)
    assert list(sources) == named_campaigns(config)
    for name, document in sources.items():
        assert document["source"] == ("simulated" if name in config["loop"]["campaigns"] else "public")
        assert ("robot_document" in document) == (document["source"] == "simulated")


def of_one_campaign(config, name="mine"):
    nobody = config["league"] | {"data": {"all": {}}}
    return config | {"loop": config["loop"] | {"main": [name], "campaigns": [], "measured": []}, "league": nobody}


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"poses": 3}, "poses", ["found 3", "8 or more"]),
        ({"declared_robot": "fanuk"}, "robots", ["'fanuk'", "'fanuc'?"]),
        (None, "importer", ["'mine'", "fanuc_static, fanuc_cpa, fanuc_joint, jacobi, motoman, ur10_ipa"]),
    ],
)
def test_fault_in_a_campaigns_file_is_one_line_that_names_it(changes, key, words, config, config_folder, tmp_path):
    for name in ("robots", "public_data.yaml"):
        (tmp_path / name).symlink_to(config_folder / name)
    simulated = read_document(config_folder / "campaigns" / f"{config['loop']['campaigns'][0]}.yaml")
    document = {"source": "public", "importer": "mine", "files": ["a"]} if changes is None else simulated | changes
    path = tmp_path / "campaigns" / "mine.yaml"
    path.parent.mkdir()
    path.write_text(yaml.safe_dump(document))
    with refused(path.as_posix(), key, *words):
        campaign_sources(of_one_campaign(config), tmp_path, "study.yaml")


def users_folder(tmp_path, **changes):
    document = {"campaign": "cell7", "robot": "kuka", "measured": "position", "frame": "base"} | changes
    folder = tmp_path / "cell"
    folder.mkdir()
    (folder / "campaign.yaml").write_text(
        yaml.safe_dump(document | {"targets": {"A": {"point": "6DoF", "offset_m": [0, 0, 0]}}})
    )
    return folder.as_posix()


def test_a_users_own_campaign_has_one_spelling_however_its_folder_is_given(config, config_folder, tmp_path, monkeypatch):
    """Results are of files by their names: `elastocal diagnose` hands on an absolute path, people type any."""
    users_folder(tmp_path)
    (tmp_path / "cell").rename(tmp_path / "2026")
    (tmp_path / "link").symlink_to(tmp_path / "2026")
    (tmp_path / "beside").mkdir()
    assert user_campaign(config | {"campaign": ""}, config_folder / "robots", tmp_path) == {}
    everywhere = {"": ["2026", 2026, "./2026", "2026/../2026//", "link"], "beside": ["../2026", "../link/"]}
    for place, given in everywhere.items():
        monkeypatch.chdir(tmp_path / place)
        for each in [*given, f"{tmp_path}/2026/"]:
            found = user_campaign(config | {"campaign": each}, config_folder / "robots", tmp_path / "results")
            assert found == {"cell7": f"{tmp_path}/2026" if place else "2026"}


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"campaign": "cell/7"}, "campaign", ["'cell/7'", "letters, digits"]),
        ({"campaign": "kuka_nothing_missing"}, "campaign", ["kuka_nothing_missing", "no campaign of"]),
        ({"holdout": {"campaign": "../other"}}, "holdout.campaign", ["'../other'", "beside"]),
        ({"holdout": {"campaign": "."}}, "holdout.campaign", ["'.', the campaign itself"]),
    ],
)
def test_fault_in_a_users_own_campaign_is_one_line_that_names_its_file(changes, key, words, config, config_folder, tmp_path):
    folder = users_folder(tmp_path, **changes)
    with refused(f"{folder}/campaign.yaml", key, *words):
        user_campaign(config | {"campaign": folder}, config_folder / "robots", tmp_path)
    (tmp_path / "a{x}b").mkdir()
    folder = users_folder(tmp_path / "a{x}b")
    with refused(f"{folder}/campaign.yaml", "", "braces", "without braces"):
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
