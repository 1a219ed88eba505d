"""Every file of a run: its checksum, what it says of itself, its schema, and whether it was made by what is configured."""

from __future__ import annotations

import hashlib
import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq

from elastocal import __version__
from elastocal.audit.findings import Finding, held
from elastocal.audit.schemas import SCHEMAS

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

# What is asked of every file, whatever it holds; other checks work something out again.
OF_EVERY_FILE = frozenset(
    {
        *("the file is there", "bytes as its job wrote them", "a table that is known", "columns", "units and meanings"),
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


def intact(run: Audited, file: str, digest: str) -> Finding:
    """Whether a file holds what its job wrote."""
    path = run.folder / file
    if not path.is_file():
        return held(file, "the file is there", "its record", False, "it is missing")
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    return held(
        file, "bytes as its job wrote them", "hashlib, SHA-256", found == digest, f"{found[:12]}, recorded {digest[:12]}"
    )


def described(run: Audited, file: str) -> list[Finding]:
    """What a Parquet file says of itself: schema, units, provenance.

    Returns nothing of tables that are not the pipeline's own format.
    """
    facts = run.metadata(file)
    if "elastocal.table" not in facts:
        return []
    return [*_columns(run, file, facts), *_provenance(run, file, facts)]


def _columns(run: Audited, file: str, facts: dict[str, Any]) -> list[Finding]:
    name = facts["elastocal.table"]
    stored = pq.ParquetFile(run.folder / file).schema_arrow
    if name not in SCHEMAS:
        return [held(file, "a table that is known", "the schemas", False, f"table {name}")]
    joints = sum(
        1
        for field in stored.names
        if re.fullmatch(r"q\d+|c\d+|compliance_\d+|equation_11_c\d+|cov_(\d+)_\1|relative_error_\d+", field)
    )
    schema = SCHEMAS[name](joints)
    names = [column.name for column in schema.columns]
    found = [
        held(file, "columns", "the schemas", stored.names == names, f"{sorted(set(stored.names) ^ set(names))}", len(names))
    ]
    if not found[0].holds:
        return found
    off = []
    for column in schema.columns:
        stated = {key.decode(): value.decode() for key, value in (stored.field(column.name).metadata or {}).items()}
        if (stated.get("unit"), stated.get("meaning")) != (column.unit, column.meaning):
            off.append(f"{column.name}: {stated.get('unit')!r}, expected {column.unit!r}")
    found.append(held(file, "units and meanings", "the schemas", not off, ", ".join(off[:3]), len(names)))
    frame, wrong = run.table(file), []
    for column in schema.columns:
        if not column.type.startswith(("float", "int")):
            continue
        values = frame[column.name].to_numpy(float)
        if not column.missing and not np.isfinite(values).all():
            wrong.append(f"{column.name} is not finite")
        if column.minimum is not None and (values < column.minimum).any():
            wrong.append(f"{column.name} below {column.minimum:g}")
    found.append(held(file, "finite and within range", "numpy", not wrong, ", ".join(wrong[:3]), len(frame)))
    return found


def _provenance(run: Audited, file: str, facts: dict[str, Any]) -> list[Finding]:
    origin = facts["elastocal.provenance"]
    configuration = origin.get("configuration", {})
    digest = hashlib.sha256(json.dumps(configuration, sort_keys=True).encode()).hexdigest()[:16]
    by = "its own metadata"
    found = [
        held(file, "digest of its configuration", "hashlib, SHA-256", digest == origin.get("configuration_sha256"), digest),
        held(
            file,
            "version of the package",
            by,
            origin.get("elastocal_version") == __version__,
            str(origin.get("elastocal_version")),
        ),
    ]
    place = next((match.groupdict() for pattern in _PLACES if (match := pattern.fullmatch(file))), {})
    off = [f"{name} {origin.get(name)!r}" for name, value in place.items() if name in origin and str(origin[name]) != value]
    found.append(held(file, "made for where it lies", by, not off, ", ".join(off), max(len(place), 1)))
    expected = _configured(run, place) | {"seed": run.seed}
    inner = configuration | configuration.get("study", {})
    off = [
        f"{name}: {str(inner[name])[:60]}, configured {str(value)[:60]}"
        for name, value in expected.items()
        if name in inner and json.loads(json.dumps(value)) != inner[name]
    ]
    found.append(held(file, "made by what is configured", by, not off, ", ".join(off[:2]), len(expected)))
    return found


def _configured(run: Audited, place: dict[str, str]) -> dict[str, Any]:
    """What config.yaml and the files of robots and strategies say of the settings of a file."""
    settings = run.configuration
    found = {"tool_offset_m": settings["interpretations"]["tool_offset_m"], "wrench_at": run.wrench_at}
    if place.get("robot") in run.robots:
        robot = run.robots[place["robot"]]
        found |= {"robot": robot, "chain": robot["chain"], "lengths_m": robot.get("lengths_m", {})}
    if place.get("strategy") in run.strategies:
        found["strategy"] = run.strategies[place["strategy"]]
    return found
