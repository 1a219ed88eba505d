"""SECURITY.md promises nothing without a test: each that it names is there."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_every_test_that_the_page_names_is_there():
    named = set(re.findall(r"`(test_\w+)`", (ROOT / "SECURITY.md").read_text(encoding="utf-8")))
    there = {
        name for path in (ROOT / "tests").rglob("test_*.py") for name in re.findall(r"def (test_\w+)", path.read_text("utf-8"))
    }
    assert len(named) > 10 and named <= there, named - there


def test_every_sentence_of_what_holds_names_its_test():
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    for paragraph in ("Writing", "At the door", "Supply chain", "What a pass rests on"):
        body = text.split(f"**{paragraph}.** ")[1].split("\n\n")[0]
        sentences = re.split(r"(?<=[.)])\s+(?=[A-Z])", " ".join(body.split()))
        assert all("`test_" in sentence for sentence in sentences), [s for s in sentences if "`test_" not in s]
