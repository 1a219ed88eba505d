"""Read and write the JSON files of the pipeline. Only the standard library is imported,
so that jobs start quickly."""

import json
from pathlib import Path
from typing import Any

from elastocal.errors import InputError
from elastocal.io.atomic_writes import write_text
from elastocal.io.texts import check_file


def read_json(path: str | Path) -> Any:
    """Read a JSON file.

    An InputError refuses a file that is no JSON, or whose brackets are nested so deeply
    that no program of this project can have written it.
    """
    try:
        check_file(path)
        with open(path, encoding="utf-8") as file:
            return json.load(file)
    except FileNotFoundError:
        raise InputError(path, "", "no such file", "a file that is there") from None
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(
            path, "", f"no JSON ({error})", "the file as the pipeline wrote it"
        ) from None


def write_json(path: str | Path, contents: Any, **options: Any) -> None:
    """Write an indented JSON file atomically; options are passed to ``json.dumps``."""
    write_text(path, json.dumps(contents, indent=1, **options) + "\n")
