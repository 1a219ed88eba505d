"""Report the outcome of a finished run: its reports, and the verdict on a campaign."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.verdict import read_verdict

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.verdict import Verdict

_CAMPAIGN = re.compile(r"reports/loop/([^/]+)/report\.pdf")
# Verdicts after which the robot is corrected; after other verdicts the report says what to
# do.
_CORRECTABLE = ("adequate", "named", "class", "several")
_REPORTS = {
    "reports/paper.pdf": "the paper, regenerated",
    "reports/study.pdf": "the study",
    "reports/blind/targets.md": "the blind benchmark",
}


def describe_outcome(
    made: Iterable[str], workplace: str | Path = "", folder: str | Path = "CAMPAIGN"
) -> list[str]:
    """Return lines about the reports among the files that a run has made.

    Parameters
    ----------
    made : iterable of str
        Files, relative to the workplace.
    workplace : str or path
        Folder of the run. A report is named with it, because a user may have called the
        command in another folder.
    folder : str or path
        Folder of the campaign, for the next command.
    """
    lines = []
    advice = []
    for path in sorted(map(str, made)):
        if path in _REPORTS:
            lines.append(f"{_REPORTS[path]}: {path}")
        match = _CAMPAIGN.fullmatch(path)
        if match:
            verdict = read_verdict(Path(workplace, path).with_name("verdict.json"))
            report = Path(workplace, path).resolve()
            lines += [*describe_verdict(match[1], verdict), f"  report: {report}"]
            advice.append(_advise(verdict, folder))
    # With several campaigns, each report has its own advice.
    return lines + advice if len(advice) == 1 else lines


def describe_verdict(name: str, verdict: Verdict) -> list[str]:
    """Describe the verdict on a campaign of this name, its errors and its warnings, in
    lines."""
    # Import the templates only here, because a run without a report does not need them.
    from elastocal.report.loop_facts import render_campaign_sentences

    stated = render_campaign_sentences(verdict)
    mark = "✓" if _is_correctable(verdict) else "!"
    return [
        f"{mark} {name}: {stated['sentences'][0]}",
        *(f"  {line}" for line in stated["headline_line"]),
        *(f"  {line}" for line in stated["left_out"]),
        *(f"! {warning}" for warning in stated["warnings"]),
    ]


def _advise(verdict: Verdict, folder: str | Path) -> str:
    if _is_correctable(verdict):
        words = ["correct", str(folder), "path.csv", "--output", "targets.csv"]
        return f"next: elastocal {shlex.join(words)}"
    return 'next: "What to do now" on the first page of the report'


def _is_correctable(verdict: Verdict) -> bool:
    return verdict.verdict in _CORRECTABLE and not verdict.faults
