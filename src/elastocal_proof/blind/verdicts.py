"""Verdicts on campaigns of the blind proof, as they are and with further poses: the analyst's side.

Processes that run this know neither ground truths nor the plant; `carrying_out` is the other side.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elastocal.diagnosis.verdict import NAMED
from elastocal.io.json_files import write_json
from elastocal.loop.whole import diagnosed

if TYPE_CHECKING:
    from collections.abc import Callable

# Poses after which a verdict is stated anew.
POSES = (5, 10, 20)
# Where the poses come from: the loop's proposal, or drawn as those of the campaign were.
ARMS = ("proposed", "random")


def folder_of(campaigns: str | Path, arm: str, poses: int, case: str) -> str:
    """Where the campaign of a case with further poses lies."""
    return f"{campaigns}/{arm}_{poses}/{case}"


def diagnosed_anew(campaigns: str | Path, verdict_on: Callable[[str], dict[str, Any]]) -> list[dict[str, Any]]:
    """Verdicts on all that was followed up in a block, with more and more poses until a single name is stated.

    `campaigns`: as `folder_of` has them; empty where nothing was followed up. Returns ``campaign, arm, poses, verdict``; what
    is measured after a single name is not looked at.
    """
    anew = []
    for name in sorted({folder.name for folder in Path(campaigns).glob("*/*")}):
        for arm in ARMS:
            for poses in POSES:
                verdict = verdict_on(folder_of(campaigns, arm, poses, name))
                anew.append({"campaign": name, "arm": arm, "poses": poses, "verdict": verdict})
                if verdict["verdict"] == NAMED:
                    break
    return anew


def diagnose_cases(job: Any) -> None:
    """Verdicts on a block of blind cases; this process opens no sealed file."""
    folders = sorted(folder for folder in Path(job.input.blind).iterdir() if folder.is_dir())
    verdicts = []
    for number, folder in enumerate(folders, 1):
        verdicts.append(diagnosed(folder.as_posix(), job.params.robots, job.params.seed))
        print(f"{job.wildcards.block}: {number} of {len(folders)} cases", file=sys.stderr, flush=True)
    write_json(job.output.verdicts, verdicts, allow_nan=False)


def diagnose_follow_ups(job: Any) -> None:
    """Verdicts anew on campaigns with further poses; this process opens no sealed file."""

    def verdict_on(folder: str) -> dict[str, Any]:
        print(f"{job.wildcards.block}: {folder}", file=sys.stderr, flush=True)
        return diagnosed(folder, job.params.robots, job.params.seed)

    write_json(job.output.verdicts, diagnosed_anew(job.input.campaigns, verdict_on), allow_nan=False)
