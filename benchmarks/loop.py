"""The loop on one campaign: wall time against what is allowed, growth with readings and candidates, share of linear algebra."""

import cProfile
import os
import pstats
import shutil
from dataclasses import replace

import numpy as np
from common import ROOT, Row, interleaved, load_robot
from copies import copy_study, snakemake
from elastocal.selection import search

from elastocal.campaign import read_campaign, split, write_campaign
from elastocal.campaign_simulation import Plan, simulated_measurements
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting import fit
from elastocal.loop.case import Case, noise_from
from elastocal.loop.declared import noise_of
from elastocal.model import declared_model
from elastocal.observations import averaged
from elastocal.public_data import FOLDER_VARIABLE
from elastocal.sites import sites_of

POSES, POINTS = 60, ("2DoF", "3DoF", "4DoF", "6DoF")
LADDER = (0.0, 1.0, 0.5, -0.5, -1.0)
ALLOWED_S, ALLOWED_PUBLIC_S = 60.0, 300.0
REPLICATES = 2000
REPETITIONS = 3
# What numpy, scipy and the few functions of ours that are one matrix product long spend their own time in.
ALGEBRA = ("linalg", "whitening.py", "screening.py", "fitting.py", "decomp", "_basic.py", "_solve_toeplitz")


def rows(work):
    """Rows of the report.

    Parameters
    ----------
    work : Path
        Temporary folder.
    """
    folder = copy_study(work / "loop")
    own = _campaign(folder / "campaigns" / "bench", POSES)
    seconds, _ = snakemake(folder, "-j2", "diagnose", "--config", f"campaign={own.relative_to(folder)}")
    size = f"{POSES} poses x {len(LADDER)} loads x {len(POINTS)} points of poses, {REPLICATES}-fold bootstrap, -j2"
    yield _limit("loop campaign", seconds, ALLOWED_S, f"diagnose with its report: {size}")
    if os.environ.get(FOLDER_VARIABLE):
        seconds, _ = snakemake(folder, "-j2", "reports/loop/ur10_series_a/report.pdf")
        yield _limit("loop ur10_series_a", seconds, ALLOWED_PUBLIC_S, "import, diagnosis and report of 11,911 poses, -j2")
    yield from _growth(work)


def _limit(name, seconds, allowed, how):
    return Row(name, seconds, allowed, seconds / allowed, "<= 1", seconds <= allowed, how)


def _growth(work):
    whole, half = (_case(work / f"growth{poses}", poses) for poses in (4 * POSES, 2 * POSES))
    every, second = list(whole.candidates.values()), list(whole.candidates.values())[::2]
    functions = {
        "all": lambda: _trace(whole, every),
        "half the poses": lambda: _trace(half, every),
        "half the candidates": lambda: _trace(whole, second),
    }
    all_of, poses, candidates = map(min, interleaved(functions, REPETITIONS))
    rows, readings = len(whole.observations) * whole.model.rows, len(half.observations) * half.model.rows
    how = f"declared fit and trace of {rows} rows against {readings}, minimum of {REPETITIONS}"
    yield Row("loop rows", all_of, poses, all_of / poses, "", None, how)
    how = f"the same with {len(every)} candidates against {len(second)}"
    yield Row("loop candidates", all_of, candidates, all_of / candidates, "", None, how)
    profile = cProfile.Profile()
    profile.runcall(_trace, whole, every)
    stats = pstats.Stats(profile).stats
    spent = sum(own for (file, _, _), (_, _, own, _, _) in stats.items() if any(part in file for part in ALGEBRA))
    total = sum(own for _, _, own, _, _ in stats.values())
    how = "own time of numpy.linalg, scipy.linalg and of our functions that are matrix products, over all"
    yield Row("loop algebra", spent, total, spent / total, "", None, how)


def _campaign(folder, poses):
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


def _case(folder, poses):
    campaign = read_campaign(_campaign(folder, poses), ROOT / "config" / "robots")
    campaign = replace(campaign, readings=split(campaign)[0])
    sites = sites_of(campaign.robot)
    return Case(campaign, averaged(campaign.readings), declared_model(campaign), candidates_on(sites))


def _trace(case, candidates):
    noise = noise_from(noise_of(case))
    declared = fit(case.model, case.observations, noise)
    return search(declared, case.observations, candidates, REPLICATES, np.random.default_rng(1))
