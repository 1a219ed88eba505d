"""A certificate is typeset with and without a comparison."""

import pytest
from drawn_figures import empty_pictures
from made_certificates import made_comparison, made_document

from elastocal.report.certificate_pages import write_certificate
from elastocal.report.certificate_words import certificate_facts


@pytest.mark.parametrize(
    "comparison", [None, made_comparison(), made_comparison(0.5, 0)], ids=["none", "changes", "no changes"]
)
@pytest.mark.parametrize("decision", ["pass", "fail", "undecided"])
def test_every_kind_of_certificate_is_typeset(tmp_path, comparison, decision):
    pictures = empty_pictures(tmp_path, ["workspace", "budget"])
    path = tmp_path / "certificate.pdf"
    write_certificate(path, certificate_facts(made_document(decision, comparison)), pictures)
    assert path.read_bytes().startswith(b"%PDF")
