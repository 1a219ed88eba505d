"""The loop on one campaign: wall time against what is allowed, growth with measurements and candidates, share of algebra."""

import cProfile
import os
import pstats
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from common import ROOT, Row, beside_yardstick, interleaved, load_robot
from copies import copy_study, snakemake

from elastocal.campaigns.public_data import FOLDER_VARIABLE
from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.campaigns.writing import write_campaign
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import cases_in

POINTS = ("2DoF", "3DoF", "4DoF", "6DoF")
LADDER = (0.0, 1.0, 0.5, -0.5, -1.0)
ALLOWED_S, ALLOWED_PUBLIC_S = 60.0, 300.0
# What numpy, scipy and the few functions of ours that are one matrix product long spend their own time in.
ALGEBRA = ("linalg", "whitening.py", "evidence.py", "statistics.py", "fitting.py", "decomp", "_basic.py", "_solve_toeplitz")


@dataclass(frozen=True)
class Setting:
    """Poses of the campaign, what Snakemake makes of it and of a public one, and repetitions."""

    poses: int
    own: str
    public: str
    repetitions: int


FULL = Setting(60, "diagnose", "reports/loop/ur10_series_a/report.pdf", 3)
SMALL = Setting(8, "results/loop/bench/diagnosis.json", "data/campaigns/ur10_series_a/campaign.yaml", 1)


def rows(work: Path, setting: Setting) -> Iterator[Row]:
    """Rows of the report.

    `work`: temporary folder.
    """
    folder = copy_study(work / "loop")
    own = _campaign(folder / "campaigns" / "bench", setting.poses)
    size = f"{setting.poses} poses x {len(LADDER)} loads x {len(POINTS)} points of poses, -j2"
    asked = (setting.own, "--config", f"campaign={own.relative_to(folder)}")
    yield _limit("loop campaign", folder, asked, ALLOWED_S, f"snakemake {setting.own}, its report with it: {size}")
    if os.environ.get(FOLDER_VARIABLE):
        yield _limit(
            "loop ur10_series_a",
            folder,
            (setting.public,),
            ALLOWED_PUBLIC_S,
            "import, diagnosis and report of 11,911 poses, -j2",
        )
    yield from _growth(work, setting)


def _limit(name: str, folder: Path, asked: Sequence[str], allowed_s: float, how: str) -> Row:
    (seconds, _), slower = beside_yardstick(lambda: snakemake(folder, "-j2", *asked))
    return Row.of_limit(name, seconds, allowed_s * slower, how)


def _growth(work: Path, setting: Setting) -> Iterator[Row]:
    folders = (_campaign(work / f"growth{poses}", poses) for poses in (4 * setting.poses, 2 * setting.poses))
    whole, half = (cases_in(folder, ROOT / "config" / "robots")[0] for folder in folders)
    fewer = replace(whole, candidates=dict(list(whole.candidates.items())[::2]))
    functions = {
        "all": lambda: diagnose(whole, Settings(), 1),
        "half the poses": lambda: diagnose(half, Settings(), 1),
        "half the candidates": lambda: diagnose(fewer, Settings(), 1),
    }
    all_of, poses, candidates = map(min, interleaved(functions, setting.repetitions))
    rows, measurements = len(whole.observations) * whole.model.rows, len(half.observations) * half.model.rows
    how = f"diagnosis of {rows} rows against {measurements}, minimum of {setting.repetitions}"
    yield Row("loop rows", all_of, poses, all_of / poses, "", None, how)
    how = f"the same with {len(whole.candidates)} candidates against {len(fewer.candidates)}"
    yield Row("loop candidates", all_of, candidates, all_of / candidates, "", None, how)
    profile = cProfile.Profile()
    profile.runcall(diagnose, whole, Settings(), 1)
    stats = pstats.Stats(profile).stats
    spent = sum(own for (file, _, _), (_, _, own, _, _) in stats.items() if any(part in file for part in ALGEBRA))
    total = sum(own for _, _, own, _, _ in stats.values())
    how = "own time of numpy.linalg, scipy.linalg and of our functions that are matrix products, over all"
    yield Row("loop algebra", spent, total, spent / total, "", None, how)


def _campaign(folder: Path, poses: int) -> Path:
    robot = load_robot("kuka_extended")
    plan = Plan(POINTS, poses, 1000.0, LADDER, (0.0, 0.5, 0.0), 4, 10, 6e-5, 6e-5)
    document = {
        "campaign": "bench",
        "robot": "kuka",
        "measured": "pose",
        "frame": "base",
        "targets": {point: {"point": point, "offset_m": [0, 0, 0]} for point in POINTS},
        "compliance": "identify",
        "holdout": {"fraction": 0.3, "seed": 1},
    }
    shutil.rmtree(folder, ignore_errors=True)
    write_campaign(folder, document, draw_measurements(robot, plan, 1, "bench"), robot.joints)
    return folder
