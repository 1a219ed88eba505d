"""Collect what the page and the summary of a verification state, from its contents."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.report import words as say
from elastocal.report.typesetting import render_sentences
from elastocal.validation.conformity import PASS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

# Sections of the template that are lists of sentences; the others are one paragraph.
_LISTS = ("certificate",)
_TABLES = ("errors", "decisions", "identity", "data")


def collect_verification_facts(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the facts for the page of a verification: strings ready to print, and lists
    for tables.

    Parameters
    ----------
    document : mapping
        As `loop.verification.verify_campaign` returns it.
    """
    certificate = document["certificate"]
    passed = document["prediction"]["held"]
    if certificate is not None:
        passed = passed and certificate["measured"]["decision"] == PASS
    sections = render_sentences(
        "verification.txt", say.FILTERS, document=document, passed=passed
    )
    as_they_are = (*_LISTS, *_TABLES)
    paragraphs = {
        name: contents if name in as_they_are else " ".join(contents)
        for name, contents in sections.items()
    }
    return paragraphs | {
        "campaign": document["campaign"],
        "robot": document["robot"],
        "passed": passed,
        "remarks": document["remarks"],
    }
