"""Step 1: a campaign's folder to descriptions and measurements, those to fit apart from
those to test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.campaigns import reading
from elastocal.campaigns.campaign import DEFAULT_HOLDOUT, DOCUMENT, columns_of
from elastocal.campaigns.holdout import split
from elastocal.effects.catalogue import list_effects
from elastocal.errors import InputError
from elastocal.io.documents import read_document
from elastocal.io.json_files import write_json
from elastocal.io.origin import provenance
from elastocal.io.plugins import REGRESSIONS, plugin_names
from elastocal.io.storage import write_table
from elastocal.loop.schemas import measurements

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

    from elastocal.campaigns.campaign import Campaign, Measurements

# What `remainder` of campaign.yaml may be: the choices and the names of this package's
# regressions, see `remainder.regressions.REGRESSIONS`.
REMAINDERS = (
    "auto",
    "none",
    "extra_trees",
    "gaussian_process",
    "ridge_harmonics",
    "two_joints",
)


def read_campaign(job: Any) -> None:
    """The step of a rule: a campaign's folder as tables."""
    descriptions, training, held_out = load_campaign(
        job.params.folder, job.params.robots
    )
    for path, part in (
        (job.output.training, training),
        (job.output.held_out, held_out),
    ):
        schema = measurements(part.joint_angles.shape[1])
        write_table(
            path, schema, [columns_of(part)], provenance(descriptions, **job.wildcards)
        )
    write_json(job.output.descriptions, descriptions)


def load_campaign(
    folder: str | Path, robots_folder: str | Path
) -> tuple[dict[str, Any], Measurements, Measurements]:
    """Read a campaign, `folder` and `robots_folder` as in `reading.read_campaign`, and
    part its measurements.

    Returns `descriptions`: ``campaign`` and ``robot``, the documents; ``held_out`` with
    the same of the campaign that holds the test, or None; measurements to fit and to
    test. Raises `InputError`.
    """
    descriptions, campaign = described_campaign(folder, robots_folder)
    training, held_out = split(campaign)
    test = None
    other = reading.held_out_campaign(campaign, folder, robots_folder, list_effects())
    if other is not None:
        test, _ = described_campaign(
            f"{folder}/{campaign.holdout['campaign']}", robots_folder
        )
        held_out = other.measurements
    return descriptions | {"held_out": test}, training, held_out


def described_campaign(
    folder: str | Path, robots_folder: str | Path
) -> tuple[dict[str, Any], Campaign]:
    """A campaign as `load_campaign` reads it, as a whole and without the campaign that
    holds the test."""
    campaign = reading.read_campaign(folder, robots_folder, list_effects())
    document, robot_path = reading.read_descriptions(folder, robots_folder)
    _check_remainder(document.get("remainder", "auto"), f"{folder}/{DOCUMENT}")
    # What a campaign may leave out gets its default here, so that no later step has to
    # know what its absence means.
    complete = {
        "compliance": "nominal",
        "declared": [],
        "holdout": DEFAULT_HOLDOUT,
    } | document
    complete |= {"table": campaign.table, "header_line": campaign.header_line}
    return {
        "source": f"{folder}/{DOCUMENT}",
        "campaign": complete,
        "robot": read_document(robot_path),
    }, campaign


def _check_remainder(name: str, source: str) -> None:
    """Refuse a regression that neither this package nor a plug-in has."""
    # Names alone: reading a campaign must not load the regressions themselves.
    allowed = [*REMAINDERS, *plugin_names(REGRESSIONS)]
    if name not in allowed:
        raise InputError(source, "remainder", repr(name), ", ".join(allowed))
