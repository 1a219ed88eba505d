"""The pages of the blind proof compile with and without robots of the proof, and keep within their margins."""

import pytest
import typst
from compiled_pages import assert_within_margins, pages_of
from drawn_figures import empty_pictures
from made_blind_documents import oracle, silence, truth
from made_blind_facts import MEASURED, PROOF, facts_of

from elastocal_proof.report.blind_pages import write_blind_report

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


def test_a_report_without_one_of_its_figures_is_not_written(pictures, tmp_path):
    facts = facts_of(tmp_path, *PROOF[-1:])
    with pytest.raises(typst.TypstError, match="targets"):
        write_blind_report(f"{tmp_path}/blind.pdf", facts, pictures[1:])
    assert not list(tmp_path.glob("blind.pdf*"))
