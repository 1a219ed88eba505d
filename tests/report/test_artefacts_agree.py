"""PDF, page, verdict.json and terminal state the same numbers of a campaign."""

import html
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from drawn_figures import empty_pictures
from made_loop_tables import CAMPAIGNS, facts_of, plainly, residual_table

from elastocal.report.loop_page import build_loop_page, write_loop_page
from elastocal.report.outcome import describe_outcome
from elastocal.report.typesetting import compile_document
from elastocal.verdict import write_verdict

PICTURES = ["arrows", "before_after", "candidates"]


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    return empty_pictures(tmp_path_factory.mktemp("figures"), PICTURES)


def normalize_blanks(text):
    """Replace blanks and line breaks, which differ between artefacts, by one blank."""
    return re.sub(r"\s+", " ", plainly(text).replace("\u200b", ""))


@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_artefacts_of_every_verdict_agree(
    campaign, kuka, pictures, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    verdict = CAMPAIGNS[campaign]
    folder = Path("reports/loop/made")
    folder.mkdir(parents=True)
    facts = facts_of(verdict)
    write_verdict(folder / "verdict.json", verdict)
    compile_document(folder / "report.pdf", "loop.typ", {"facts": facts}, pictures)
    write_loop_page(
        folder / "report.html", *build_loop_page(facts, residual_table(), kuka)
    )
    page = (
        (folder / "report.html")
        .read_text(encoding="utf-8")
        .partition('<script type="application/json"')[0]
    )
    texts = {
        "page": normalize_blanks(
            html.unescape(
                re.sub(r"<style>.*?</style>|<[^>]+>", " ", page, flags=re.DOTALL)
            )
        )
    }
    if shutil.which("pdftotext"):
        shown = ["pdftotext", "-raw", str(folder / "report.pdf"), "-"]
        texts["report"] = normalize_blanks(
            subprocess.run(shown, capture_output=True, text=True, check=True).stdout
        )
    faulty = bool(verdict.faults)
    errors = verdict.heldout
    stages = [
        "before",
        *(["after"] if errors.delivered != errors.after else []),
        "delivered",
    ]
    wanted = [] if faulty else [1e3 * getattr(errors, stage).rms_m for stage in stages]
    for name, text in (
        texts
        | {
            "terminal": normalize_blanks(
                " ".join(describe_outcome([f"{folder}/report.pdf"]))
            )
        }
    ).items():
        matches = re.findall(
            rf"{' ?→ ?'.join([r'([0-9.]+)'] * len(stages))} mm(?: ?\(noise ([\d.]+)\))?",
            text,
        )
        *stated, noise = matches[0] if matches and not faulty else [""]
        assert [float(value) for value in stated] == pytest.approx(
            wanted, rel=5e-3, abs=5.1e-4
        ), name
        floor_m = 0.0 if faulty else errors.noise_floor_rms_m
        assert float(noise or 0) == pytest.approx(
            1e3 * (floor_m or 0), rel=5e-3, abs=5.1e-4
        ), name
    # On page 1 the probability of a cause and its cost follow each other.
    causes = [
        plainly(f"{row['words']} {row['cost']}").partition(":")[0]
        for row in facts["causes"]
        if row["cost"]
    ]
    assert len(causes) == (0 if faulty else len(verdict.effects))
    assert [
        (name, cause)
        for name, text in texts.items()
        for cause in causes
        if cause not in text
    ] == []
