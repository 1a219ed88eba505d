"""The steps of the loop's rules, run one after the other in this process as Snakemake
would run them."""

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
# Names of the rules' files by which others know them; what is not listed is a Parquet
# table.
SUFFIXES = dict.fromkeys(("descriptions", "diagnosis", "verdict"), ".json")
SUFFIXES |= dict.fromkeys(("before_after", "experiment", "candidates"), ".csv") | {
    "report": ".pdf",
    "page": ".html",
}


class Files:
    """Files of a folder by the names that rules give them: what one script writes the
    next finds."""

    def __init__(self, folder):
        self.folder = folder

    @property
    def figures(self):
        """Those of the report."""
        return [(self.folder / f"{figure}.pdf").as_posix() for figure in FIGURES]

    def __iter__(self):
        # Files elsewhere than in a study's folders have no checksums.
        return iter(())

    def __getattr__(self, name):
        return (self.folder / f"{name}{SUFFIXES.get(name, '.parquet')}").as_posix()


class _Named(dict):
    __getattr__ = dict.__getitem__

    def __iter__(self):
        # Of no job: they have no record.
        return iter(())


def run_loop(folder, robots, out, steps=STEPS):
    """Run every step from a campaign's folder to its report; results stand in `out`.

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
            job.output = _Named(
                {
                    kind: [(out / f"{figure}.{kind}").as_posix() for figure in FIGURES]
                    for kind in ("pdf", "png")
                }
            )
        run_script(script, job)
    return out


def run_script(script, job):
    """Run one script of the workflow, or a function of the package, with a job in the
    place of Snakemake's."""
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
