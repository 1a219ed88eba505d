"""Public data: only contents of the known digest are used, from a folder or from the network, and faults are one line."""

import hashlib
import http.server
import threading
from functools import partial

import pytest
from support import refused

from elastocal.campaigns.public_data import FOLDER_VARIABLE, PublicFile, fetch, find_missing

CONTENTS = b"0 1 2\n"


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
    assert fetch("mine", {"mine": registered}, tmp_path / "cache") == given
    assert find_missing(["mine"], {"mine": registered}, tmp_path / "cache") is None
    assert not (tmp_path / "cache").exists()


def test_file_of_the_given_folder_with_other_contents_is_refused(registered, given, tmp_path):
    given.write_bytes(CONTENTS + b"\n")
    with refused(given, "", "SHA-256", registered.sha256, registered.address):
        fetch("mine", {"mine": registered}, tmp_path / "cache")


def test_file_that_the_given_folder_lacks_is_downloaded_once(registered, served, monkeypatch, tmp_path):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    served.write_bytes(CONTENTS)
    kept = fetch("mine", {"mine": registered}, tmp_path / "cache")
    assert kept.parent == tmp_path / "cache" and kept.read_bytes() == CONTENTS
    served.unlink()
    assert fetch("mine", {"mine": registered}, tmp_path / "cache") == kept


def test_download_of_other_contents_is_refused_and_not_kept(registered, served, tmp_path):
    served.write_bytes(b"something else")
    with refused(PublicFile.address, "", "other contents", "SHA-256"):
        fetch("mine", {"mine": registered}, tmp_path / "cache")
    assert list((tmp_path / "cache").iterdir()) == []


def test_download_that_fails_is_refused_and_tells_of_the_folder(registered, served, tmp_path):
    with refused(PublicFile.address, "", "404", FOLDER_VARIABLE, "mine/values.csv"):
        fetch("mine", {"mine": registered}, tmp_path / "cache")


def test_unknown_name_is_refused(registered, tmp_path):
    with refused("public data", "", "'yours'", "mine"):
        fetch("yours", {"mine": registered}, tmp_path)


def test_what_is_missing_is_named_only_where_a_folder_stands_for_the_network(registered, monkeypatch, tmp_path):
    files = {"mine": registered}
    assert find_missing(["mine"], files, tmp_path / "cache") is None
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    assert find_missing(["mine"], files, tmp_path / "cache") == "mine/values.csv"
