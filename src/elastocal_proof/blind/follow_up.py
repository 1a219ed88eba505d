"""The analyst's side of the blind proof: verdicts on the campaigns, what to measure next, and the verdicts on that.

Processes that run this know neither ground truths nor the plant; `carrying_out` is the other side.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.next_experiment import propose
from elastocal.diagnosis.proposal import table_of
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import CLASS, NAMED
from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json, write_json
from elastocal.loop.whole import cases_in, diagnosed
from elastocal.random_streams import stream

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

# Poses after which a verdict is stated anew.
POSES = (5, 10, 20)
# Shares of its load at which each is read, as each pose of the campaign was.
LADDER = (0.0, 1.0, 0.5, -0.5, -1.0)
# Where the poses come from: the loop's proposal, or drawn as those of the campaign were.
ARMS = ("proposed", "random")


def folder_of(campaigns: str | Path, arm: str, poses: int, case: str) -> str:
    """Where the campaign of a case with further poses lies."""
    return f"{campaigns}/{arm}_{poses}/{case}"


def followed_up(verdicts: Iterable[dict[str, Any]], most: int) -> list[dict[str, Any]]:
    """The first verdicts "class" with alternatives, for which an experiment is proposed, by the names of their cases."""
    classes = [v for v in verdicts if v["verdict"] == CLASS and any(effect["alternatives"] for effect in v["effects"])]
    return sorted(classes, key=lambda verdict: verdict["campaign"])[:most]


def proposed(folder: str | Path, robots_folder: str | Path, seed: int) -> pd.DataFrame:
    """Poses that best distinguish what was found in a campaign from its alternatives, read at all its targets.

    Returns as `proposal.table_of`.
    """
    case, _ = cases_in(folder, robots_folder)
    robot, settings = case.campaign.robot, Settings()
    draws = stream(seed, case.campaign.name, "next experiment", 0)
    found = diagnose(case, settings, seed)
    return table_of(propose(found, robot.joint_limits, settings, draws, max(POSES), LADDER), robot)


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


def propose_follow_ups(job: Any) -> None:
    """What to measure next for the first cases of a block that end in a class; this process opens no sealed file."""
    frames = [pd.DataFrame({"case": []})]
    for verdict in followed_up(read_json(job.input.verdicts), job.params.most):
        name = verdict["campaign"]
        frames.append(proposed(f"{job.input.blind}/{name}", job.params.robots, job.params.seed).assign(case=name))
    write_csv(job.output.proposals, pd.concat(frames, ignore_index=True))


def diagnose_follow_ups(job: Any) -> None:
    """Verdicts anew on campaigns with further poses; this process opens no sealed file."""

    def verdict_on(folder: str) -> dict[str, Any]:
        print(f"{job.wildcards.block}: {folder}", file=sys.stderr, flush=True)
        return diagnosed(folder, job.params.robots, job.params.seed)

    write_json(job.output.verdicts, diagnosed_anew(job.input.campaigns, verdict_on), allow_nan=False)
