"""The tables of a run as a data package: each CSV file with its columns, size, SHA-256, and what it was made from.

[1] Data Package standard, version 2, Open Knowledge Foundation, 2024.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from elastocal.io.records import checksum

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.io.records import JobRecord

_PROFILE = "https://datapackage.org/profiles/2.0/datapackage.json"
_TYPES = {"b": "boolean", "i": "integer", "u": "integer", "f": "number"}


def data_package(jobs: Iterable[JobRecord], folder: str, licence: str) -> dict[str, Any]:
    """Describe the CSV files that jobs made below a folder, where the description is to stand: it names tables from there.

    `licence`: of the Open Definition, such as ``MIT``.
    """
    made = {file: job for job in jobs for file in job.outputs if file.endswith(".csv") and Path(file).is_relative_to(folder)}
    resources = [_resource(file, folder, made[file]) for file in sorted(made)]
    return {"$schema": _PROFILE, "name": "elastocal-tables", "licenses": [{"name": licence}], "resources": resources}


def _resource(file: str, folder: str, job: JobRecord) -> dict[str, Any]:
    path = Path(file).relative_to(folder)
    # A table of nothing, such as of no campaigns, has no line.
    frame = pd.read_csv(file) if Path(file).read_text(encoding="utf-8").strip() else pd.DataFrame()
    return {
        "name": re.sub(r"[^a-z0-9._-]+", "-", path.with_suffix("").as_posix().lower()),
        "path": path.as_posix(),
        "type": "table",
        "format": "csv",
        "mediatype": "text/csv",
        "encoding": "utf-8",
        "bytes": Path(file).stat().st_size,
        "hash": f"sha256:{checksum(file)}",
        "schema": {"fields": [{"name": name, "type": _TYPES.get(kind.kind, "string")} for name, kind in frame.dtypes.items()]},
        # The standard lets descriptions have keys of their own.
        "made_by": job.name,
        "origin": vars(job.origin),
    }
