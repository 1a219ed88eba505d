"""The lines that follow a cell of Table 3 to the measured rows run as they are written,
in the folder of a finished study."""

import re
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "audit.md"


def code():
    (block,) = re.findall(
        r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL
    )
    return block


def run(folder, text):
    return subprocess.run(
        [sys.executable, "-c", text],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_cell_of_table_3_follows_from_the_measured_rows(paper):
    done = run(paper.folder, code())
    assert done.returncode == 0, done.stderr
    assert "elastocal" not in code()
    assert "1e-12" in code()


def test_another_number_is_noticed(paper):
    changed = code().replace('("x", 1.150)', '("x", 1.151)')
    assert changed != code() and run(paper.folder, changed).returncode != 0
