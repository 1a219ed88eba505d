"""Every file of a run: its checksum, what it says of itself, its schema, and whether it was made by what is configured."""

from __future__ import annotations

import hashlib
import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq

from elastocal import __version__
from elastocal.io.storage import head_columns
from elastocal_proof.audit.findings import Finding, require
from elastocal_proof.audit.schemas import SCHEMAS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.io.storage import Column
    from elastocal_proof.audit.audited import Audited

# What is asked of every file, whatever it holds; other checks work something out again.
OF_EVERY_FILE = frozenset(
    {
        *("the file is there", "bytes as its job wrote them", "a table that is known", "columns", "columns of what it is of"),
        "units and meanings",
        *("finite and within range", "digest of its configuration"),
        *("version of the package", "made for where it lies", "made by what is configured"),
    }
)
# Facts of a file's own provenance that its path states too.
_PLACES = (
    re.compile(r"data/simulated/(?P<robot>[^/]+)/(?P<noise>[^/]+)um/\w+\.parquet"),
    re.compile(r"data/simulated/(?P<robot>[^/]+)(?:/test)?/\w+\.parquet"),
    re.compile(r"results/design/(?P<robot>[^/]+)/(?P<strategy>[^/]+)\.parquet"),
    re.compile(
        r"results/(?:identified|metrics|replicates|accuracy|expected)/(?P<robot>[^/]+)/(?P<noise>[^/]+)um/(?P<strategy>[^/]+)\.parquet"
    ),
    re.compile(r"results/(?!loop|league|blind|studies)\w+/(?P<robot>[^/]+)\.parquet"),
    re.compile(r"results/loop/(?P<campaign>[^/]+)/\w+\.parquet"),
)
# Columns of which there is one for each joint.
_OF_JOINTS = re.compile(r"q\d+|c\d+|compliance_\d+|equation_11_c\d+|cov_(\d+)_\1|relative_error_\d+")
_SHA = "hashlib, SHA-256"


def intact(run: Audited, file: str, digest: str) -> Finding:
    """Whether a file holds what its job wrote."""
    path = run.folder / file
    if not path.is_file():
        return require("the file is there", "its record", False, "it is missing")
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    return require("bytes as its job wrote them", _SHA, found == digest, f"{found[:12]}, recorded {digest[:12]}")


def described(run: Audited, file: str) -> Iterator[Finding]:
    """What a Parquet file says of itself: schema, units, provenance; nothing of tables of another format."""
    facts = run.metadata(file)
    if "elastocal.table" in facts:
        yield from _columns(run, file, facts["elastocal.table"], facts["elastocal.provenance"])
        yield from _provenance(run, file, facts["elastocal.provenance"])


def _columns(run: Audited, file: str, name: str, origin: dict[str, Any]) -> Iterator[Finding]:
    stored, by = pq.ParquetFile(run.folder / file).schema_arrow, "the schemas"
    if name not in SCHEMAS:
        yield require("a table that is known", by, False, f"table {name}")
        return
    schema = SCHEMAS[name](sum(1 for field in stored.names if _OF_JOINTS.fullmatch(field)))
    heads = head_columns(schema, origin)
    columns = (*heads.values(), *schema.columns)
    names = [column.name for column in columns]
    yield require("columns", by, stored.names == names, f"{sorted(set(stored.names) ^ set(names))}", len(names))
    if stored.names != names:
        return
    frame, units, wrong = run.table(file), [], []
    for column in columns:
        stated = {key.decode(): value.decode() for key, value in (stored.field(column.name).metadata or {}).items()}
        if (stated.get("unit"), stated.get("meaning")) != (column.unit, column.meaning):
            units.append(f"{column.name}: {stated.get('unit')!r}, expected {column.unit!r}")
        if column.type.startswith(("float", "int")):
            values = frame[column.name].to_numpy(float)
            wrong += [f"{column.name} is not finite"] * bool(not column.missing and not np.isfinite(values).all())
            wrong += [f"{column.name} too small"] * bool(column.minimum is not None and (values < column.minimum).any())
    other = [
        column.name for key, column in heads.items() if {*map(str, frame[column.name])} - {str(_of_type(column, origin[key]))}
    ]
    yield require("columns of what it is of", "its own metadata", not other, ", ".join(other), len(frame) * len(heads))
    yield require("units and meanings", by, not units, ", ".join(units[:3]), len(names))
    yield require("finite and within range", "numpy", not wrong, ", ".join(wrong[:3]), len(frame))


def _of_type(column: Column, value: Any) -> Any:
    return value if column.type == "string" else float(value)


def _provenance(run: Audited, file: str, origin: dict[str, Any]) -> Iterator[Finding]:
    configuration, version, by = origin.get("configuration", {}), origin.get("elastocal_version"), "its own metadata"
    digest = hashlib.sha256(json.dumps(configuration, sort_keys=True).encode()).hexdigest()[:16]
    yield require("digest of its configuration", _SHA, digest == origin.get("configuration_sha256"), digest)
    yield require("version of the package", by, version == __version__, str(version))
    place = next((match.groupdict() for pattern in _PLACES if (match := pattern.fullmatch(file))), {})
    off = [f"{name} {origin[name]!r}" for name, value in place.items() if str(origin.get(name, value)) != value]
    yield require("made for where it lies", by, not off, ", ".join(off), max(len(place), 1))
    expected, inner = _configured(run, place), configuration | configuration.get("study", {})
    off = [
        f"{name}: {str(inner[name])[:60]}, configured {str(value)[:60]}"
        for name, value in expected.items()
        if name in inner and json.loads(json.dumps(value)) != inner[name]
    ]
    yield require("made by what is configured", by, not off, ", ".join(off[:2]), len(expected))


def _configured(run: Audited, place: dict[str, str]) -> dict[str, Any]:
    """What config.yaml and the files of robots and strategies say of the settings of a file."""
    tool = run.configuration["interpretations"]["tool_offset_m"]
    found = {"tool_offset_m": tool, "wrench_at": run.wrench_at, "seed": run.seed}
    if place.get("robot") in run.robots:
        robot = run.robots[place["robot"]]
        found |= {"robot": robot, "chain": robot["chain"], "lengths_m": robot.get("lengths_m", {})}
    if place.get("strategy") in run.strategies:
        found["strategy"] = run.strategies[place["strategy"]]
    return found
