"""Verdicts on the blind campaigns: the analyst's side, in processes that know neither
the ground truths nor the simulated robots."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from elastocal.io.json_files import write_json
from elastocal.loop.whole import diagnose_folder


def diagnose_cases(job: Any) -> None:
    """Diagnose a block of blind cases; this process opens no sealed file."""
    folders = sorted(
        folder for folder in Path(job.input.blind).iterdir() if folder.is_dir()
    )
    verdicts = []
    for number, folder in enumerate(folders, 1):
        verdicts.append(
            diagnose_folder(folder.as_posix(), job.params.robots, job.params.seed)
        )
        print(
            f"{job.wildcards.block}: {number} of {len(folders)} cases",
            file=sys.stderr,
            flush=True,
        )
    write_json(job.output.verdicts, verdicts, allow_nan=False)
