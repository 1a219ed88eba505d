"""`elastocal verify`: a corrected robot that was measured at its targets."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from elastocal.command.certificate import DOCUMENT as CERTIFICATE
from elastocal.command.terminal import (
    ForceOption,
    LengthsOption,
    TargetsOption,
    find_workplace,
    format_command,
    load_diagnosed_campaign,
    parse_length_m,
    print_answer,
)

if TYPE_CHECKING:
    from typing import Any

    from elastocal.loop.verification import Verification

PAGES = "verification.pdf"
TABLE = "verification.csv"
PICTURE = "verification.png"
DOCUMENT = "verification.json"


def verify(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    measured: Annotated[
        Path,
        Argument(
            help="CSV of positions x, y, z that were measured at the corrected targets:"
            " one row for each target in their order, or with a column pose, the row of"
            " the target."
        ),
    ],
    *,
    targets: TargetsOption = None,
    tolerance: Annotated[
        str,
        Option(
            help="Largest allowed RMS position error, such as 0.2mm. Default: the tolerance"
            " of the campaign's last certificate."
        ),
    ] = "",
    risk: Annotated[
        float, Option(min=0.001, max=0.5, help="Accepted risk of a wrong decision.")
    ] = 0.05,
    lengths: LengthsOption = None,
    force: ForceOption = False,
) -> None:
    """Compare a corrected robot, measured at its targets, with its prediction.

    States the error before, predicted and measured, by target and in all; whether the
    prediction held; whether an error remains that repeats; and, with a tolerance, pass
    or fail as measured beside as predicted. The exit code is 0 if the prediction held
    and the robot does not miss the tolerance, else 1.
    """
    from rich.console import Console

    from elastocal.io.atomic_writes import check_places
    from elastocal.io.replacement import check_replaceable, note_written_files
    from elastocal.loop import verification
    from elastocal.report.verification import collect_verification_facts

    console = Console(stderr=True)
    stated_tolerance_m = parse_length_m("--tolerance", tolerance) if tolerance else None
    campaign = load_diagnosed_campaign(folder)
    workplace = find_workplace()
    reports = workplace / "reports"
    report = reports / "loop" / campaign.name
    outputs = [report / name for name in (PAGES, TABLE, PICTURE, DOCUMENT)]
    targets_path = targets or measured.with_name(verification.TARGETS)
    check_places(*outputs, top=reports)
    inputs: list[str | Path] = [*campaign.folder.files(), measured, targets_path]
    check_replaceable(outputs, inputs, workplace, force=force)
    tolerance_m = stated_tolerance_m or _read_certified_tolerance(report)
    with console.status("working"):
        read = verification.read_verification(
            measured, targets_path, campaign.case.campaign, lengths
        )
        verified = verification.verify_campaign(
            campaign,
            *read,
            {"targets": targets_path, "measured": measured},
            tolerance_m,
            risk,
        )
        facts = collect_verification_facts(verified.document)
        _write_verification(report, verified, facts)
    note_written_files(outputs, workplace)
    passed = facts["passed"]
    next_step = facts["now"]
    if verified.document["remaining"]["remains"]:
        next_step = _format_next_round(folder, measured, targets, lengths)
    print_answer(
        facts["headline"],
        [
            facts["prediction"],
            facts["remaining"],
            *facts["certificate"],
            *(f"! {remark}" for remark in facts["remarks"]),
            *map(str, outputs[:3]),
        ],
        next_step,
        console,
        passed=passed,
    )
    raise typer.Exit(0 if passed else 1)


def _format_next_round(
    folder: Path, measured: Path, targets: Path | None, lengths: str | None
) -> str:
    """Format the command that diagnoses again with these measurements."""
    words: list[str | Path] = ["diagnose", folder, "--with", measured]
    if targets:
        words += ["--targets", targets]
    if lengths:
        words += ["--lengths", lengths]
    return format_command(*words)


def _read_certified_tolerance(report: Path) -> float | None:
    """Return the tolerance of the last certificate of a campaign, m; None if there is
    none."""
    from elastocal.io.json_files import read_json

    path = report / CERTIFICATE
    if not path.is_file():
        return None
    return float(read_json(path)["conformity"]["tolerance_m"])


def _write_verification(
    folder: Path, verified: Verification, facts: dict[str, Any]
) -> None:
    """Write pages, table, picture and contents of a verification, all or none."""
    from elastocal.figures.style import save_all
    from elastocal.figures.verification import draw_verification
    from elastocal.io.atomic_writes import write_together
    from elastocal.io.data_frames import write_csv
    from elastocal.io.json_files import write_json
    from elastocal.report.typesetting import compile_document

    document = verified.document
    certificate = document["certificate"]
    tolerance_m = certificate["measured"]["tolerance_m"] if certificate else None
    with (
        tempfile.TemporaryDirectory() as scratch,
        write_together(folder, (PAGES, TABLE, PICTURE, DOCUMENT)) as partial,
    ):
        figure = draw_verification(
            verified.table, document["noise"]["rms_m"], tolerance_m
        )
        pictures = save_all({"verification": figure}, scratch).values()
        shutil.copyfile(Path(scratch, PICTURE), partial / PICTURE)
        compile_document(
            partial / PAGES, "verification.typ", {"facts": facts}, pictures
        )
        write_csv(partial / TABLE, verified.table)
        write_json(partial / DOCUMENT, document)
