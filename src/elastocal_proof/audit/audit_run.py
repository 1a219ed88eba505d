"""The whole audit of a finished run: checksum and settings of every file, and the
checks that compute its values again, as a table and a page."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from importlib import resources
from operator import attrgetter
from typing import Any

import pandas as pd
import pyarrow.parquet as pq
from jinja2 import Environment

from elastocal import __version__
from elastocal.io.records import RECORDS, list_recorded_files
from elastocal_proof.audit import campaigns, fits, probabilities, scores, study
from elastocal_proof.audit.finished_run import Finding, FinishedRun, require

_Check = Callable[..., Iterator[Finding]]

_SHA = "hashlib, SHA-256"
_SAME_JOB = "the same job, run again"
_METADATA = "its own metadata"
# Checks that apply to every file, in terms of `Finding.by`. All other checks compute
# values again.
OF_EVERY_FILE = ("its record", _SHA, _METADATA)
# Checks that compute a file again, by the pattern of its name. Names in braces are
# arguments of the check.
CHECKS: list[tuple[str, _Check]] = [
    item
    for module in (study, scores, campaigns, fits, probabilities)
    for item in module.CHECKS.items()
]
COLUMNS = ("file", "checked", "by", "compared", "worst", "holds", "note")
# SHA-256 of the files that their jobs have made again, written by the rule
# `remake_files`.
_REMADE = "results/remade.json"
_OF_AUDIT = ("reports/audit.", _REMADE)
# Findings that the page shows in full.
_MOST_SHOWN = 200


def audit_run(run: FinishedRun, only: Collection[str] | None = None) -> list[Finding]:
    """Check every file that a job of a finished run has recorded, or those in `only`.

    A check that fails with an error, because a file cannot be read or lacks a column,
    does not hold.
    """
    findings = []
    remade = run.document(_REMADE) if run.has(_REMADE) else {}
    for file, digest in list_recorded_files(run.folder).items():
        # Outputs of an earlier audit are not audited by default.
        if file in only if only is not None else not file.startswith(_OF_AUDIT):
            findings.append(replace(check_checksum(run, file, digest), file=file))
            if run.has(file):
                findings += _recompute(run, file)
                if file in remade:
                    same_bytes = check_remade(run, file, remade[file])
                    findings.append(replace(same_bytes, file=file))
    if findings:
        return findings
    note = "none; is the run finished?"
    missing = require(
        "files that a job recorded", "counting", holds=False, note=note, count=0
    )
    return [replace(missing, file=RECORDS.as_posix())]


def find_checks(
    file: str,
) -> list[tuple[str, _Check, dict[str, str]]]:
    """Find the checks that compute a file again: the pattern of its name, the check,
    and its arguments."""
    checks = []
    for pattern, check in CHECKS:
        expression = re.sub(r"{(\w+)}", r"(?P<\1>[^/]+)", pattern.replace(".", r"\."))
        match = re.fullmatch(expression, file)
        if match:
            checks.append((pattern, check, match.groupdict()))
    return checks


def tabulate_findings(findings: Iterable[Finding]) -> pd.DataFrame:
    """Tabulate findings as rows of audit.csv."""
    rows = map(attrgetter(*COLUMNS), findings)
    return pd.DataFrame(list(rows), columns=[*COLUMNS])


def render_page(table: pd.DataFrame, facts: Mapping[str, str]) -> str:
    """Render audit.html, which needs no network.

    Parameters
    ----------
    table : from `tabulate_findings`
    facts : head of the page, such as the seed
    """
    labelled = table.assign(kind=table["file"].map(_name_kind))
    is_remade = labelled["by"] == _SAME_JOB
    recomputed = labelled[~is_remade & ~labelled["by"].isin(OF_EVERY_FILE)]
    remade = labelled[is_remade]
    again = {*recomputed["kind"], *remade["kind"]}
    unchanged = labelled[~labelled["kind"].isin(again)]
    failed = table[~table["holds"]]
    page = resources.files("elastocal_proof.audit").joinpath("audit.html")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(page.read_text("utf-8")).render(
        facts=facts,
        wrong=failed.head(_MOST_SHOWN).to_dict("records"),
        recomputed=_summarize_kinds(recomputed),
        remade=_summarize_kinds(remade),
        rest=_summarize_kinds(unchanged),
        files=table["file"].nunique(),
        files_again=recomputed["file"].nunique(),
        files_remade=remade["file"].nunique(),
        checks=len(table),
        values=int(table["compared"].sum()),
        failed=len(failed),
    )


def _summarize_kinds(labelled: pd.DataFrame) -> list[dict[str, Any]]:
    """Summarize the findings of each kind of files in one row."""
    rows = []
    for kind, findings in labelled.groupby("kind", sort=True):
        summaries = [
            (check.__doc__ or "").partition("\n")[0]
            for _, check, _ in find_checks(findings["file"].iloc[0])
        ]
        row = {
            "kind": kind,
            "meaning": " ".join(summaries),
            "files": findings["file"].nunique(),
            "checks": len(findings),
            "worst": findings["worst"].max(),
            "failed": int((~findings["holds"]).sum()),
            "by": ", ".join(dict.fromkeys(filter(None, findings["by"]))),
        }
        rows.append(row)
    return rows


def _name_kind(file: str) -> str:
    """Name the kind of a file: the pattern of its name with asterisks or, if nothing
    computes it again, its folder and suffix."""
    for pattern, _, _ in find_checks(file):
        return re.sub(r"\{\w+\}", "*", pattern)
    folder, _, name = file.rpartition("/")
    return f"{folder}/*{name[name.find('.') :]}"


def _recompute(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Check the values of one file; an error that a damaged file causes is a finding as
    well."""
    checks: list[tuple[_Check, dict[str, str]]] = [
        (check, arguments) for _, check, arguments in find_checks(file)
    ]
    if file.endswith(".parquet"):
        checks.insert(0, (check_provenance, {}))
    for check, arguments in checks:
        try:
            for finding in check(run, file, **arguments):
                yield replace(finding, file=file)
        except (ArithmeticError, LookupError, OSError, TypeError, ValueError) as error:
            message = str(error).partition("\n")[0]
            note = f"{type(error).__name__}: {message}"[:200]
            name = check.__name__.replace("_", " ")
            yield replace(require(name, "", holds=False, note=note), file=file)


