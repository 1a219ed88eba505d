"""JSON files of the steps, read and written with nothing but the standard library
behind it: jobs start quickly."""

import json
from pathlib import Path
from typing import Any

from elastocal.io.atomic_writes import write_text
from elastocal.io.texts import check_file


def read_json(path: str | Path) -> Any:
    """Contents of a JSON file."""
    check_file(path)
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def write_json(path: str | Path, contents: Any, **options: Any) -> None:
    """Write a JSON file that people can read too, with options of ``json.dumps``; it
    appears whole or not at all."""
    write_text(path, json.dumps(contents, indent=1, **options) + "\n")
