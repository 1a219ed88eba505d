"""The whole audit: every file of a finished run by every check that there is for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from elastocal.audit import (
    assumptions,
    bad_rows,
    blind_cases,
    blind_tables,
    campaign_data,
    campaigns,
    choices,
    closed_loop,
    data,
    estimates,
    fits,
    held_out,
    league,
    questions,
    scores,
    tables,
)
from elastocal.audit.files import described, intact
from elastocal.audit.findings import Finding, held
from elastocal.errors import InputError
from elastocal.io.records import RECORDS, recorded

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable

    from elastocal.audit.audited import Audited

_CHECKED = (
    *(data, estimates, scores, questions, choices, assumptions, tables),
    *(campaign_data, campaigns, fits, held_out, league, closed_loop, bad_rows, blind_cases, blind_tables),
)
_CHECKS = tuple(check for module in _CHECKED for check in module.CHECKS)
# What an audit itself wrote is not audited.
_OWN = "reports/audit."
COLUMNS = ("file", "checked", "by", "compared", "worst", "holds", "note")


def audit(run: Audited, only: Collection[str] | None = None) -> list[Finding]:
    """Check a finished run.

    `only`: these files; without it every file that a job has recorded. Returns a check that cannot be carried out, for a file
    that cannot be read or lacks a column, does not hold.
    """
    found = []
    for file, digest in recorded(run.folder).items():
        if file in only if only is not None else not file.startswith(_OWN):
            found.append(intact(run, file, digest))
            if run.there(file):
                found += _recomputed(run, file)
    if not found:
        found.append(held(RECORDS.as_posix(), "files that a job recorded", "counting", False, "none; is the run finished?"))
    return found


def as_table(findings: Iterable[Finding]) -> pd.DataFrame:
    """Findings as rows of audit.csv."""
    return pd.DataFrame([{name: getattr(each, name) for name in COLUMNS} for each in findings], columns=[*COLUMNS])


def require_all(table: pd.DataFrame, page: str) -> str:
    """One line on a run whose audit finds no fault with it.

    `table`: from `as_table`. `page`: where the findings stand. Raises `InputError`: some check does not hold; the first one is
    named.
    """
    wrong = table[~table["holds"].astype(bool)]
    if len(wrong):
        first = wrong.iloc[0]
        found = f"{first['checked']}: {first['note']} ({len(wrong)} of {len(table)} checks do not hold, see {page})"
        raise InputError(first["file"], "", found, "what the independent path finds")
    values = int(table["compared"].sum())
    return f"{table['file'].nunique()} files, {len(table)} checks, {values} values compared: all hold\n"


def _recomputed(run: Audited, file: str) -> list[Finding]:
    """Findings of one file; whatever a damaged file makes of a check is a finding too."""
    found: list[Finding] = []
    checks: list[tuple[Callable[..., list[Finding]], tuple[str, ...]]] = []
    if file.endswith(".parquet"):
        checks.append((described, ()))
    checks += [(check, match.groups()) for pattern, check in _CHECKS if (match := pattern.fullmatch(file))]
    for check, places in checks:
        try:
            found += check(run, file, *places)
        except (ArithmeticError, LookupError, OSError, TypeError, ValueError) as error:
            reason = str(error).splitlines()[0] if str(error) else ""
            found.append(held(file, f"check {check.__name__}", "", False, f"{type(error).__name__}: {reason}"[:200]))
    return found
