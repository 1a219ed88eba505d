"""Runs the steps of the loop's rules one after the other in this process, as Snakemake
would."""

import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

SCRIPTS = Path(__file__).resolve().parents[2] / "workflow" / "scripts"
CONFIG = {"origin": {"commit": "c0ffee", "configuration_sha256": "d16e57", "seed": 1}}
ANALYSIS = (
    "loop.loading.read_campaign",
    "loop.diagnosis_tables.diagnose_campaign",
    "loop.whole.judge_campaign",
)
FIGURES = ("before_after", "arrows", "candidates")
PARAMS = {"seed": 1, "states": 4, "figures": FIGURES}
STEPS = (*ANALYSIS, "draw_campaign", "compile_loop_report")
# Suffixes of files by their names in the rules; all other files are Parquet tables.
SUFFIXES = dict.fromkeys(("descriptions", "diagnosis", "verdict"), ".json")
SUFFIXES |= dict.fromkeys(("before_after", "experiment", "candidates"), ".csv") | {
    "report": ".pdf",
    "page": ".html",
}


class Files:
    """Files of a folder by their names in the rules, so that a script reads what an
    earlier one has written."""

    def __init__(self, folder):
        self.folder = folder

    @property
    def figures(self):
        """Paths of the figures of the report."""
        return [(self.folder / f"{figure}.pdf").as_posix() for figure in FIGURES]

    def __iter__(self):
        # Files outside the folders of a study have no checksums.
        return iter(())

    def __getattr__(self, name):
        return (self.folder / f"{name}{SUFFIXES.get(name, '.parquet')}").as_posix()


class _Named(dict):
    __getattr__ = dict.__getitem__

    def __iter__(self):
        # The job has no record, so it has no inputs to list.
        return iter(())


def run_loop(folder, robots, out, steps=STEPS):
    """Run every step from a campaign's folder to its report, and write the results to
    `out`.

    Returns `out`, with ``verdict.json`` and ``report.pdf``.
    """
    out.mkdir(parents=True, exist_ok=True)
    for script in steps:
        job = SimpleNamespace(
            input=Files(out),
            output=Files(out),
            params=_Named(
                PARAMS | {"folder": folder.as_posix(), "robots": robots.as_posix()}
            ),
            wildcards=_Named(campaign=folder.name),
            log=[(out / f"{script}.log").as_posix()],
        )
        if script == "draw_campaign":
            pdf = [(out / f"{figure}.pdf").as_posix() for figure in FIGURES]
            png = [(out / f"{figure}.png").as_posix() for figure in FIGURES]
            job.output = _Named(pdf=pdf, png=png)
        run_script(script, job)
    return out


def run_script(script, job):
    """Run one script of the workflow, or a function of the package, with a job in place
    of Snakemake's."""
    sys.path.insert(0, SCRIPTS.as_posix())
    for name, value in {"rule": script, "wildcards": {}, "config": CONFIG}.items():
        job.__dict__.setdefault(name, value)
    try:
        if "." in script:
            job.params["step"] = f"elastocal.{script}"
            script = "run_step"
        runpy.run_path(
            (SCRIPTS / f"{script}.py").as_posix(), {"snakemake": job}, "__main__"
        )
    finally:
        sys.path.remove(SCRIPTS.as_posix())
