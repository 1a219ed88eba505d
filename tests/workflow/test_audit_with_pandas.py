"""The page that follows Table 4 to raw data runs as it is written, in the folder of a finished study."""

import re
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "audit_with_pandas.md"


def code():
    (found,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return found


def run(folder, text):
    return subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, check=False)


def test_three_numbers_of_table_4_follow_from_raw_data(paper):
    done = run(paper.folder, code())
    assert done.returncode == 0, done.stderr
    assert "import elastocal" not in code() and len([line for line in code().splitlines() if line.strip()]) <= 20


def test_another_number_is_noticed(paper):
    changed = code().replace("k_sigma_20_percent, rtol", "dev_20_um, rtol")
    assert changed != code() and run(paper.folder, changed).returncode != 0
