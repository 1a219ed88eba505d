"""Make the page of interpretations of the paper.

It has the table of the report, and the switches of the configuration.
"""

from __future__ import annotations

import csv
from importlib import resources
from pathlib import Path

import yaml

TABLE = Path(__file__).resolve().parents[2] / "config" / "paper" / "interpretations.csv"

HEAD = """# Interpretations of the paper

The paper leaves some points open. The table lists the interpretation of each, and the key
of `interpretations` in `config.yaml` that chooses another one. Points without a switch
have no other possible interpretation, or both are given.

| point | open | interpretation | switch |
|---|---|---|---|
"""


def page() -> str:
    """Write the page in Markdown."""
    schema = resources.files("elastocal.schemas").joinpath("config.yaml")
    document = yaml.safe_load(schema.read_text(encoding="utf-8"))
    switches = document["properties"]["interpretations"]["properties"]
    with open(TABLE, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    lines = []
    for row in rows:
        switch = _switch(row["number"], switches)
        lines.append(
            f"| {row['number']} | {row['open']} | {row['interpretation']} | {switch} |\n"
        )
    return HEAD + "".join(lines)


def _switch(number: str, switches: dict[str, dict]) -> str:
    """List the keys whose description begins with a number, with their values."""
    entries = []
    for key, schema in switches.items():
        if not schema["description"].startswith(f"{number}:"):
            continue
        if "enum" in schema:
            values = ", ".join(f"`{value}`" for value in schema["enum"])
        else:
            values = schema["description"][4:]
        entries.append(f"`{key}`: {values}")
    return "; ".join(entries)
