"""Public data: only contents of the known digest are used, from a folder or from the network, and faults are one line."""

import hashlib
import http.server
import os
import shutil
import threading
from functools import partial
from pathlib import Path

import pytest
from support import refused

from elastocal.campaigns.importers.jacobi import FILES
from elastocal.campaigns.public_data import FOLDER_VARIABLE, PublicFile, fetch, find_missing

CONTENTS = b"0 1 2\n"
BOX = Path(__file__).resolve().parents[2] / "data" / "measured"
BOXED = "jacobi_ur5_every_seventh"


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture
def registered(monkeypatch):
    """One made-up file, by the name "mine"."""
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    digest = hashlib.sha256(CONTENTS).hexdigest()
    return PublicFile("owner/name", "c0ffee", "data/values.csv", digest, "mine/values.csv", "MIT")


@pytest.fixture
def given(monkeypatch, tmp_path):
    """The file in a folder that stands for the network."""
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "values.csv").write_bytes(CONTENTS)
    return tmp_path / "mine" / "values.csv"


@pytest.fixture
def served(registered, monkeypatch, tmp_path):
    """Folder that a server on this machine offers in place of the public one."""
    folder = tmp_path / "served"
    (folder / "data").mkdir(parents=True)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    address = f"http://127.0.0.1:{server.server_port}/{registered.path}"
    monkeypatch.setattr(PublicFile, "address", address)
    yield folder / "data" / "values.csv"
    server.shutdown()
    thread.join()
    server.server_close()


def test_file_of_the_given_folder_is_used_where_it_lies(registered, given, tmp_path):
    assert fetch("mine", {"mine": registered}, tmp_path / "cache", tmp_path / "box") == given
    assert find_missing(["mine"], {"mine": registered}, tmp_path / "cache", tmp_path / "box") is None
    assert not (tmp_path / "cache").exists()


def test_file_of_the_given_folder_with_other_contents_is_refused(registered, given, tmp_path):
    given.write_bytes(CONTENTS + b"\n")
    with refused(given, "", "SHA-256", registered.sha256, registered.address):
        fetch("mine", {"mine": registered}, tmp_path / "cache", tmp_path / "box")


def test_file_that_the_given_folder_lacks_is_downloaded_once(registered, served, monkeypatch, tmp_path):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    served.write_bytes(CONTENTS)
    kept = fetch("mine", {"mine": registered}, tmp_path / "cache", tmp_path / "box")
    assert kept.parent == tmp_path / "cache" and kept.read_bytes() == CONTENTS
    served.unlink()
    assert fetch("mine", {"mine": registered}, tmp_path / "cache", tmp_path / "box") == kept


def test_download_of_other_contents_is_refused_and_not_kept(registered, served, tmp_path):
    served.write_bytes(b"something else")
    with refused(PublicFile.address, "", "other contents", "SHA-256"):
        fetch("mine", {"mine": registered}, tmp_path / "cache", tmp_path / "box")
    assert list((tmp_path / "cache").iterdir()) == []


def test_download_that_fails_is_refused_and_tells_of_the_folder(registered, served, tmp_path):
    with refused(PublicFile.address, "", "404", FOLDER_VARIABLE, "mine/values.csv"):
        fetch("mine", {"mine": registered}, tmp_path / "cache", tmp_path / "box")


def test_unknown_name_is_refused(registered, tmp_path):
    with refused("public data", "", "'yours'", "mine"):
        fetch("yours", {"mine": registered}, tmp_path, tmp_path / "box")


def test_what_is_missing_is_named_only_where_a_folder_stands_for_the_network(registered, monkeypatch, tmp_path):
    files = {"mine": registered}
    assert find_missing(["mine"], files, tmp_path / "cache", tmp_path / "box") is None
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    assert find_missing(["mine"], files, tmp_path / "cache", tmp_path / "box") == "mine/values.csv"


def test_what_was_downloaded_before_is_at_hand(registered, served, monkeypatch, tmp_path):
    served.write_bytes(CONTENTS)
    files = {"mine": registered}
    fetch("mine", files, tmp_path / "cache", tmp_path / "box")
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "empty"))
    assert find_missing(["mine"], files, tmp_path / "cache", tmp_path / "box") is None


@pytest.fixture
def box(monkeypatch, tmp_path):
    """A copy of the data that come with the project, on a machine without anything else."""
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    return Path(shutil.copytree(BOX, tmp_path / "box"))


def test_what_comes_with_the_project_is_used_where_it_lies(box, tmp_path):
    assert fetch(BOXED, FILES, tmp_path / "cache", box) == box / FILES[BOXED].local
    assert not (tmp_path / "cache").exists()


def test_one_changed_byte_of_it_is_refused(box, tmp_path):
    path = box / FILES[BOXED].local
    contents = bytearray(path.read_bytes())
    contents[-2] ^= 1
    path.write_bytes(contents)
    with refused(path, "", hashlib.sha256(contents).hexdigest(), FILES[BOXED].sha256):
        fetch(BOXED, FILES, tmp_path / "cache", box)


def test_an_excerpt_that_is_not_there_is_not_looked_for_in_the_network(box, tmp_path):
    (box / FILES[BOXED].local).unlink()
    with refused(box / FILES[BOXED].local, "", "no such file"):
        fetch(BOXED, FILES, tmp_path / "cache", box)


def test_licence_and_source_stand_beside_it():
    file, page = FILES[BOXED], (BOX / "README.md").read_text(encoding="utf-8")
    assert "MIT License" in (BOX / file.local).with_name("LICENSE").read_text(encoding="utf-8")
    for said in (
        file.repository,
        file.commit,
        file.path,
        file.sha256,
        FILES["jacobi_ur5_grid"].sha256,
        "GTS3800",
        file.licence,
    ):
        assert said in page


def test_it_is_every_seventh_row_of_the_public_file():
    whole = Path(os.environ.get(FOLDER_VARIABLE, "")) / FILES["jacobi_ur5_grid"].local
    if not whole.is_file():
        pytest.skip(f"the public file is not in the folder of {FOLDER_VARIABLE}")
    header, *rows = whole.read_text(encoding="utf-8").splitlines()
    assert (BOX / FILES[BOXED].local).read_text(encoding="utf-8").splitlines() == [header, *rows[::7]]
