"""The page of what the paper leaves open: the table of the report, and the switches of
the configuration."""

from __future__ import annotations

import csv
from importlib import resources
from pathlib import Path

import yaml

TABLE = Path(__file__).resolve().parents[2] / "config" / "paper" / "interpretations.csv"

HEAD = """# Interpretations of the paper

The paper leaves some points open. How each is interpreted, as in the table of the report, and by which key of
`interpretations` in `config.yaml` another interpretation is chosen. Where there is no switch another one is not possible,
or both are given.

| point | open | interpretation | switch |
|---|---|---|---|
"""


def page() -> str:
    """The page, in Markdown."""
    text = (
        resources.files("elastocal.schemas")
        .joinpath("config.yaml")
        .read_text(encoding="utf-8")
    )
    switches = yaml.safe_load(text)["properties"]["interpretations"]["properties"]
    with open(TABLE, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return HEAD + "".join(
        f"| {row['number']} | {row['open']} | {row['interpretation']} | {_switch(row['number'], switches)} |\n"
        for row in rows
    )


def _switch(number: str, switches: dict[str, dict]) -> str:
    """Keys whose description begins with the number, with what they allow."""
    found = {
        key: words
        for key, words in switches.items()
        if words["description"].startswith(f"{number}:")
    }
    return "; ".join(
        f"`{key}`: "
        + (
            ", ".join(f"`{value}`" for value in words["enum"])
            if "enum" in words
            else words["description"][4:]
        )
        for key, words in found.items()
    )
