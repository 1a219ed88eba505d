"""`elastocal board` and `elastocal detect`: from a sheet to a table of poses."""

import numpy as np
import pytest
from made_images import CAMERA, make_views, render

from elastocal.exchange.board_pattern import make_pattern, read_pattern
from elastocal.exchange.camera_file import format_camera, read_camera

cv2 = pytest.importorskip("cv2")


def test_a_board_is_printed_with_its_description(elastocal, refusal, tmp_path):
    pdf = tmp_path / "board.pdf"
    result = elastocal("board", "--pdf", pdf, "--columns", 6, "--rows", 8)
    assert result.exit_code == 0, result.exception
    assert "must be 100 mm long" in result.output
    assert f"--board {tmp_path / 'board.yaml'}" in result.output.replace("\n", "")
    assert pdf.read_bytes().startswith(b"%PDF")
    # A4 in points of 1/72 inch.
    assert b"/MediaBox [ 0 0 595.275" in pdf.read_bytes()
    assert read_pattern(tmp_path / "board.yaml") == make_pattern("charuco", 6, 8, 0.025)
    assert "already there" in refusal("board", "--pdf", pdf).replace(
        "there already", "already there"
    )
    assert "--square: found 2000" in refusal(
        "board", "--pdf", tmp_path / "b" / "board.pdf", "--square", 2000
    )


@pytest.mark.parametrize("known", [True, False], ids=["intrinsics", "self-calibrated"])
def test_images_become_a_table_of_poses(elastocal, tmp_path, known):
    pattern = make_pattern("charuco", 6, 5, 0.03)
    images = tmp_path / "images"
    images.mkdir()
    for number, view in enumerate(zip(*make_views(pattern, 9), strict=True)):
        cv2.imwrite(str(images / f"{number}.png"), render(pattern, *view))
    cv2.imwrite(str(images / "9.png"), np.zeros((480, 640), np.uint8))
    from elastocal.exchange.board_pattern import format_pattern

    (tmp_path / "board.yaml").write_text(format_pattern(pattern))
    options = ["--board", tmp_path / "board.yaml", "--output", tmp_path / "boards.csv"]
    if known:
        (tmp_path / "known.yaml").write_text(format_camera(CAMERA))
        options += ["--intrinsics", tmp_path / "known.yaml"]
    result = elastocal("detect", images, *options)
    assert result.exit_code == 0, result.exception
    assert "9 poses of the board in 10 images" in result.output
    assert "left out: 9.png: 0 corners" in result.output
    next_step = result.output.partition("next: ")[2]
    assert "elastocal import board" in next_step and "--robot robot.yaml" in next_step
    assert len((tmp_path / "boards.csv").read_text().splitlines()) == 10
    assert (tmp_path / "camera.yaml").exists() != known
    if not known:
        assert read_camera(tmp_path / "camera.yaml").size == (640, 480)


def test_without_opencv_the_extra_is_named(monkeypatch, refusal, tmp_path):
    # None makes Python raise ModuleNotFoundError, as for a package that is not there.
    monkeypatch.setitem(__import__("sys").modules, "cv2", None)
    message = refusal("board", "--pdf", tmp_path / "board.pdf")
    assert "in the clone of elastocal, python -m pip install -e '.[camera]'" in message
