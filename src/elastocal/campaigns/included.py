"""Campaigns that come with the project: folders that a user could have written, of which
the workflow takes a copy."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from elastocal.campaigns.campaign import DOCUMENT
from elastocal.campaigns.measurements import CSV, MOST_JOINTS, read_all_columns
from elastocal.campaigns.writing import write_campaign
from elastocal.io.documents import read_document
from elastocal.io.records import refuse_other_contents


def copy_included_campaign(
    source: str | Path,
    folder: str | Path,
    name: str,
    sha256: str,
    holdout: Mapping[str, Any] | None = None,
) -> None:
    """Copy a campaign's folder under another name, with other held-out poses if stated.

    Parameters
    ----------
    source : folder of the campaign that comes with the project.
    folder : folder of the copy.
    name : name of the copy.
    sha256 : digest of the measurements.
    holdout : as in ``campaign.yaml``; None: that of the folder.

    Raises
    ------
    InputError
        If the measurements have other contents than the digest says.
    """
    measurements = Path(source) / CSV
    refuse_other_contents(measurements, sha256, sha256)
    document = read_document(Path(source) / DOCUMENT) | {"campaign": name}
    if holdout is not None:
        document["holdout"] = dict(holdout)
    write_campaign(folder, document, read_all_columns(measurements), MOST_JOINTS)
