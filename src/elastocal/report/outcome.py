"""The outcome of a finished run: where each report is that it made and, of a campaign,
the verdict."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.verdict import read_verdict

if TYPE_CHECKING:
    from collections.abc import Iterable

_CAMPAIGN = re.compile(r"reports/loop/([^/]+)/report\.pdf")
# Verdicts after which the robot is corrected; after the others its report says what to
# do.
_OF_USE = ("adequate", "named", "class", "several")
_REPORTS = {
    "reports/paper.pdf": "the paper, regenerated",
    "reports/study.pdf": "the study",
    "reports/blind/targets.md": "the blind proof",
}


def outcome(made: Iterable[str], workplace: str | Path = "") -> list[str]:
    """Lines about the reports among the files that a run has made, which are named from
    the workplace."""
    # Only a run that has made a report needs what makes its sentences.
    from elastocal.report.loop_facts import campaign_sentences

    lines = []
    following = []
    for path in sorted(map(str, made)):
        if path in _REPORTS:
            lines.append(f"{_REPORTS[path]}: {path}")
        if match := _CAMPAIGN.fullmatch(path):
            verdict = read_verdict(Path(workplace, path).with_name("verdict.json"))
            of_use = verdict.verdict in _OF_USE and not verdict.faults
            stated = campaign_sentences(verdict)
            errors = [f"  {line}" for line in stated["headline_line"]]
            lines += [
                f"{'✓' if of_use else '!'} {match[1]}: {stated['sentences'][0]}",
                *errors,
                f"  report: {path}",
            ]
            then = (
                "elastocal correct, elastocal certificate"
                if of_use
                else '"What to do now" on the first page of the report'
            )
            following.append(f"next: {then}")
    # Of several campaigns each report says it.
    return [*lines, *(following if len(following) == 1 else [])]
