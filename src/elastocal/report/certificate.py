"""What a certificate states, from its contents: sentences and tables of
`certificate.txt`, and its pages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.application.statements import format_accuracy
from elastocal.counting import format_count
from elastocal.report import words as say
from elastocal.report.loop_facts import format_title
from elastocal.report.typesetting import render_sentences
from elastocal.verdict import Accuracy, JointRange, RepeatableResidual

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

_SHARES = {
    "joint_compliance": "joint compliance under loads and weights",
    "declared_weight": "errors of the declared weights",
    "joint_offset": "joint offsets",
    "link_geometry": "link geometry",
    "uncorrected": "no correction at all",
    "form of the model": "form of the model",
    "not commanded": "effects that no command contains",
    "regression": "regression on the remainder",
    "left by the regression": "left by the regression on the remainder",
}
# Below the digits of any tracker.
_NOTHING_M = 1e-7
_LISTS = ("misplaced", "identity", "data")


def collect_certificate_facts(document: Mapping[str, Any]) -> dict[str, Any]:
    """Facts for the pages of a certificate.

    `document`: of `calibrated_files.build_certificate`. Returns JSON-serialisable; strings
    ready to print, lists for tables.
    """
    repeatable = document.get("repeatable")
    spoken = {
        "joint_ranges": [JointRange(**ends) for ends in document["joint_ranges"]],
        "accuracy_sentence": format_accuracy(Accuracy(**document["accuracy"])),
        "title": format_title(
            document["verdict"],
            document["effects"],
            RepeatableResidual(**repeatable) if repeatable else None,
        ),
    }
    stated = render_sentences(
        "certificate.txt", say.FILTERS, document=document, **spoken
    )
    budget = []
    for line in document["budget"]:
        below = 0.0 < line["rms_m"] < _NOTHING_M
        hidden = line["name"] == "repeatability" and not line["rms_m"]
        size = (
            f"below {say.format_length(_NOTHING_M, 1)}"
            if below
            else say.format_length(line["rms_m"])
        )
        budget.append(
            [
                name_budget_entry(line["name"]),
                "hidden by the tracker's noise" if hidden else size,
            ]
        )
    return {
        **{
            name: lines if name in _LISTS else " ".join(lines)
            for name, lines in stated.items()
        },
        "campaign": document["campaign"],
        "robot": document["robot"],
        "decision": document["conformity"]["decision"],
        "errors": document["errors"],
        "floor": say.format_length(document["noise_floor_rms_m"]),
        "budget": budget,
        "budget_states": format_count(document["budget_states"], "state"),
    }


def name_budget_entry(name: str) -> str:
    """A line of the error budget in words."""
    return _SHARES.get(name) or say.name_effect(name)
