"""The scripts of the loop's rules, run one after the other in this process as Snakemake would run them."""

import runpy
from pathlib import Path

SCRIPTS = Path(__file__).resolve().parents[1] / "workflow" / "scripts"
PARAMS = {"replicates": 200, "seed": 1, "states": 4}
FIGURES = ("before_after", "arrows", "residuals", "candidates", "confounding")
STEPS = (
    ("read_campaign", "", "training held_out descriptions"),
    ("check_data", "descriptions training", "faults"),
    ("estimate_noise", "descriptions training", "noise"),
    ("fit_declared", "descriptions training noise", "declared:parameters correlations"),
    (
        "trace_effects",
        "descriptions training faults noise declared",
        "looks found final:parameters final_correlations:correlations confounding",
    ),
    ("weigh_rivals", "descriptions training noise found final:parameters", "rivals doubts experiment"),
    (
        "judge_held_out",
        "descriptions training held_out noise declared looks found final:parameters rivals",
        "before_after errors residuals",
    ),
    (
        "state_verdict",
        "descriptions training faults noise declared looks found final:parameters rivals doubts before_after errors",
        "verdict candidates",
    ),
    *((f"draw_{figure}", "descriptions residuals candidates confounding before_after errors", figure) for figure in FIGURES),
    (
        "compile_loop_report",
        "verdict candidates before_after residuals experiment final:parameters descriptions",
        "report",
    ),
)
SUFFIXES = dict.fromkeys(("descriptions", "faults", "noise", "doubts", "errors", "verdict"), ".json")
SUFFIXES |= dict.fromkeys(("experiment", "before_after"), ".csv") | {"report": ".pdf"}


class _Named(dict):
    __getattr__ = dict.__getitem__


class _Job:
    def __init__(self, **parts):
        self.__dict__.update(parts)


def run_loop(folder, robots, out, steps=STEPS):
    """Run every step from a campaign's folder to its report; results stand in `out`.

    Parameters
    ----------
    folder, robots, out : Path

    Returns
    -------
    Path
        `out`, with ``verdict.json`` and ``report.pdf``.
    """
    out.mkdir(parents=True, exist_ok=True)

    def files(words):
        pairs = [word.split(":") for word in words.split()]
        return _Named({pair[-1]: (out / f"{pair[0]}{SUFFIXES.get(pair[0], '.parquet')}").as_posix() for pair in pairs})

    for script, inputs, outputs in steps:
        job = _Job(
            input=files(inputs),
            output=files(outputs),
            params=_Named(PARAMS | {"folder": folder.as_posix(), "robots": robots.as_posix()}),
            wildcards=_Named(campaign=folder.name),
            log=[(out / f"{script}.log").as_posix()],
        )
        if script.startswith("draw_"):
            job.output = _Named({kind: (out / f"{outputs}.{kind}").as_posix() for kind in ("pdf", "png")})
        if script == "compile_loop_report":
            job.input["figures"] = [(out / f"{figure}.pdf").as_posix() for figure in FIGURES]
        run_script(script, job)
    return out


def run_script(script, job):
    """Run one script of the workflow with a job in the place of Snakemake's."""
    import sys

    sys.path.insert(0, SCRIPTS.as_posix())
    try:
        runpy.run_path((SCRIPTS / f"{script}.py").as_posix(), {"snakemake": job}, "__main__")
    finally:
        sys.path.remove(SCRIPTS.as_posix())
