"""The pages of the blind proof compile with and without robots of the proof, and keep within their margins."""

import pandas as pd
import pytest
from compiled_pages import assert_within_margins, pages_of
from drawn_figures import empty_pictures
from made_blind_documents import effect, frame, oracle, silence, truth, verdict
from made_blind_facts import MEASURED, PAYLOAD, PROOF, facts_of

from elastocal_proof.blind.calibration import statements
from elastocal_proof.blind.targets import of_each_robot, summarized
from elastocal_proof.report.blind_pages import targets_page, write_blind_report

FIGURES = ("targets", "power", "reliability", "confusion", "errors", "coverage", "sweep")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    return empty_pictures(tmp_path_factory.mktemp("figures"), FIGURES)


@pytest.mark.parametrize(
    "entries", [PROOF, ((truth(robot="kuka"), silence(), oracle(1.0)),)], ids=["proof", "robots of the tuning alone"]
)
def test_the_report_is_a_pdf_within_its_margins(entries, pictures, tmp_path, monkeypatch):
    pages = pages_of(monkeypatch)
    write_blind_report(f"{tmp_path}/blind.pdf", facts_of(tmp_path, *entries, follow_up=MEASURED), pictures)
    assert (tmp_path / "blind.pdf").read_bytes().startswith(b"%PDF")
    assert_within_margins(pages)


def test_the_page_of_targets_has_each_quantity_once_with_its_robots_and_its_limit():
    pairs = [truth(("payload",), ("joint_tilt", 2), group="pair", robot=robot) for robot in ("m900ib700", "panda")]
    both, best = verdict("several", effect("payload"), effect("joint_tilt", 2)), {"detected": True, "right": True}
    entries = [(pairs[0], both, oracle(), best), (pairs[1], PAYLOAD, oracle(), best), (pairs[1], both, oracle())]
    cases, stated = frame(*entries), statements((document, found) for document, found, *_ in entries)
    summary, alone = summarized(cases, pd.DataFrame(), stated, 1), of_each_robot(cases, stated, 1)
    page = targets_page(summary, {"The heavy one": alone["m900ib700"], "A soft one": alone["panda"]}, "full", 7)
    assert page.startswith("# ") and "blind_pictures --config blind=full seed=7`" in page
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("| ")]
    found = {row[0]: dict(zip(rows[0], row, strict=True)) for row in rows[1:]}
    # Of the quantities with a target those of single effects at 50 and 200 have no case, and so no row.
    assert len(found) == len(rows) - 1 == int((summary.target != "").sum())
    assert found["both of two effects, at 50 each"] == {
        "quantity": "both of two effects, at 50 each",
        "target": "at least 95 % of the limit",
        "outcome": "missed",
        "robots together": "66.7 % (9.4–99.2 %)",
        "cases": "2 of 3",
        "The heavy one": "100.0 %",
        "A soft one": "50.0 %",
        "limit, on a sample": "100.0 % (15.8–100.0 %), 2 of 2",
        "found over limit, same sample": "50.0 % (0.0–100.0 %)",
    }
    alarms = found["false alarms, 3 kN"]
    assert (alarms["outcome"], alarms["cases"], alarms["limit, on a sample"]) == ("no case", "0 of 0", "")
