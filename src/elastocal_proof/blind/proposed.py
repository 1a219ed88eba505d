"""The next experiment for a campaign that was diagnosed in one call, from its folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.next_experiment import propose, table_of
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import cases_in
from elastocal.random_streams import stream

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd


def proposed(folder: str | Path, robots_folder: str | Path, poses: int, ladder: tuple[float, ...], seed: int) -> pd.DataFrame:
    """Poses that best distinguish what was found in a campaign from its alternatives.

    `folder`, `robots_folder`: as in `reading.read_campaign`. `poses`: read at all targets of the campaign. `ladder`: shares of
    its load at which each is read. Returns as `next_experiment.table_of`.
    """
    case, _ = cases_in(folder, robots_folder)
    robot, settings = case.campaign.robot, Settings()
    draws = stream(seed, case.campaign.name, "next experiment", 0)
    return table_of(propose(diagnose(case, settings, seed), robot.joint_limits, settings, draws, poses, ladder), robot)
