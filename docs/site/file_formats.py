"""Pages of the file formats: what people write, of the JSON Schemas; what the pipeline
writes, of the schemas of its tables."""

from __future__ import annotations

import json
import re
from importlib import import_module, resources
from textwrap import dedent, indent
from typing import Any

import yaml
from jsonschema2md import Parser

from elastocal.application.model_file import build_model_schema
from elastocal.io.storage import TableSchema
from elastocal.verdict import build_verdict_schema

# Each document with where it stands.
DOCUMENTS = {
    "campaign": "`campaign.yaml` of a campaign's folder.",
    "robot": "A file of `config/robots`, or beside a campaign.",
    "strategy": "A file of `config/strategies`.",
    "config": "`config.yaml` at the top of the repository.",
    "campaign_source": "A file of `config/campaigns`: where a campaign of this project comes from.",
    "public_data": "`config/public_data.yaml`: importers of public data.",
}
# Each module of table schemas with where its tables lie.
TABLES = {
    "elastocal.study.schemas": "The study: `data/simulated`, `results`.",
    "elastocal.loop.schemas": "The loop: `results/loop`, `reports/loop`.",
    "elastocal_proof.league.schemas": "The league of methods: `results/league`, `reports/league`.",
    "elastocal_proof.blind.schemas": "The closed loop: `results/closed_loop`.",
}
# Robots have different numbers of joints; tables are shown for this one.
JOINTS = 6
# The library links each pattern to a site that tries it.
_TRIED_ELSEWHERE = re.compile(r" \(\[Test\]\(https.*?\)\)(?=[.,;]|$)", re.MULTILINE)
# It links references to keys by paths that are no anchors of the page.
_TO_KEY = re.compile(r"\[([^]]+)\]\(#[^)]*\)")
# It writes examples in ASCII, and marks the end of those that are one word.
_EXAMPLE = re.compile(r"( *)```yaml\n(.*?)\n *```", re.DOTALL)
# What a person would read as a riddle.
_PRINTABLE = re.compile(r"Must match pattern: `[^`]*\\x00[^`]*`")

HEAD = """# File formats

Made from the schemas that check files when they are read and written. [A
campaign](../../docs/campaign.md) describes `measurements.csv`, [the
audit](../../docs/audit.md) the tables for an audit.

```{toctree}
:maxdepth: 1

"""


def pages() -> dict[str, str]:
    """Text of each page by its name."""
    documents = {
        f"{name}.md": _document(name, description)
        for name, description in DOCUMENTS.items()
    }
    documents |= {
        "verdict.md": _format_schema(
            "verdict.json",
            "a verdict. `elastocal.verdict` has the classes",
            build_verdict_schema(),
        ),
        "model.md": _format_schema(
            "Model file",
            "a [model file](../../docs/model_file.md)."
            " `elastocal.application.model_file` has the classes",
            build_model_schema(),
        ),
        "tables.md": _tables(),
    }
    return {
        "index.md": HEAD
        + "".join(f"{name.removesuffix('.md')}\n" for name in documents)
        + "```\n",
        **documents,
    }


def _format_schema(title: str, words: str, schema: dict[str, Any]) -> str:
    """Write a schema that follows from dataclasses."""
    text = json.dumps(schema, indent=2)
    return f"# {title}\n\nThe JSON schema of {words}.\n\n```json\n{text}\n```\n"


def _document(name: str, words: str) -> str:
    text = (
        resources.files("elastocal.schemas")
        .joinpath(f"{name}.yaml")
        .read_text(encoding="utf-8")
    )
    schema = yaml.safe_load(text)
    title, _, listed = "".join(
        Parser(examples_as_yaml=True).parse_schema(schema)
    ).partition("\n")
    # Of keys that allow only some values the library does not say which are required.
    required = ", ".join(f"`{key}`" for key in schema.get("required", ())) or "none"
    intro = f"{words} Keys that must be there: {required}. Other keys than these are refused."
    listed = _TO_KEY.sub(r"\1", _TRIED_ELSEWHERE.sub("", listed))
    keys = _EXAMPLE.sub(
        _plain_example, _PRINTABLE.sub("Printable characters on one line", listed)
    )
    return f"{title}\n\n{intro}\n{keys}"


def _plain_example(match: re.Match[str]) -> str:
    blanks = match[1]
    text = yaml.safe_dump(
        yaml.safe_load(dedent(match[2])), allow_unicode=True, sort_keys=False
    ).removesuffix("...\n")
    return indent(f"```yaml\n{text}```", blanks)


def _tables() -> str:
    sections = [
        "# Tables\n\nParquet files, column by column;"
        f" columns of joints are shown for {JOINTS} joints.\n"
    ]
    for module, description in TABLES.items():
        title, _, text = description.partition(": ")
        sections.append(f"\n## {title}\n\n{text}\n")
        sections += [_table(schema) for schema in table_schemas(module)]
    return "".join(sections)


def table_schemas(module: str) -> list[TableSchema]:
    """Every schema of a module, for a robot with so many joints."""
    schemas = import_module(module).SCHEMAS.values()
    return [schema.for_joints(JOINTS) for schema in schemas]


def _table(schema: TableSchema) -> str:
    lines = [
        f"\n### {schema.name}\n",
        "| column | type | unit | meaning | may be missing |",
        "|---|---|---|---|---|",
    ]
    for column in schema.columns:
        unit = column.unit or "–"
        missing = "yes" if column.missing else ""
        lines.append(
            f"| `{column.name}` | {column.type} | {unit} | {column.meaning} | {missing} |"
        )
    return "\n".join(lines) + "\n"
