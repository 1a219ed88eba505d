"""The diagnosing engine in one process: a case of the blind proof, UR10 Series A, a million measurements; growth.

Each campaign is diagnosed and judged by a process of its own, from its folder to the verdict, which notes its peak memory at
the end (Linux).
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

import yaml
from common import ROOT, Row, beside_yardstick

from elastocal.campaigns.importers import ur10_ipa
from elastocal.campaigns.public_data import FOLDER_VARIABLE
from elastocal_proof.blind.cases import SIZES, cases_of, make_case
from elastocal_proof.blind.folders import write_dynamic_campaign
from elastocal_proof.plant.arm import arm_from_file
from elastocal_proof.plant.defects import Defect, with_defects
from elastocal_proof.plant.physical_robot import specimen
from elastocal_proof.plant.weights import declared_masses

ROBOTS = ROOT / "config" / "robots"
SEED = 2026
CASE_S, PROOF_MIN, CORES = 0.7, 45.0, 2
SERIES_A_S, SERIES_A_GB = 60.0, 1.0
MILLION_S, MILLION_GB = 300.0, 2.0
# The engine before this one, as the history of the repository has it; what its robot files may say, and its bootstrap.
OLD_ENGINE, OLD_REPLICATES = "dbb3fa1", 200
OLD_KEYS = ("name", "chain", "lengths_m", "joint_limits_deg", "compliance_urad_per_Nm")
OLD_SCRIPT = """
import json, sys, time
from elastocal.loop.whole import diagnosed

robots, replicates, *folders = sys.argv[1:]
seconds = []
for folder in folders:
    start = time.perf_counter()
    diagnosed(folder, robots, int(replicates), 1)
    seconds.append(time.perf_counter() - start)
print(json.dumps({"seconds": seconds}))
"""
# What a process of its own does: campaigns one after the other, all candidates or every second one.
SCRIPT = """
import json, resource, sys, time
from dataclasses import replace
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import cases_in

robots, share, *folders = sys.argv[1:]
seconds = []
for folder in folders:
    start = time.perf_counter()
    training, held_out = cases_in(folder, robots)
    kept = list(training.candidates.items())[:: int(share)]
    judge(diagnose(replace(training, candidates=dict(kept)), Settings(), 1), held_out, 1)
    seconds.append(time.perf_counter() - start)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
