"""What to measure next where a blind case ends in a class: the analyst's side, without ground truths and plant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.next_experiment import propose, table_of
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import CLASS
from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json
from elastocal.loop.whole import cases_in
from elastocal.random_streams import stream
from elastocal_proof.blind.verdicts import POSES

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

# Shares of its load at which each is read, as each pose of the campaign was.
LADDER = (0.0, 1.0, 0.5, -0.5, -1.0)


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


def propose_follow_ups(job: Any) -> None:
    """What to measure next for the first cases of a block that end in a class; this process opens no sealed file."""
    frames = [pd.DataFrame({"case": []})]
    for verdict in followed_up(read_json(job.input.verdicts), job.params.most):
        name = verdict["campaign"]
        frames.append(proposed(f"{job.input.blind}/{name}", job.params.robots, job.params.seed).assign(case=name))
    write_csv(job.output.proposals, pd.concat(frames, ignore_index=True))
