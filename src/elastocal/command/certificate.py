"""`elastocal certificate`: the decision whether a robot keeps a tolerance."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from elastocal.command.terminal import (
    find_workplace,
    format_command,
    load_diagnosed_campaign,
    parse_length_m,
    print_answer,
)
from elastocal.errors import InputError

if TYPE_CHECKING:
    from elastocal.io.documents import Document

DOCUMENT = "certificate.json"
PAGES = "certificate.pdf"


def certificate(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    *,
    tolerance: Annotated[
        str, Option(help="Largest allowed RMS position error, such as 0.2mm.")
    ],
    risk: Annotated[
        float, Option(min=0.001, max=0.5, help="Accepted risk of a wrong decision.")
    ] = 0.05,
) -> None:
    """Certify a robot against a tolerance: pass, fail or undecided.

    The certificate has the risk of being wrong and the error budget, and says of which
    point it speaks. It stands beside the report. The exit code is 0 if the robot
    passes, and 1 if it fails or is undecided. A robot that nobody measured after
    correction is predicted to pass or fail.
    """
    from rich.console import Console

    from elastocal.io.atomic_writes import check_places
    from elastocal.loop import calibrated_files
    from elastocal.report.certificate import collect_certificate_facts

    console = Console(stderr=True)
    tolerance_m = parse_length_m("--tolerance", tolerance)
    campaign = load_diagnosed_campaign(folder)
    reports = find_workplace() / "reports"
    report = reports / "loop" / campaign.name
    check_places(report / PAGES, report / DOCUMENT, top=reports)
    if campaign.verdict.faults:
        raise InputError(
            folder,
            "",
            "data at fault",
            "a campaign whose data are in order; its report says what is wrong",
        )
    with console.status("working"):
        document = calibrated_files.build_certificate(campaign, tolerance_m, risk)
        facts = collect_certificate_facts(document)
        _write_certificate(report, document, facts)
    passed = facts["decision"] == "pass"
    rms_m = document["validation_rms_m"]
    next_step = ""
    if rms_m["corrected"] < rms_m["before"]:
        next_step = format_command("verify", folder, "measured.csv")
    warnings = [f"! {error['sentence']}" for error in document["misplaced"]]
    print_answer(
        f"{facts['decision']}, as predicted: {facts['headline']}",
        [
            facts["decision_sentences"],
            facts["now"],
            facts["point"],
            *warnings,
            str(report / PAGES),
            str(report / DOCUMENT),
        ],
        next_step,
        console,
        passed=passed,
    )
    raise typer.Exit(0 if passed else 1)


def _write_certificate(folder: Path, document: Document, facts: Document) -> None:
    """Write the pages of a certificate, with a picture of its error budget, and its
    contents as JSON."""
    from elastocal.figures.loop import draw_budget_bars
    from elastocal.figures.style import save_all
    from elastocal.io.atomic_writes import write_together
    from elastocal.io.json_files import write_json
    from elastocal.report.typesetting import compile_document

    names = [row[0] for row in facts["budget"]]
    tolerance_m = document["conformity"]["tolerance_m"]
    with (
        tempfile.TemporaryDirectory() as scratch,
        write_together(folder, (PAGES, DOCUMENT)) as partial,
    ):
        budget = draw_budget_bars(
            document["budget"], names, tolerance_m, document["tracker_rms_m"]
        )
        pictures = save_all({"budget": budget}, scratch).values()
        compile_document(partial / PAGES, "certificate.typ", {"facts": facts}, pictures)
        write_json(partial / DOCUMENT, document)
