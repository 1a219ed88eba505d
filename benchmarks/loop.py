"""The loop on one campaign: wall time against what is allowed, growth with measurements and candidates, share of algebra."""

import cProfile
import os
import pstats
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from common import ROOT, Row, interleaved, load_robot
from copies import copy_study, snakemake

from elastocal.campaigns.public_data import FOLDER_VARIABLE
from elastocal.campaigns.simulation import Plan, simulated_measurements
from elastocal.campaigns.writing import write_campaign
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import cases_in

POSES, POINTS = 60, ("2DoF", "3DoF", "4DoF", "6DoF")
LADDER = (0.0, 1.0, 0.5, -0.5, -1.0)
ALLOWED_S, ALLOWED_PUBLIC_S = 60.0, 300.0
REPETITIONS = 3
# What numpy, scipy and the few functions of ours that are one matrix product long spend their own time in.
ALGEBRA = ("linalg", "whitening.py", "evidence.py", "statistics.py", "fitting.py", "decomp", "_basic.py", "_solve_toeplitz")


def rows(work: Path) -> Iterator[Row]:
    """Rows of the report.

    Parameters
    ----------
    work : Path
        Temporary folder.
    """
    folder = copy_study(work / "loop")
    own = _campaign(folder / "campaigns" / "bench", POSES)
    seconds, _ = snakemake(folder, "-j2", "diagnose", "--config", f"campaign={own.relative_to(folder)}")
    size = f"{POSES} poses x {len(LADDER)} loads x {len(POINTS)} points of poses, -j2"
    yield _limit("loop campaign", seconds, ALLOWED_S, f"diagnose with its report: {size}")
    if os.environ.get(FOLDER_VARIABLE):
        seconds, _ = snakemake(folder, "-j2", "reports/loop/ur10_series_a/report.pdf")
        yield _limit("loop ur10_series_a", seconds, ALLOWED_PUBLIC_S, "import, diagnosis and report of 11,911 poses, -j2")
    yield from _growth(work)


def _limit(name: str, seconds: float, allowed: float, how: str) -> Row:
    return Row(name, seconds, allowed, seconds / allowed, "<= 1", seconds <= allowed, how)


def _growth(work: Path) -> Iterator[Row]:
    whole, half = (
        cases_in(_campaign(work / f"growth{poses}", poses), ROOT / "config" / "robots")[0] for poses in (4 * POSES, 2 * POSES)
    )
    fewer = replace(whole, candidates=dict(list(whole.candidates.items())[::2]))
    functions = {
        "all": lambda: diagnose(whole, Settings(), 1),
        "half the poses": lambda: diagnose(half, Settings(), 1),
        "half the candidates": lambda: diagnose(fewer, Settings(), 1),
    }
    all_of, poses, candidates = map(min, interleaved(functions, REPETITIONS))
    rows, measurements = len(whole.observations) * whole.model.rows, len(half.observations) * half.model.rows
    how = f"diagnosis of {rows} rows against {measurements}, minimum of {REPETITIONS}"
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
    write_campaign(folder, document, simulated_measurements(robot, plan, 1, "bench"), robot.joints)
    return folder
