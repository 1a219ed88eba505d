"""Benchmark the diagnosis.

A fit is compared with one dense least-squares problem of its size. A case of the blind
benchmark, the growth with rows, and campaigns of thousands and a million measurements
have limits.

A case and a large campaign are diagnosed and judged by a process of their own, from
folder to verdict, which notes its peak memory at the end (Linux).
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from common import ROBOTS, ROOT, Row, beside_yardstick, interleaved

from elastocal.campaigns.importers import FOLDER_VARIABLE, find_importer
from elastocal.campaigns.writing import write_campaign
from elastocal.fitting.least_squares import fit_model, register_placement
from elastocal.fitting.model import list_parameters
from elastocal.fitting.noise import estimate_noise
from elastocal.io.documents import read_document
from elastocal.loop.whole import read_cases
from elastocal.residual_model.regressions import REGRESSIONS, Inputs
from elastocal_proof.blind.cases import list_cases, write_sealed_case
from elastocal_proof.blind.folders import build_campaign_document, write_robot_file
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design, draw_schedule, simulate_measurements
from elastocal_proof.plant.kinds import Defect, apply_defects
from elastocal_proof.plant.simulated_robot import draw_specimen

SEED = 2026
# Effects of the fit. Like most effects of a measured robot, their basis functions do not
# depend on the estimate.
FITTED = ("joint_offset", "transmission_harmonic", "bearing_runout", "link_weight")
LARGE = Design(
    held_out=0,
    ladder=(0.0,),
    repeats=1,
    points=("6DoF",),
    measured="position",
    covariates=("time",),
    declared=("joint_offset", "link_geometry"),
)
FIT_TARGET = 8.0
# Columns of the Jacobian for the regressions: base, links and effects of a model.
JACOBIAN_COLUMNS = 60
FOLDS = 5
FOLDS_TARGET = 0.8
GROWTH_TARGET = 1.2
CASE_S = 0.85
SERIES_A_S = 45.0
SERIES_A_GB = 0.7
MILLION_S = 120.0
MILLION_GB = 2.0
SCRIPT = """
import json, resource, sys, time
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import read_cases

robots, *folders = sys.argv[1:]
seconds = []
for folder in folders:
    start = time.process_time()
    training, held_out = read_cases(folder, robots)
    judge(diagnose(training, Settings(), 1), held_out, 1)
    seconds.append(time.process_time() - start)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