def check_checksum(run: FinishedRun, file: str, digest: str) -> Finding:
    """Check that a file holds the bytes that its job wrote, by their recorded
    digest."""
    if not run.has(file):
        return require(
            "the file is there", "its record", holds=False, note="it is missing"
        )
    actual = hashlib.sha256((run.folder / file).read_bytes()).hexdigest()
    return require(
        "bytes as its job wrote them",
        _SHA,
        actual == digest,
        f"{actual[:12]}, recorded {digest[:12]}",
    )


def check_remade(run: FinishedRun, file: str, digest: str) -> Finding:
    """Check that a file holds the bytes that its job writes when it is run again, by
    their digest, which is empty if the job failed."""
    actual = hashlib.sha256((run.folder / file).read_bytes()).hexdigest()
    note = f"{actual[:12]}, made again {digest[:12] or 'in vain: its job failed'}"
    return require("bytes as made again", _SAME_JOB, actual == digest, note)


def check_provenance(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Compare the settings that a Parquet file of the pipeline states with its path,
    config.yaml and files of robots."""
    metadata = pq.ParquetFile(run.folder / file).metadata.metadata or {}
    if b"elastocal.provenance" not in metadata:
        return
    origin = json.loads(metadata[b"elastocal.provenance"])
    configuration = origin.get("configuration", {})
    text = json.dumps(configuration, sort_keys=True)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    yield require(
        "digest of its configuration",
        _METADATA,
        digest == origin.get("configuration_sha256"),
        digest,
    )
    version = origin.get("elastocal_version")
    yield require(
        "version of the package", _METADATA, version == __version__, str(version)
    )
    stated = {
        name: f"{origin[name]}um" if name == "noise" else str(origin[name])
        for name in ("robot", "noise", "strategy", "campaign")
        if name in origin
    }
    parts = file.removesuffix(".parquet").split("/")
    wrong = [f"{name} {part}" for name, part in stated.items() if part not in parts]
    yield require(
        "made for where it lies", _METADATA, not wrong, ", ".join(wrong), len(stated)
    )
    expected = _list_expected_settings(run, file, stated)
    actual = configuration | configuration.get("study", {})
    # JSON turns tuples into lists.
    wrong = [
        name
        for name, setting in expected.items()
        if name in actual and json.loads(json.dumps(setting)) != actual[name]
    ]
    yield require(
        "made by what is configured",
        _METADATA,
        not wrong,
        f"not the configured {', '.join(wrong)}",
        len(expected),
    )


def _list_expected_settings(
    run: FinishedRun, file: str, stated: Mapping[str, str]
) -> dict[str, Any]:
    """List the configured settings for the robot and strategy that a file states; for
    the studies of an alternative to an interpretation, the settings of the alternative."""
    alternatives = run.configuration["evaluation"]["alternatives"]
    is_alternative = file.startswith("results/alternatives/")
    number = file.split("/")[2] if is_alternative else ""
    interpretations = run.configuration["interpretations"]
    interpretations = interpretations | alternatives["interpretations"].get(number, {})
    settings: dict[str, Any] = {
        "tool_offset_m": interpretations["tool_offset_m"],
        "wrench_at": interpretations["wrench_at"],
        "seed": run.seed,
    }
    name = stated.get("robot", "")
    if name in run.robots:
        robot = run.robots[name]
        lengths_m = robot.get("lengths_m", {})
        changed_m = alternatives["lengths_m"].get(number, {}).get(name, {})
        if changed_m:
            lengths_m = {**lengths_m, **changed_m}
            robot = {**robot, "lengths_m": lengths_m}
        settings["robot"] = robot
        settings["chain"] = robot["chain"]
        settings["lengths_m"] = lengths_m
    strategy = run.strategies.get(stated.get("strategy", ""))
    if strategy is not None:
        settings["strategy"] = strategy
    return settings
