"""The whole audit: checksum and settings of every file of a finished run, and what
works it out again, as table and page."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from importlib import resources
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
from jinja2 import Environment

from elastocal import __version__
from elastocal.io.records import RECORDS, list_recorded_files
from elastocal_proof.audit import campaigns, fits, study
from elastocal_proof.audit.finished_run import Finding, FinishedRun, require

_SHA = "hashlib, SHA-256"
_OWN_WORDS = "its own metadata"
# By what every file is checked, whatever it holds; other checks work something out
# again.
OF_EVERY_FILE = ("its record", _SHA, _OWN_WORDS)
# What works a file out again, by the form of its name; what stands in braces are
# arguments.
CHECKS = tuple(
    (form, check)
    for room in (study, campaigns, fits)
    for form, check in room.CHECKS.items()
)
_PATTERNS = [
    re.compile(re.sub(r"{(\w+)}", r"(?P<\1>[^/]+)", form.replace(".", r"\.")))
    for form, _ in CHECKS
]
COLUMNS = ("file", "checked", "by", "compared", "worst", "holds", "note")


def audit_run(run: FinishedRun, only: Collection[str] | None = None) -> list[Finding]:
    """Check a finished run: every file that a job has recorded, or those that are
    named.

    A check that cannot be carried out, for a file that cannot be read or has no such
    column, does not hold.
    """
    found = []
    for file, digest in list_recorded_files(run.folder).items():
        # What an audit itself wrote is not audited.
        if file in only if only is not None else not file.startswith("reports/audit."):
            found.append(replace(check_checksum(run, file, digest), file=file))
            found += _recompute(run, file) if run.has(file) else ()
    return found or [
        Finding(
            "files that a job recorded",
            "counting",
            0,
            np.inf,
            "none; is the run finished?",
            RECORDS.as_posix(),
        )
    ]


def find_checks(
    file: str,
) -> list[tuple[str, Callable[..., Iterator[Finding]], dict[str, str]]]:
    """The checks of a file: the form of its name, what works it out again, and with
    which arguments."""
    pairs = zip(CHECKS, _PATTERNS, strict=True)
    return [
        (*check, match.groupdict())
        for check, pattern in pairs
        if (match := pattern.fullmatch(file))
    ]


def tabulate_findings(findings: Iterable[Finding]) -> pd.DataFrame:
    """Findings as rows of audit.csv."""
    return pd.DataFrame(
        [{name: getattr(each, name) for name in COLUMNS} for each in findings],
        columns=[*COLUMNS],
    )


def render_page(table: pd.DataFrame, facts: Mapping[str, str]) -> str:
    """audit.html, which asks nothing of the network; `table`: from `as_table`; `facts`:
    what heads it, such as the seed."""
    labelled = table.assign(kind=table["file"].map(_kind_of))
    of_every_file = labelled["by"].isin(OF_EVERY_FILE)
    wrong = table[~table["holds"]]
    recomputed = labelled[~of_every_file]
    alike = labelled[
        of_every_file & ~labelled["kind"].isin(labelled["kind"][~of_every_file])
    ]
    template = (
        resources.files("elastocal_proof.audit")
        .joinpath("audit.html")
        .read_text("utf-8")
    )
    shown: dict[str, Any] = {
        "facts": facts,
        "wrong": wrong.head(200).to_dict("records"),
    }
    shown |= {"recomputed": _by_kind(recomputed), "rest": _by_kind(alike)}
    shown |= {
        "files": table["file"].nunique(),
        "files_again": recomputed["file"].nunique(),
        "checks": len(table),
    }
    shown |= {"values": int(table["compared"].sum()), "failed": len(wrong)}
    return (
        Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
        .from_string(template)
        .render(shown)
    )


def _by_kind(labelled: pd.DataFrame) -> list[dict[str, Any]]:
    """Files that are made alike as one row each."""
    rows = []
    for kind, some in labelled.groupby("kind", sort=True):
        words = " ".join(
            (check.__doc__ or "").split("\n")[0]
            for _, check, _ in find_checks(some["file"].iloc[0])
        )
        row = {
            "kind": kind,
            "meaning": words,
            "files": some["file"].nunique(),
            "checks": len(some),
        }
        row |= {"worst": some["worst"].max(), "failed": int((~some["holds"]).sum())}
        rows.append(row | {"by": ", ".join(dict.fromkeys(filter(None, some["by"])))})
    return rows


def _kind_of(file: str) -> str:
    """Files that are made alike, by the form of their names, or where none is worked
    out again by the folder and the ending."""
    form = next((form for form, _, _ in find_checks(file)), "")
    folder, _, name = file.rpartition("/")
    return re.sub(r"\{\w+\}", "*", form) or f"{folder}/*{name[name.find('.') :]}"


def _recompute(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Findings of one file; whatever a damaged file makes of a check is a finding
    too."""
    checks = [(check_provenance, dict[str, str]())] * file.endswith(".parquet") + [
        each[1:] for each in find_checks(file)
    ]
    for check, arguments in checks:
        try:
            for finding in check(run, file, **arguments):
                yield replace(finding, file=file)
        except (ArithmeticError, LookupError, OSError, TypeError, ValueError) as error:
            note = f"{type(error).__name__}: {next(iter(str(error).splitlines()), '')}"[
                :200
            ]
            yield replace(
                require(f"check {check.__name__}", "", False, note), file=file
            )