print(json.dumps({"seconds": seconds, "peak_gb": peak, "measurements": len(training.observations)}))
"""


@dataclass(frozen=True)
class Setting:
    """Size of the benchmark.

    Attributes
    ----------
    fitted : measurements of the fit
    regressed : measurements of the regressions
    repetitions : repetitions of the fit and of the regressions
    cases : cases of the blind benchmark
    series_a : rows of UR10 Series A; None for all
    growth : measurements of the two campaigns that are compared
    million : measurements of the large campaign
    """

    fitted: int
    regressed: int
    repetitions: int
    cases: int
    series_a: int | None
    growth: tuple[int, int]
    million: int


# The median of a dozen cases lies between two groups of cases and changes by a tenth from
# run to run, so there are more. The small setting measures one campaign for all rows.
FULL = Setting(6000, 2000, 3, 48, None, (20_000, 80_000), 1_000_000)
SMALL = Setting(1000, 100, 1, 1, 60, (1000, 30_000), 1000)


def rows(work: Path, setting: Setting) -> Iterator[Row]:
    """Measure all rows of the report in a temporary folder."""
    yield _fit(work, setting.fitted, setting.repetitions)
    yield _folds(setting.regressed, setting.repetitions)
    yield _case(work, setting.cases)
    small_run, large_run = (
        _run([_large(work, measurements)]) for measurements in setting.growth
    )
    (small,) = small_run["seconds"]
    (large,) = large_run["seconds"]
    counts = large_run["measurements"], small_run["measurements"]
    exponent = float(np.log(large / small) / np.log(counts[0] / counts[1]))
    how = (
        "exponent of the CPU time in the rows:"
        f" {counts[0]} against {counts[1]}, from file to verdict"
    )
    yield Row(
        "engine growth",
        large,
        small,
        exponent,
        f"<= {GROWTH_TARGET}",
        exponent <= GROWTH_TARGET,
        how,
    )
    if os.environ.get(FOLDER_VARIABLE):
        series = find_importer("ur10_ipa", "config", "the benchmark")
        source = Path(os.environ[FOLDER_VARIABLE], series.files["ur10_ipa_a"].local)
        header, *lines = source.read_text(encoding="utf-8").splitlines(keepends=True)
        selected = lines[: setting.series_a]
        text = "".join([header, *selected])
        (work / "series_a.csv").write_text(text, encoding="utf-8")
        series.write_campaign(
            [work / "series_a.csv"], work / "series_a", "config/robots", "ur10_series_a"
        )
        how = (
            f"UR10 Series A, {len(selected):,} poses, from its folder to its verdict,"
            " one thread as in a job of the workflow"
        )
        yield from _limits(
            "engine ur10_series_a", work / "series_a", SERIES_A_S, SERIES_A_GB, how
        )
    how = (
        f"{setting.million:,} measurements, each a pose of its own,"
        " from file to verdict, one thread as in a job"
    )
    yield from _limits(
        "engine million", _large(work, setting.million), MILLION_S, MILLION_GB, how
    )


def _fit(work: Path, measurements: int, repetitions: int) -> Row:
    """Compare a robust fit of many effects with one dense least-squares problem.

    The problem has as many rows and columns as the fit.
    """
    case, _ = read_cases(_large(work, measurements), ROBOTS)
    effects = tuple(
        candidate
        for candidate in case.candidates.values()
        if candidate.effect in FITTED and not candidate.shapes
    )
    model = replace(case.model, effects=(*case.model.effects, *effects))
    noise = estimate_noise(case)[0]
    start = register_placement(model, case.observations)
    size = (
        case.observations.rows * len(case.observations),
        len(list_parameters(model, start)),
    )
    matrix = np.random.default_rng(1).standard_normal(size)
    functions: dict[str, Callable[[], Any]] = {
        "fit": lambda: fit_model(model, case.observations, noise, start),
        "numpy.linalg.lstsq": lambda: np.linalg.lstsq(matrix, matrix[:, 0]),
    }
    ours, theirs = map(min, interleaved(functions, repetitions))
    how = (
        f"a robust fit against one numpy.linalg.lstsq of {size[0]} rows and"
        f" {size[1]} parameters, minimum of {repetitions}"
    )
    return Row.of_slowdown("engine fit", ours, theirs, FIT_TARGET, how)


def _folds(measurements: int, repetitions: int) -> Row:
    """Compare the ridge regressions on all unions of three of five folds, which share
    the Gram matrices of the folds, with the same ones each by itself."""
    draws = np.random.default_rng(1)
    inputs = Inputs(
        draws.uniform(-2.0, 2.0, (measurements, 6)),
        np.zeros((measurements, 3)),
        draws.standard_normal((measurements, 3, JACOBIAN_COLUMNS)),
    )
    residual = 1e-4 * draws.standard_normal((measurements, 3))
    functions = {
        "with shared Gram matrices": partial(_regress, inputs, residual, shared=True),
        "each by itself": partial(_regress, inputs, residual, shared=False),
    }
    ours, theirs = map(min, interleaved(functions, repetitions))
    how = (
        f"ridge regressions on unions of {FOLDS} folds of {measurements} measurements"
        f" against the same without common matrices, minimum of {repetitions}"
    )
    return Row.of_slowdown("engine folds", ours, theirs, FOLDS_TARGET, how)


def _regress(inputs: Inputs, residual: np.ndarray, *, shared: bool) -> None:
    """Fit the ridge regressions on all unions of three folds."""
    fold = np.arange(len(inputs)) % FOLDS
    parts = [inputs.select(fold == number) for number in range(FOLDS)]
    for union in combinations(range(FOLDS), FOLDS - 2):
        chosen = np.isin(fold, union)
        joined = inputs.select(chosen)
        if shared:
            joined = replace(joined, parts=tuple(parts[number] for number in union))
        rows = residual[chosen]
        for name in ("ridge_harmonics", "two_joints"):
            regression = REGRESSIONS[name]
            for _ in regression.fit(joined, rows, regression.settings, 1):
                pass


def _case(work: Path, cases: int) -> Row:
    # These are development cases; those of the blind benchmark stay unseen.
    plan = read_document(ROOT / "config" / "blind.yaml")
    selected = list_cases(plan, "development", SEED)[:cases]
    for case in selected:
        write_sealed_case(case, work / "blind", work / "sealed", ROBOTS)
    # The first case runs twice, because its first run includes the imports.
    run, slower = beside_yardstick(
        lambda: _run([work / "blind" / case.name for case in (selected[0], *selected)])
    )
    how = (
        f"median of {cases} cases of the development set,"
        " diagnosed and judged in one process, one thread"
    )
    return Row.of_limit("engine case", median(run["seconds"][1:]), CASE_S * slower, how)


def _limits(
    name: str, folder: Path, allowed_s: float, allowed_gb: float, how: str
) -> Iterator[Row]:
    run, slower = beside_yardstick(lambda: _run([folder]))
    (seconds,), peak = run["seconds"], run["peak_gb"]
    yield Row.of_limit(f"{name} time", seconds, allowed_s * slower, how)
    memory = f"peak of {peak:.2f} GB against {allowed_gb:g} GB: {how}"
    yield Row(
        f"{name} memory",
        None,
        None,
        peak / allowed_gb,
        "<= 1",
        peak <= allowed_gb,
        memory,
    )


def _large(work: Path, measurements: int) -> Path:
    """Write a campaign without loads, with one reflector and a pose a measurement."""
    folder = work / f"large{measurements}"
    if not folder.is_dir():
        file = ROBOTS / "fanuc.yaml"
        arm = read_arm(file)
        robot = apply_defects(
            draw_specimen(arm, 4), [Defect("transmission_harmonic", (2,), 1e-4, 1)]
        )
        document = build_campaign_document("large", arm, LARGE) | {
            "compliance": "nominal",
            "holdout": {"fraction": 0.3, "seed": 1},
        }
        table = simulate_measurements(
            robot, LARGE, draw_schedule(arm, replace(LARGE, poses=measurements), 4)
        )
        write_campaign(
            folder,
            document | {"noise": {"position_m": robot.tracker.sigma_m}},
            table,
            arm.joints,
            "parquet",
        )
        write_robot_file(folder, file, robot, arm.masses)
    return folder


def _run(folders: Sequence[Path]) -> dict[str, Any]:
    """Diagnose folders in a process of its own, and return what it measures."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    command = [sys.executable, "-c", SCRIPT, str(ROBOTS), *map(str, folders)]
    finished = subprocess.run(
        command,
        env=os.environ | dict.fromkeys(names, "1"),
        check=True,
        capture_output=True,
        text=True,
    )
    return json.loads(finished.stdout.splitlines()[-1])
