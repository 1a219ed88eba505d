"""Pictures and tables in docs are those of the run that CI has just made.

CI runs `make paper`, `make study` and `make pictures` before the tests. The last one
replaces the copies in docs by the files of this run; these tests compare them with the
copies that are committed. In a checkout without a run both are the same.
"""

import io
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
# Another processor changes results in the ninth digit, and a curve by part of a pixel.
RELATIVE_DIFFERENCE = 1e-5
# Root mean square difference of two pictures in grey levels of 255. Identical runs give
# 0; a bar that is a millimetre longer in print gives more than 1.
LARGEST_PICTURE_DIFFERENCE = 0.5
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")


def committed(path):
    """Content of a file in the commit that is checked out."""
    command = ["git", "show", f"HEAD:{path}"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout


def tracked_files(pattern):
    command = ["git", "ls-files", "--", pattern]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    return listed.stdout.split()


def pixels(content):
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"), float)


def picture_difference(first, second):
    """Root mean square difference in grey levels; infinite if the sizes differ."""
    if first.shape != second.shape:
        return np.inf
    return np.sqrt(((first - second) ** 2).mean())


@pytest.mark.parametrize("path", tracked_files("docs/*.png"))
def test_a_picture_is_the_one_that_the_run_draws(path):
    drawn = pixels((ROOT / path).read_bytes())
    difference = picture_difference(pixels(committed(path)), drawn)
    assert difference < LARGEST_PICTURE_DIFFERENCE


@pytest.mark.parametrize("path", [*tracked_files("docs/*.csv"), "docs/study_tables.md"])
def test_a_table_has_the_numbers_and_words_of_the_run(path):
    old = committed(path).decode()
    new = (ROOT / path).read_text(encoding="utf-8")
    assert NUMBER.sub("", old) == NUMBER.sub("", new)
    np.testing.assert_allclose(
        [float(number) for number in NUMBER.findall(new)],
        [float(number) for number in NUMBER.findall(old)],
        rtol=RELATIVE_DIFFERENCE,
    )


def test_a_longer_bar_counts_as_another_picture():
    picture = pixels((ROOT / "docs/measured_in_the_box.png").read_bytes())
    changed = picture.copy()
    changed[50:72, 240:250] = (0, 114, 178)
    assert picture_difference(picture, changed) > LARGEST_PICTURE_DIFFERENCE
    assert picture_difference(picture, changed[:-1]) == np.inf
