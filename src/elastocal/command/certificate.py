"""`elastocal certificate`: how good a robot is, against a tolerance, as PDF and JSON."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option

from elastocal.command.campaign import AcceptEnvironment, PhysicsOnly, diagnosed_campaign
from elastocal.command.pipeline import pipeline, workplace
from elastocal.command.printed import iso_date, print_answer, printed
from elastocal.command.quantities import length_m
from elastocal.errors import InputError

DOCUMENT, PAGES = "certificate.json", "certificate.pdf"


def certificate(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    tolerance: Annotated[str, Option(help="Largest allowed RMS position error, such as 0.2mm.")],
    risk: Annotated[float, Option(min=0.001, max=0.5, help="Accepted risk of a wrong decision.")] = 0.05,
    serial: Annotated[str | None, Option(help="Serial number of the robot. Default: the campaign's.")] = None,
    date: Annotated[str | None, Option(help="Date of the certificate, such as 2026-11-20. Default: today.")] = None,
    output: Annotated[Path | None, Option(help="Folder for both files. Default: the campaign's reports.")] = None,
    physics_only: PhysicsOnly = False,
    accept_environment: AcceptEnvironment = False,
) -> None:
    """Certify a robot against a tolerance: pass, fail or undecided.

    The certificate has the risk of being wrong and the error budget, and says of which point it speaks. The exit code is 0 if
    the robot passes, and 1 if it fails or is undecided. A robot that nobody measured after correction is predicted to pass or
    fail.
    """
    from datetime import date as calendar

    from rich.console import Console

    from elastocal.campaigns.reading import read_descriptions
    from elastocal.data_checks.protocol import data_at_fault
    from elastocal.figures.certificate import budget_bars
    from elastocal.figures.style import save_all
    from elastocal.io.atomic_writes import check_places, write_together
    from elastocal.io.json_files import write_json
    from elastocal.loop.certificate import Wanted
    from elastocal.loop.certificate import certificate as certified
    from elastocal.report.certificate import certificate_facts, write_certificate

    console, robots = Console(stderr=True), pipeline() / "config" / "robots"
    campaign = read_descriptions(folder, robots)[0]
    limit = length_m("--tolerance", tolerance)
    number = campaign.get("serial_number", "") if serial is None else printed("--serial", serial)
    stated = {"measured_on": campaign.get("measured_on", "")} | campaign.get("certificate", {})
    day = calendar.today().isoformat() if date is None else iso_date("--date", date)
    found = diagnosed_campaign(folder, accept_environment, physics_only)
    place = output or workplace() / "reports" / "loop" / found.name
    check_places(place / PAGES, place / DOCUMENT, top=output or workplace() / "reports")
    if data_at_fault(found.verdict):
        raise InputError(folder, "", "data at fault", "a campaign whose data are in order; its report says what is wrong")
    wanted = Wanted(limit, risk, number, day, stated)
    with console.status("working"):
        document = certified(folder, robots, found, wanted)
        facts = certificate_facts(document)
        with tempfile.TemporaryDirectory() as scratch, write_together(place, (PAGES, DOCUMENT)) as partial:
            names = [row[0] for row in facts["budget"]]
            budget = budget_bars(document["budget"], names, limit, document["tracker_rms_m"])
            write_certificate(partial / PAGES, facts, [*save_all({"budget": budget}, scratch).values()])
            write_json(partial / DOCUMENT, document)
    passed, (answer, *details) = facts["decision"] == "pass", _lines(document)
    print_answer(passed, answer, [*details, str(place / PAGES), str(place / DOCUMENT)], facts["now"], console)
    raise typer.Exit(0 if passed else 1)


def _lines(document: Mapping[str, Any]) -> list[str]:
    """The answer in three lines: the decision by its criterion; over which poses and of which point; why, or what it lacks."""
    from elastocal.application.accuracy import accuracy_from, millimetres
    from elastocal.application.frames import FRAMES

    found, accuracy = document["conformity"], accuracy_from(document["accuracy"])
    answer = (
        f"{found['decision']}, as {accuracy.kind}: the RMS position error of the corrected robot is"
        f" {millimetres(accuracy.rms_m)}, {1 - found['accepted_risk']:.0%} sure to be below"
        f" {millimetres(found['limit_m'])}, the tolerance"
        f" {millimetres(found['tolerance_m'])}"
        if accuracy.fitted or accuracy.form_m
        else f"{found['decision']}: no error is predicted of a robot of which nothing was fitted"
    )
    poses = f"In {FRAMES[accuracy.frame].removeprefix('in ')}, over {accuracy.region} ({accuracy.poses})"
    where = f"{poses}, {millimetres(accuracy.worst_m)} at the worst of them. {document['point']}"
    rest = [f"Too little for a pass: {'; '.join(found['shortfalls'])}."] if found["shortfalls"] else []
    rest.append("Nobody has measured the corrected robot: command corrected targets, measure them, and compare.")
    return [answer, where, " ".join(rest), *(f"! {each['sentence']}" for each in document["misplaced"])]
