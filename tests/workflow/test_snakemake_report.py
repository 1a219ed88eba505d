"""What `snakemake --report` shows of a finished study: every figure and table has a
caption that says what it is."""

import re

from study_folder import REPOSITORY

CAPTIONS = REPOSITORY / "workflow" / "report"
SHOWN = re.compile(r'shown\(\s*"(reports/[^"]+)",\s*"(\w+)",\s*"([^"]+)"')
# Of a campaign's pictures, which one rule draws.
DRAWN = [f"loop_{figure}" for figure in ("before_after", "arrows", "candidates")]
RULES = [
    path.read_text(encoding="utf-8")
    for path in sorted((REPOSITORY / "workflow" / "rules").glob("*.smk"))
]


def shown():
    return [caption for text in RULES for caption in SHOWN.findall(text)]


def test_every_caption_is_there_and_every_page_is_a_caption():
    pages = {path.stem for path in CAPTIONS.glob("*.rst")}
    named = {name for text in RULES for name in re.findall(r'"(\w+)"', text)} | {
        "workflow",
        *DRAWN,
    }
    assert {caption for _, caption, _ in shown()} <= pages <= named
