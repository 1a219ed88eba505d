"""Files of a campaign lie in its folder, wherever links lead."""

import os

import pytest

from elastocal.campaigns.places import is_file_in


@pytest.fixture
def places(tmp_path):
    for name in ("cell/deep", "elsewhere", "linked"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "a").write_text("x")
    (tmp_path / "cell/out").symlink_to(tmp_path / "elsewhere/a")
    (tmp_path / "cell/inside").symlink_to("deep/a")
    (tmp_path / "cell/loop").symlink_to("loop")
    (tmp_path / "alias").symlink_to("cell")
    os.mkfifo(tmp_path / "cell/pipe")
    return tmp_path


@pytest.mark.parametrize(
    ("path", "inside"),
    [
        ("cell/deep/a", True),
        ("cell/inside", True),
        ("alias/deep/a", True),
        ("cell/../cell/deep/a", True),
        ("cell/out", False),
        ("cell/../elsewhere/a", False),
        ("elsewhere/a", False),
        ("cell/none", False),
        ("cell/loop", False),
        ("cell/pipe", False),
        ("cell/deep", False),
        ("cell/" + "x" * 5000, False),
        ("cell/\0", False),
    ],
)
def test_a_file_is_where_its_links_lead(places, path, inside):
    assert is_file_in(places / path, places / "cell") is inside
    assert is_file_in(places / path, places / "linked", places / "alias") is inside
