"""`elastocal compare`: diagnosed campaigns side by side."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from elastocal.command.terminal import (
    ForceOption,
    find_workplace,
    load_diagnosed_campaign,
    print_answer,
)
from elastocal.counting import format_count


def compare(
    folders: Annotated[
        list[Path], Argument(help="Folders of two or more diagnosed campaigns.")
    ],
    *,
    output: Annotated[
        Path | None, Option(help="Write the table as a page, .html, too.")
    ] = None,
    force: ForceOption = False,
) -> None:
    """Show diagnosed campaigns side by side: two dates, two robots, two settings.

    The table has the verdict, the errors before and after on held-out poses, and each
    identified parameter with its standard error.
    """
    from rich.console import Console

    from elastocal.interface.comparison import compare as compare_diagnoses
    from elastocal.io.atomic_writes import write_text
    from elastocal.io.replacement import check_replaceable, note_written_files

    if output is not None:
        check_replaceable([output], [], find_workplace(), force=force)
    campaigns = [load_diagnosed_campaign(folder) for folder in folders]
    comparison = compare_diagnoses(*(campaign.verdict for campaign in campaigns))
    details = str(comparison).splitlines()
    if output is not None:
        write_text(output, comparison.to_page())
        note_written_files([output], find_workplace())
        details.append(str(output))
    print_answer(
        f"{format_count(len(campaigns), 'campaign')} side by side",
        details,
        "",
        Console(width=200),
    )
