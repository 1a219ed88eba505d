"""Step 1 of the loop: read a campaign's folder, and split its measurements into those to
fit and those to validate."""

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
from elastocal.io.plugins import REGRESSIONS, list_plugin_names
from elastocal.io.storage import write_table
from elastocal.loop.schemas import MEASUREMENTS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.campaigns.campaign_folder import CampaignFolder

# Values that `remainder` of campaign.yaml may have besides plug-ins. They are listed
# here because reading a campaign must not import `residual_model.regressions`.
REMAINDERS = (
    "auto",
    "none",
    "extra_trees",
    "gaussian_process",
    "ridge_harmonics",
    "two_joints",
)


def read_campaign(job: Any) -> None:
    """Convert a campaign's folder to tables. Called by a rule of the workflow."""
    folder = read_campaign_folder(job.params.folder, job.params.robots)
    descriptions, training, held_out = load_campaign(folder)
    for path, measurements in (
        (job.output.training, training),
        (job.output.held_out, held_out),
    ):
        write_table(
            path,
            MEASUREMENTS.for_joints(measurements.joint_angles.shape[1]),
            [tabulate_measurements(measurements)],
            describe_provenance(descriptions, **job.wildcards),
        )
    write_json(job.output.descriptions, descriptions)


def load_campaign(
    folder: CampaignFolder,
) -> tuple[dict[str, Any], Measurements, Measurements]:
    """Read a campaign and split its measurements.

    Returns
    -------
    descriptions : ``campaign`` and ``robot``, the documents; ``held_out``, the same of
        the campaign that validates this one, or None; and ``files``, the digests of all
        files by their roles.
    training, held_out : measurements to fit and to validate with.

    Raises
    ------
    InputError
        As `reading.read_campaign` and `reading.read_held_out_campaign`.
    """
    descriptions, campaign = read_described_campaign(folder)
    training, held_out = split_poses(campaign)
    held_out_descriptions = None
    held_out_campaign = reading.read_held_out_campaign(folder, list_effects())
    if folder.held_out_folder is not None and held_out_campaign is not None:
        held_out_descriptions = describe_campaign(
            folder.held_out_folder, held_out_campaign
        )
        held_out = held_out_campaign.measurements
    descriptions |= {"held_out": held_out_descriptions, "files": folder.digests}
    return descriptions, training, held_out


def read_described_campaign(
    folder: CampaignFolder,
) -> tuple[dict[str, Any], Campaign]:
    """Read a campaign with its descriptions as `load_campaign`, but without a split and
    without the campaign that validates it."""
    campaign = reading.read_campaign(folder, list_effects())
    return describe_campaign(folder, campaign), campaign


def describe_campaign(folder: CampaignFolder, campaign: Campaign) -> dict[str, Any]:
    """Return the documents of a campaign with the defaults of optional keys, so that no
    later step has to know them."""
    check_regression(folder.document, folder.source)
    defaults = {"compliance": "nominal", "declared": [], "holdout": DEFAULT_HOLDOUT}
    table = {"table": campaign.table, "header_line": campaign.header_line}
    return {
        "source": folder.source,
        "campaign": defaults | folder.document | table,
        "robot": folder.robot_document,
    }


def check_regression(document: Mapping[str, Any], source: str) -> None:
    """Refuse a regression that neither this package nor a plug-in has; `source`: file of
    the document of the campaign, for messages."""
    regression = document.get("remainder", "auto")
    allowed = [*REMAINDERS, *list_plugin_names(REGRESSIONS)]
    if regression not in allowed:
        raise InputError(source, "remainder", repr(regression), ", ".join(allowed))