def check_checksum(run: FinishedRun, file: str, digest: str) -> Finding:
    """Whether a file holds what its job wrote."""
    if not run.has(file):
        return require("the file is there", "its record", False, "it is missing")
    found = hashlib.sha256((run.folder / file).read_bytes()).hexdigest()
    return require(
        "bytes as its job wrote them",
        _SHA,
        found == digest,
        f"{found[:12]}, recorded {digest[:12]}",
    )


def check_provenance(run: FinishedRun, file: str) -> Iterator[Finding]:
    """What a Parquet file of the pipeline says of its own settings, against its path,
    config.yaml and files of robots."""
    origin = json.loads(
        (pq.ParquetFile(run.folder / file).metadata.metadata or {}).get(
            b"elastocal.provenance", "null"
        )
    )
    if origin is None:
        return
    configuration = origin.get("configuration", {})
    version = origin.get("elastocal_version")
    digest = hashlib.sha256(
        json.dumps(configuration, sort_keys=True).encode()
    ).hexdigest()[:16]
    yield require(
        "digest of its configuration",
        _OWN_WORDS,
        digest == origin.get("configuration_sha256"),
        digest,
    )
    yield require(
        "version of the package", _OWN_WORDS, version == __version__, str(version)
    )
    place = {
        name: str(origin[name])
        for name in ("robot", "noise", "strategy", "campaign")
        if name in origin
    }
    parts = file.removesuffix(".parquet").split("/")
    off = [
        f"{name} {word}"
        for name, word in place.items()
        if word + "um" * (name == "noise") not in parts
    ]
    yield require(
        "made for where it lies", _OWN_WORDS, not off, ", ".join(off), len(place)
    )
    tool = run.configuration["interpretations"]["tool_offset_m"]
    robot = run.robots.get(place.get("robot", ""))
    expected: dict[str, Any] = {
        "tool_offset_m": tool,
        "wrench_at": run.wrench_at,
        "seed": run.seed,
    }
    if robot is not None:
        expected |= {
            "robot": robot,
            "chain": robot["chain"],
            "lengths_m": robot.get("lengths_m", {}),
        }
    if place.get("strategy") in run.strategies:
        expected["strategy"] = run.strategies[place["strategy"]]
    inner = configuration | configuration.get("study", {})
    off = [
        name
        for name, value in expected.items()
        if name in inner and json.loads(json.dumps(value)) != inner[name]
    ]
    yield require(
        "made by what is configured",
        _OWN_WORDS,
        not off,
        f"not the configured {', '.join(off)}",
        len(expected),
    )
