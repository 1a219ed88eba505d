"""The whole audit: every file of a finished run by every check that there is for it."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pandas as pd

from elastocal.errors import InputError
from elastocal.io.records import RECORDS, recorded
from elastocal_proof.audit import (
    assumptions,
    campaigns,
    choices,
    data,
    decisions,
    estimates,
    fits,
    held_out,
    proofs,
    questions,
    scores,
    tables,
)
from elastocal_proof.audit.files import described, intact
from elastocal_proof.audit.findings import Finding, require

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator

    from elastocal_proof.audit.audited import Audited

_ROOMS = (data, estimates, scores, questions, choices, decisions, assumptions, tables, campaigns, fits, held_out, proofs)
# What works a file out again, by the form of its name; what stands in braces are arguments.
CHECKS = tuple((form, check) for room in _ROOMS for form, check in room.CHECKS.items())
_PATTERNS = [re.compile(re.sub(r"{(\w+)}", r"(?P<\1>[^/]+)", form.replace(".", r"\."))) for form, _ in CHECKS]
# What an audit itself wrote is not audited.
_OWN = "reports/audit."
COLUMNS = ("file", "checked", "by", "compared", "worst", "holds", "note")


def audit(run: Audited, only: Collection[str] | None = None) -> list[Finding]:
    """Check a finished run: every file that a job has recorded, or those that are named.

    A check that cannot be carried out, for a file that cannot be read or has no such column, does not hold.
    """
    found = []
    for file, digest in recorded(run.folder).items():
        if file in only if only is not None else not file.startswith(_OWN):
            found.append(replace(intact(run, file, digest), file=file))
            found += _recompute(run, file) if run.has(file) else ()
    nothing = require("files that a job recorded", "counting", False, "none; is the run finished?")
    return found or [replace(nothing, file=RECORDS.as_posix())]


def checks_of(file: str) -> list[tuple[str, Callable[..., Iterator[Finding]], dict[str, str]]]:
    """The checks of a file: the form of its name, what works it out again, and with which arguments."""
    pairs = zip(CHECKS, _PATTERNS, strict=True)
    return [(*check, match.groupdict()) for check, pattern in pairs if (match := pattern.fullmatch(file))]


def as_table(findings: Iterable[Finding]) -> pd.DataFrame:
    """Findings as rows of audit.csv."""
    return pd.DataFrame([{name: getattr(each, name) for name in COLUMNS} for each in findings], columns=[*COLUMNS])


def require_all(table: pd.DataFrame, page: str) -> str:
    """One line on a run whose audit finds no fault with it; `page`: where the findings stand.

    Raises `InputError`: some check does not hold; the first one is named.
    """
    wrong = table[~table["holds"].astype(bool)]
    if len(wrong):
        first = wrong.iloc[0]
        found = f"{first['checked']}: {first['note']} ({len(wrong)} of {len(table)} checks do not hold, see {page})"
        raise InputError(first["file"], "", found, "what the independent path finds")
    values = int(table["compared"].sum())
    return f"{table['file'].nunique()} files, {len(table)} checks, {values} values compared: all hold\n"


def _recompute(run: Audited, file: str) -> Iterator[Finding]:
    """Findings of one file; whatever a damaged file makes of a check is a finding too."""
    checks = [(described, dict[str, str]())] * file.endswith(".parquet") + [each[1:] for each in checks_of(file)]
    for check, arguments in checks:
        try:
            for finding in check(run, file, **arguments):
                yield finding if finding.file else replace(finding, file=file)
        except (ArithmeticError, LookupError, OSError, TypeError, ValueError) as error:
            note = f"{type(error).__name__}: {next(iter(str(error).splitlines()), '')}"[:200]
            yield replace(require(f"check {check.__name__}", "", False, note), file=file)
