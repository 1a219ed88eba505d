"""Campaigns that come with the project: folders that a user could have written, of which
the workflow takes a copy."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.campaign import DOCUMENT
from elastocal.campaigns.measurements import CSV, describe_columns
from elastocal.campaigns.writing import write_campaign
from elastocal.errors import InputError
from elastocal.io.documents import read_document
from elastocal.io.records import compute_sha256


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
    digest = compute_sha256(measurements)
    if digest != sha256:
        raise InputError(measurements, "", f"SHA-256 {digest}", sha256)
    document = read_document(Path(source) / DOCUMENT) | {"campaign": name}
    if holdout is not None:
        document["holdout"] = dict(holdout)
    with open(measurements, encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    joints = sum(name[:1] == "q" and name[1:].isdigit() for name in header)
    kinds = describe_columns(joints)
    table = {}
    for name, texts in zip(header, zip(*rows, strict=True), strict=True):
        kind = kinds[name].type
        table[name] = np.array(texts, str if kind == "string" else kind)
    write_campaign(folder, document, table, joints)
