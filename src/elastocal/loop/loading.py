"""Step 1: a campaign's folder to descriptions and measurements, those to fit apart from
those to test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.campaigns import reading
from elastocal.campaigns.campaign import DEFAULT_HOLDOUT, tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.holdout import split_poses
from elastocal.effects.catalogue import list_effects
from elastocal.errors import InputError
from elastocal.io.json_files import write_json
from elastocal.io.origin import describe_provenance
from elastocal.io.plugins import REGRESSIONS, plugin_names
from elastocal.io.storage import write_table
from elastocal.loop.schemas import measurements

if TYPE_CHECKING:
    from typing import Any

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.campaigns.campaign_folder import CampaignFolder

# What `remainder` of campaign.yaml may be: the choices and the names of this package's
# regressions, see `residual_model.regressions.REGRESSIONS`.
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
    folder = read_campaign_folder(job.params.folder, job.params.robots)
    descriptions, training, held_out = load_campaign(folder)
    for path, part in (
        (job.output.training, training),
        (job.output.held_out, held_out),
    ):
        schema = measurements(part.joint_angles.shape[1])
        write_table(
            path,
            schema,
            [tabulate_measurements(part)],
            describe_provenance(descriptions, **job.wildcards),
        )
    write_json(job.output.descriptions, descriptions)


def load_campaign(
    folder: CampaignFolder,
) -> tuple[dict[str, Any], Measurements, Measurements]:
    """Read a campaign and part its measurements into training and held-out ones.

    Returns
    -------
    descriptions : ``campaign`` and ``robot``, the documents, and ``held_out``, the same
        of the campaign that validates this one, or None.
    training, held_out : measurements to fit and to validate with.

    Raises
    ------
    InputError
        As `reading.read_campaign` and `reading.read_held_out_campaign`.
    """
    descriptions, campaign = described_campaign(folder)
    training, held_out = split_poses(campaign)
    held_out_descriptions = None
    held_out_campaign = reading.read_held_out_campaign(folder, list_effects())
    if folder.held_out_folder is not None and held_out_campaign is not None:
        held_out_descriptions = _descriptions(folder.held_out_folder, held_out_campaign)
        held_out = held_out_campaign.measurements
    return descriptions | {"held_out": held_out_descriptions}, training, held_out


def described_campaign(folder: CampaignFolder) -> tuple[dict[str, Any], Campaign]:
    """Read a campaign with its descriptions as `load_campaign`, but undivided and
    without the campaign that validates it."""
    campaign = reading.read_campaign(folder, list_effects())
    return _descriptions(folder, campaign), campaign


def _descriptions(folder: CampaignFolder, campaign: Campaign) -> dict[str, Any]:
    _check_remainder(folder.document.get("remainder", "auto"), folder.source)
    # Optional keys get their defaults here, so that no later step has to know them.
    defaults = {"compliance": "nominal", "declared": [], "holdout": DEFAULT_HOLDOUT}
    table = {"table": campaign.table, "header_line": campaign.header_line}
    return {
        "source": folder.source,
        "campaign": defaults | folder.document | table,
        "robot": folder.robot_document,
    }


def _check_remainder(name: str, source: str) -> None:
    """Refuse a regression that neither this package nor a plug-in has."""
    # Names alone: reading a campaign must not load the regressions themselves.
    allowed = [*REMAINDERS, *plugin_names(REGRESSIONS)]
    if name not in allowed:
        raise InputError(source, "remainder", repr(name), ", ".join(allowed))
