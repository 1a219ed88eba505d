"""The options of an import as a file, with which it can be repeated."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import yaml

from elastocal.exchange.measurement_table import ImportOptions
from elastocal.io.documents import check_document, read_document

IMPORT = "import.yaml"


def read_import_options(path: str | Path) -> ImportOptions:
    """Options of an earlier import.

    Raises `InputError`: no YAML, an unknown key or a value that none may have.
    """
    document = read_document(path) or {}
    check_document(document, "measurement_import", Path(path).as_posix())
    known = {field.name for field in fields(ImportOptions)}
    return ImportOptions(**{key: value for key, value in document.items() if key in known})


def import_options_text(options: ImportOptions, source: str | Path) -> str:
    """Text of the options of an import.

    `source`: the table that was imported.
    """
    digest = hashlib.sha256(Path(source).read_bytes()).hexdigest()
    document: dict[str, Any] = {"source": Path(source).name, "sha256": digest}
    document |= {key: value for key, value in asdict(options).items() if value is not None}
    body = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120)
    return f"# The import again: elastocal import csv FILE --options {IMPORT} --folder FOLDER\n{body}"
