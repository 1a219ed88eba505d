"""The scripts of the loop's rules, run one after the other in this process as Snakemake would run them."""

import runpy
from pathlib import Path

SCRIPTS = Path(__file__).resolve().parents[1] / "workflow" / "scripts"
PARAMS = {"seed": 1}
STEPS = (
    ("read_campaign", "", "training held_out descriptions"),
    (
        "diagnose_campaign",
        "descriptions training",
        "diagnosis steps correlations models confounding candidates",
    ),
    ("judge_campaign", "descriptions training held_out diagnosis steps", "verdict before_after splits residuals"),
    ("draw_residuals", "descriptions residuals", "residuals_figure"),
    ("draw_arrows", "descriptions residuals", "arrows_figure"),
)
SUFFIXES = dict.fromkeys(("descriptions", "diagnosis", "verdict"), ".json") | dict.fromkeys(("before_after", "splits"), ".csv")


class _Named(dict):
    __getattr__ = dict.__getitem__


class _Job:
    def __init__(self, **parts):
        self.__dict__.update(parts)


def run_loop(folder, robots, out, steps=STEPS):
    """Run every step from a campaign's folder to its verdict and figures; results stand in `out`.

    Parameters
    ----------
    folder, robots, out : Path

    Returns
    -------
    Path
        `out`, with ``verdict.json``.
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
