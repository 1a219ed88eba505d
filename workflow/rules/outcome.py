"""The outcome of a finished run: where each report is that it made and, of a campaign, the verdict."""

import json
import re
from collections.abc import Iterable
from pathlib import Path

_CAMPAIGN = re.compile(r"reports/loop/([^/]+)/report\.pdf")
_REPORTS = {"reports/study.pdf": "the study", "reports/blind/blind.pdf": "the blind proof"}


def outcome(made: Iterable[str]) -> list[str]:
    """Lines about the reports among the files that a run has made."""
    # Only a run that has made a report needs what makes its sentences.
    from elastocal.report.first_page import headline, headline_sentence, sentences

    lines = []
    for path in sorted(map(str, made)):
        if path in _REPORTS:
            lines.append(f"{_REPORTS[path]}: {path}")
        if match := _CAMPAIGN.fullmatch(path):
            verdict = json.loads(Path(path).with_name("verdict.json").read_text(encoding="utf-8"))
            stated = headline(verdict)
            errors = [f"    {headline_sentence(stated)}"] if stated else []
            lines += [f"{match[1]}: {sentences(verdict)[0]}", *errors, f"    {path}"]
    return lines
