"""What `snakemake --report` shows of a finished study: every figure and table, with a caption that says what it is."""

import re

import pytest
from study_folder import PAPER, REPOSITORY

CAPTIONS = REPOSITORY / "workflow" / "report"
SHOWN = re.compile(r'shown\(\s*"(reports/[^"]+)",\s*"(\w+)",\s*"([^"]+)"')
# Of a campaign's pictures, which one rule draws.
DRAWN = [f"loop_{figure}" for figure in ("before_after", "arrows", "candidates")]
RULES = [path.read_text(encoding="utf-8") for path in sorted((REPOSITORY / "workflow" / "rules").glob("*.smk"))]


def shown():
    return [found for text in RULES for found in SHOWN.findall(text)]


def test_every_caption_is_there_and_every_page_is_a_caption():
    pages = {path.stem for path in CAPTIONS.glob("*.rst")}
    named = {name for text in RULES for name in re.findall(r'"(\w+)"', text)} | {"workflow", *DRAWN}
    assert {caption for _, caption, _ in shown()} <= pages <= named


@pytest.fixture(scope="module")
def report(paper, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    done = paper.snakemake(PAPER, "--report", str(path))
    assert done.returncode == 0, done.stderr
    return path.read_text(encoding="utf-8")


def test_the_report_shows_tables_figures_and_rules_names_what_they_were_made_from_and_fetches_nothing(report, paper):
    for words in ("Figure 4: impact of noise", "Table 4: strategies", "Tables and figures of the paper", "rulegraph"):
        assert words in report
    record = paper.path(paper.files("results/records/reports/**/*.json")[0]).read_text(encoding="utf-8")
    assert re.search(r'"configuration_sha256": "(\w+)"', record)[1] in report
    assert re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="https?://[^"]*"', report) == []