print(json.dumps({"seconds": seconds, "peak_gb": peak, "candidates": len(kept), "measurements": len(training.observations)}))
"""


@dataclass(frozen=True)
class Setting:
    """Numbers of cases for this engine and the one before, of rows of UR10 Series A (None: all), and of measurements."""

    cases: int
    old_cases: int
    series_a: int | None
    million: int
    growth: tuple[int, int]


# The median of a dozen cases lies between two groups of them and jumps by a tenth from run to run. The longer growth is twice
# the shorter; the small setting measures one campaign for all.
FULL, SMALL = Setting(48, 6, None, 1_000_000, (20_000, 40_000)), Setting(1, 1, 60, 1000, (1000, 1000))


def rows(work: Path, setting: Setting) -> Iterator[Row]:
    """Rows of the report.

    `work`: temporary folder.
    """
    yield from _proof(work, setting.cases)
    yield from _old_engine(work, setting.old_cases)
    if os.environ.get(FOLDER_VARIABLE):
        source = Path(os.environ[FOLDER_VARIABLE], ur10_ipa.FILES["ur10_ipa_a"].local)
        header, *lines = source.read_text(encoding="utf-8").splitlines(keepends=True)
        kept = lines[: setting.series_a]
        (work / "series_a.csv").write_text("".join([header, *kept]), encoding="utf-8")
        ur10_ipa.write_campaign(work / "series_a.csv", work / "series_a", "ur10_series_a")
        how = f"UR10 Series A, {len(kept):,} poses, from its folder to its verdict, one thread as in a job of the workflow"
        yield from _limits("large ur10_series_a", work / "series_a", SERIES_A_S, SERIES_A_GB, how)
    how = f"{setting.million:,} measurements of a tracker's dynamic mode, from file to verdict, one thread as in a job"
    yield from _limits("large million", _dynamic(work, setting.million), MILLION_S, MILLION_GB, how)
    yield from _growth(work, setting.growth)


def _proof(work: Path, cases: int) -> Iterator[Row]:
    every = cases_of(SIZES["full"], SEED)
    # Development cases: those of the proof stay unseen.
    some = cases_of(SIZES["development"], SEED)[:cases]
    for case in some:
        make_case(case, work / "blind", work / "sealed", ROBOTS)
    # The first pays for the imports.
    run, slower = beside_yardstick(lambda: _run([work / "blind" / case.name for case in (some[0], *some)]))
    seconds = run["seconds"][1:]
    typical = median(seconds)
    how = f"median of {cases} cases of the development set, diagnosed and judged in one process, one thread"
    yield Row.of_limit("large case", typical, CASE_S * slower, how)
    whole = sum(seconds) / cases * len(every) / CORES
    how = f"the {len(every)} cases of the full proof on {CORES} cores at the mean of these, without making them"
    yield Row.of_limit("large proof", whole, 60 * PROOF_MIN * slower, how)


def _old_engine(work: Path, cases: int) -> Iterator[Row]:
    """Both engines on the same cases, of arms that weigh nothing, for the old one knows no weight; none without the history."""
    archive = subprocess.run(["git", "-C", ROOT, "archive", OLD_ENGINE, "src", "config"], capture_output=True, check=False)
    if archive.returncode:
        return
    old, folders = work / "old_engine", []
    old.mkdir()
    subprocess.run(["tar", "-x", "-C", old], input=archive.stdout, check=True)
    weightless = [c for c in cases_of(SIZES["development"], SEED) if c.setting == "weight_compensated"][:cases]
    for case in weightless:
        make_case(case, work / "weightless", work / "sealed", ROBOTS)
        folders.append(work / "weightless" / case.name)
        path = folders[-1] / "robot.yaml"
        robot = yaml.safe_load(path.read_text(encoding="utf-8"))
        path.write_text(yaml.safe_dump({key: robot[key] for key in OLD_KEYS}, sort_keys=False), encoding="utf-8")
    # The first pays for the imports.
    folders = [folders[0], *folders]
    ours = median(_run(folders)["seconds"][1:])
    for folder in set(folders):
        path = folder / "campaign.yaml"
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
        path.write_text(yaml.safe_dump({key: document[key] for key in document if key != "remainder"}), encoding="utf-8")
    command = [OLD_SCRIPT, old / "config" / "robots", str(OLD_REPLICATES), *folders]
    theirs = median(_called(command, PYTHONPATH=str(old / "src"))["seconds"][1:])
    how = f"this engine over the one before, median of {cases} cases of arms that weigh nothing"
    yield Row("large old engine", ours, theirs, ours / theirs, "", None, how)


def _limits(name: str, folder: Path, allowed_s: float, allowed_gb: float, how: str) -> Iterator[Row]:
    # A second thread costs more than it brings: 76 s for 58 of UR10 Series A, most of whose matrices are small.
    run, slower = beside_yardstick(lambda: _run([folder]))
    (seconds,), peak = run["seconds"], run["peak_gb"]
    yield Row.of_limit(f"{name} time", seconds, allowed_s * slower, how)
    memory = f"peak of {peak:.2f} GB against {allowed_gb:g} GB: {how}"
    yield Row(f"{name} memory", None, None, peak / allowed_gb, "<= 1", peak <= allowed_gb, memory)


def _growth(work: Path, sizes: tuple[int, int]) -> Iterator[Row]:
    few, many = (_dynamic(work, measurements) for measurements in sizes)
    small, large, half = _run([few]), _run([many]), _run([many], share=2)
    for name, less, part in (("measurements", small, "measurements"), ("candidates", half, "candidates")):
        (ours,), (theirs,) = large["seconds"], less["seconds"]
        how = f"{large[part]} {name} against {less[part]}, the rest alike, from the file to the verdict"
        yield Row(f"large {name} time", ours, theirs, ours / theirs, "", None, how)
        ratio = large["peak_gb"] / less["peak_gb"]
        yield Row(f"large {name} memory", None, None, ratio, "", None, f"peak of {large['peak_gb']:.2f} GB: {how}")


@cache
def _dynamic(work: Path, measurements: int) -> Path:
    arm, folder = arm_from_file(ROBOTS / "fanuc.yaml"), work / f"dynamic{measurements}"
    robot = with_defects(specimen(arm, 4), [Defect("transmission_harmonic", (2,), 1e-4, 1)])
    write_dynamic_campaign(folder, "dynamic", ROBOTS / "fanuc.yaml", robot, measurements, 4, declared_masses(arm))
    return folder


def _run(folders: Sequence[Path], share: int = 1) -> dict[str, Any]:
    return _called([SCRIPT, ROBOTS, str(share), *folders])


def _called(script: Sequence[str | Path], **environment: str) -> dict[str, Any]:
    """What a process of its own prints last."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    environment = os.environ | dict.fromkeys(names, "1") | environment
    command = [sys.executable, "-c", *map(str, script)]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])
