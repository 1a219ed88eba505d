"""Collect what the pages and the summary of a certificate state, from its contents."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.application.statements import format_accuracy
from elastocal.counting import format_count
from elastocal.report import words as say
from elastocal.report.loop_facts import format_title
from elastocal.report.typesetting import render_sentences
from elastocal.verdict import Accuracy, JointRange, RepeatableResidual

if TYPE_CHECKING:
    from typing import Any

    from elastocal.io.documents import Document

# Entries of the error budget that have other words than an effect of the catalogue.
_SHARES = {
    "joint_compliance": "joint compliance under loads and weights",
    "declared_base": "place of the robot on the declared base",
    "declared_application_point": "error of the declared point of the load",
    "declared_weight": "errors of the declared weights",
    "joint_offset": "joint offsets",
    "link_geometry": "link geometry",
    "before": "before calibration, as measured at validation poses",
    "form of the model": "form of the model",
    "not commanded": "effects that no command contains",
    "regression": "regression on the residual",
    "left by the regression": "residual of the regression",
}
# A smaller contribution is printed as below this length, which no tracker resolves.
_SMALLEST_SHOWN_M = 1e-7
# Sections of the template that are lists of sentences; the others are one paragraph.
_LISTS = ("misplaced", "identity", "data")


def collect_certificate_facts(document: Document) -> dict[str, Any]:
    """Return the facts for the pages of a certificate: strings ready to print, and lists
    for tables.

    Parameters
    ----------
    document : mapping
        As `calibrated_files.build_certificate` returns it.
    """
    repeatable = None
    if document.get("repeatable"):
        repeatable = RepeatableResidual(**document["repeatable"])
    sections = render_sentences(
        "certificate.txt",
        say.FILTERS,
        document=document,
        joint_ranges=[JointRange(**limits) for limits in document["joint_ranges"]],
        accuracy_sentence=format_accuracy(Accuracy(**document["accuracy"])),
        title=format_title(document["verdict"], len(document["effects"]), repeatable),
    )
    paragraphs = {
        name: sentences if name in _LISTS else " ".join(sentences)
        for name, sentences in sections.items()
    }
    return paragraphs | {
        "campaign": document["campaign"],
        "robot": document["robot"],
        "decision": document["conformity"]["decision"],
        "errors": document["errors"],
        "floor": say.format_length(document["noise_floor_rms_m"]),
        "budget": [
            [name_budget_entry(entry["name"]), _format_contribution(**entry)]
            for entry in document["budget"]
        ],
        "budget_states": format_count(document["budget_states"], "state"),
    }


def _format_contribution(name: str, rms_m: float) -> str:
    """Return the size of an entry of the error budget."""
    if name == "repeatability" and not rms_m:
        return "hidden by the tracker's noise"
    if 0.0 < rms_m < _SMALLEST_SHOWN_M:
        return f"below {say.format_length(_SMALLEST_SHOWN_M, 1)}"
    return say.format_length(rms_m)


def name_budget_entry(name: str) -> str:
    """Return an entry of the error budget in words."""
    return _SHARES.get(name) or say.name_effect(name)
