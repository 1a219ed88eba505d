"""A diagnosed campaign as the subcommands that use its result find it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.command.pipeline import pipeline, workplace

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.loop.calibrated_files import Diagnosed


def diagnosed_campaign(folder: Path) -> Diagnosed:
    """A campaign with what its diagnosis found, from the results of the pipeline, and what held-out poses said of its errors.

    Parameters
    ----------
    folder : Path
        Of the campaign.

    Returns
    -------
    Diagnosed

    Raises
    ------
    InputError
        As `load_diagnosed`.
    """
    from elastocal.io.json_files import read_json
    from elastocal.loop.calibrated_files import judged_as, load_diagnosed

    found = load_diagnosed(folder, pipeline() / "config" / "robots", workplace() / "results" / "loop")
    verdict = report_file(found.name, "verdict.json")
    return found if verdict is None else judged_as(found, read_json(verdict))


def report_file(name: str, file: str) -> Path | None:
    """A file of the reports of a campaign.

    Parameters
    ----------
    name : str
        Of the campaign.
    file : str

    Returns
    -------
    Path or None
        None where there is none.

    Raises
    ------
    InputError
        A file that is no longer what the pipeline wrote.
    """
    from elastocal.io.checksums import check_checksums

    place = f"reports/loop/{name}/{file}"
    check_checksums([place], workplace())
    path = workplace() / place
    return path if path.is_file() else None
