"""A campaign's folder, written so that it is never half a campaign."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from elastocal.campaigns.campaign import DOCUMENT
from elastocal.campaigns.measurements import CSV, PARQUET, check_column_names, write_measurements
from elastocal.io.atomic_writes import write_text, write_together
from elastocal.io.documents import check_document


def write_campaign(
    folder: str | Path,
    document: Mapping[str, Any],
    table: Mapping[str, Sequence[Any] | np.ndarray],
    joints: int,
    kind: str = "parquet",
) -> None:
    """Write a campaign's folder; each file appears whole or not at all, ``campaign.yaml`` last.

    `folder`: made where it is not there. `document`: contents of ``campaign.yaml``. `table`: columns of one length, named as in
    `file_columns`. `kind`: one of "parquet", "csv". Raises `InputError`: a document that the schema refuses, or a column that
    the format does not have.
    """
    folder = Path(folder)
    check_document(document, "campaign", (folder / DOCUMENT).as_posix())
    path = folder / (PARQUET if kind == "parquet" else CSV)
    check_column_names(table, joints, path.as_posix())
    # Until its document is there the folder is no campaign; nor may it hold measurements of both kinds.
    with write_together(folder, (CSV, PARQUET, DOCUMENT)) as partial:
        write_measurements(partial / path.name, table, joints)
        text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120)
        write_text(partial / DOCUMENT, text)
