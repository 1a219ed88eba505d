"""A diagnosed campaign as the subcommands that use its result find it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.command.pipeline import pipeline, workplace

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.loop.calibrated_files import Diagnosed


def diagnosed_campaign(folder: Path) -> Diagnosed:
    """A campaign with what its diagnosis found, from the results of the pipeline.

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
    from elastocal.loop.calibrated_files import load_diagnosed

    return load_diagnosed(folder, pipeline() / "config" / "robots", workplace() / "results" / "loop")


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


def held_out_rms_m(name: str) -> float | None:
    """What the model of a campaign missed its held-out poses by (RMS), m; None where no verdict says so.

    Parameters
    ----------
    name : str
        Of the campaign.

    Returns
    -------
    float or None
    """
    from elastocal.io.json_files import read_json

    path = report_file(name, "verdict.json")
    return None if path is None else read_json(path)["heldout"]["after"]["rms_m"]
