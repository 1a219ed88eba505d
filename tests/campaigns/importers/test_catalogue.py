"""Importers are found by themselves, say which files and robots they need, and are named where a name is wrong."""

import pytest
from support import refused

import elastocal.campaigns.importers
from elastocal.campaigns.importers.catalogue import check_importer, importer, importers
from elastocal.io.documents import read_document

NEW = """FILES, ROBOTS = {}, ("ur10",)


def write_campaign(path, folder, name, holdout=None):
    pass
"""


def test_each_file_has_a_whole_digest_and_each_robot_is_there(config_folder):
    for module in importers().values():
        assert module.FILES and module.ROBOTS
        assert all(len(file.sha256) == 64 and len(file.commit) == 40 for file in module.FILES.values())
        assert all((config_folder / "robots" / f"{robot}.yaml").is_file() for robot in module.ROBOTS)


def test_campaigns_of_the_repository_name_files_of_their_importer(config_folder):
    documents = [read_document(path) for path in (config_folder / "campaigns").glob("*.yaml")]
    public = [document for document in documents if document["source"] == "public"]
    assert {document["importer"] for document in public} == set(importers())
    assert all(set(document["files"]) <= set(importers()[document["importer"]].FILES) for document in public)


def test_a_new_module_is_a_new_importer(tmp_path, monkeypatch):
    (tmp_path / "just_added.py").write_text(NEW, encoding="utf-8")
    monkeypatch.setattr(elastocal.campaigns.importers, "__path__", [*elastocal.campaigns.importers.__path__, str(tmp_path)])
    check_importer("just_added", "mine.yaml")
    assert importer("just_added", "mine.yaml").ROBOTS == ("ur10",)
    assert "just_added" in importers()


@pytest.mark.parametrize("name", ["nobody", "reflectors"])
def test_a_name_of_none_is_refused_with_those_that_there_are(name):
    """What importers share is no importer."""
    with refused("mine.yaml", "importer", repr(name), "fanuc_cpa, fanuc_joint, fanuc_static, jacobi, motoman, ur10_ipa"):
        importer(name, "mine.yaml")
