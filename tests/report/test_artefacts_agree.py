"""What stands in several artefacts of a campaign is the same in all: PDF, HTML, verdict.json and the terminal."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from drawn_figures import empty_pictures
from made_loop_tables import CAMPAIGNS, facts_of, plainly, residual_table

from elastocal.report.loop_facts import write_loop_report
from elastocal.report.loop_page import loop_page, write_loop_page
from elastocal.report.outcome import outcome

PICTURES = ["arrows", "before_after", "candidates"]


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    return empty_pictures(tmp_path_factory.mktemp("figures"), PICTURES)


@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_artefacts_of_every_verdict_agree(campaign, kuka, pictures, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    verdict, folder = CAMPAIGNS[campaign], Path("reports/loop/made")
    folder.mkdir(parents=True)
    facts = facts_of(verdict)
    (folder / "verdict.json").write_text(json.dumps(verdict), encoding="utf-8")
    write_loop_report(folder / "report.pdf", facts, pictures)
    write_loop_page(folder / "report.html", *loop_page(facts, residual_table(), kuka))
    assert_agree(folder)


def assert_agree(folder):
    verdict = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))
    page = (folder / "report.html").read_text(encoding="utf-8")
    page = page[: page.index('<script type="application/json"')]
    texts = {"report.html": bare(html.unescape(re.sub(r"<style>.*?</style>|<[^>]+>", " ", page, flags=re.DOTALL)))}
    if shutil.which("pdftotext"):
        shown = ["pdftotext", "-raw", str(folder / "report.pdf"), "-"]
        texts["report.pdf"] = bare(subprocess.run(shown, capture_output=True, text=True, check=True).stdout)
    terminal = bare(" ".join(outcome([f"reports/loop/{folder.name}/report.pdf"])))
    faulty = verdict["probabilities"] is None
    for name, text in (texts | {"the terminal": terminal}).items():
        errors = verdict["heldout"]
        regressed = errors["delivered"] != errors["after"]
        stages = ("uncalibrated", *(["after"] if regressed else []), "delivered")
        figures = " ?→ ?".join([r"([\d.]+)"] * len(stages))
        stated = [] if faulty else re.findall(rf"{figures} mm(?: ?\(noise ([\d.]+)\))?", text)
        assert faulty or len(stated) == 1, name
        wanted = [*(errors[stage]["rms_m"] for stage in stages), errors["noise_floor_rms_m"]]
        for value, expected in zip(stated[0] if stated else (), wanted, strict=False):
            assert (not value and not expected) or close(value, 1e3 * expected), name
    for name, text in texts.items():
        for effect in [] if faulty else verdict["effects"]:
            # On page 1 its probability and its cost follow each other.
            known = effect["cost_m"] is not None
            cost = r"((?:below )?[\d.]+) mm" if known else r"(not in the final model|an error of the measurement)"
            found = re.findall(rf"([<>]? ?\d+) % {cost}", text)
            sure = [value for probability, value in found if matches(probability, effect["probability"])]
            assert any(not known or costs(value, 1e3 * effect["cost_m"]) for value in sure), (name, effect["name"], found)


def bare(text):
    """With single blanks, for breaks of lines differ from one artefact to the next."""
    return re.sub(r"\s+", " ", plainly(text).replace("\u200b", ""))


def matches(stated, probability):
    if stated[0] in "<>":
        return probability < 0.005 if stated[0] == "<" else probability >= 0.995
    return abs(int(stated.strip()) - 100 * probability) <= 0.5 + 1e-9


def costs(stated, expected):
    return expected < float(stated.removeprefix("below ")) if stated.startswith("below ") else close(stated, expected)


def close(stated, expected):
    return float(stated) == pytest.approx(expected, rel=5e-3, abs=5.1e-4)
