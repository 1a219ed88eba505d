"""A certificate is typeset, predicted and measured, with what is misplaced and without."""

import pytest
from drawn_figures import empty_pictures
from made_certificates import made_document

from elastocal.report.certificate_pages import write_certificate
from elastocal.report.certificate_words import certificate_facts


@pytest.mark.parametrize("measured", [False, True])
@pytest.mark.parametrize("decision", ["pass", "fail", "undecided"])
def test_every_kind_of_certificate_is_typeset(tmp_path, measured, decision):
    pictures = empty_pictures(tmp_path, ["workspace", "budget"])
    path = tmp_path / "certificate.pdf"
    write_certificate(path, certificate_facts(made_document(decision, measured=measured)), pictures)
    assert path.read_bytes().startswith(b"%PDF")
