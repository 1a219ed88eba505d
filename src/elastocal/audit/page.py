"""The audit as a page: what was worked out again by what, what was not, and what does not hold."""

from __future__ import annotations

import re
from importlib import resources
from typing import TYPE_CHECKING

from jinja2 import Environment

from elastocal.audit.files import OF_EVERY_FILE

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import pandas as pd

# Of what does not hold a page shows so many rows; all are in audit.csv.
_SHOWN = 200
# What files hold that are worked out again, by `kind_of`.
MEANINGS = {
    "data/campaigns/*/measurements.parquet": "of a campaign: measurements",
    "data/simulated/*/experiments.parquet": "drawn joint angles and loads",
    "data/simulated/*/ideal.parquet": "deflections without noise",
    "data/simulated/*/measured.parquet": "deflections with the noise of a tracker",
    "reports/loop/*/before_after.csv": "of a campaign: errors before and after a diagnosis",
    "reports/blind/*.csv": "blind proof: cases, rates, calibration and targets",
    "reports/blind/*.sha256": "blind proof: seals of the ground truths",
    "reports/closed_loop/*.csv": "closed loop: errors of corrected robots",
    "reports/bad_rows/*.csv": "bad rows: verdicts with and without them, and rates",
    "reports/league/*.csv": "league: errors of all methods, mechanisms",
    "reports/planning/*.csv": "worth of planned poses",
    "reports/loop/*.csv": "of all campaigns: verdicts, errors before and after",
    "reports/loop/*/splits.csv": "of a campaign: errors by how poses were held out",
    "reports/loop/*/verdict.json": "of a campaign: its verdict",
    "reports/loop/*/residuals.parquet": "of a campaign: what the model leaves of each measurement",
    "reports/tables/*.csv": "tables of the study",
    "reports/tables/*.md": "the paper's tables as they are printed, Markdown",
    "reports/tables/*.tex": "the paper's tables as they are printed, LaTeX",
    "results/accuracy/*.parquet": "errors of models that come from one data set",
    "results/bounds/*.parquet": "least error that any estimator can have (Cramér-Rao)",
    "results/budget/*.parquet": "errors by set of measuring points and number of configurations",
    "results/design/*.parquet": "covariances of identified compliances",
    "results/closed_loop/*.parquet": "closed loop: every commanded pose",
    "results/bad_rows/*.parquet": "bad rows: each slip and the verdicts on its case",
    "results/league/*.parquet": "league: folds and what each method predicts",
    "results/designs/*.parquet": "random and optimal choices of configurations",
    "results/expected/*.parquet": "expected scores in closed form",
    "results/geometry/*.parquet": "compliances beside errors of the geometry",
    "results/identified/*.parquet": "identified compliances",
    "results/initial/*.parquet": "deflections before calibration",
    "results/ladder/*.parquet": "models with more and more link springs",
    "results/loop/*/confounding.parquet": "of a campaign: which effects look alike",
    "results/loop/*/held_out.parquet": "of a campaign: measurements kept for the test",
    "results/loop/*/correlations.parquet": "of a campaign: correlations of the estimates",
    "results/loop/*/diagnosis.json": "of a campaign: probabilities of what a model lacks",
    "results/loop/*/models.parquet": "of a campaign: how probable each model is",
    "results/loop/*/steps.parquet": "of a campaign: estimates and standard errors of each model",
    "results/loop/*/training.parquet": "of a campaign: which poses are fitted and which are kept for a test",
    "results/metrics/*.parquet": "scores of each strategy (the paper's equations 12 to 15)",
    "results/observability/*.parquet": "indices of how well configurations determine compliances",
    "results/places/*.parquet": "a second reflector at places of the arm",
    "results/replicates/*.parquet": "bootstrap replicates of the scores",
    "results/solvers/*.parquet": "linear and iterated estimates side by side",
    "results/studies/*.parquet": "scores of further studies of the same size",
    "results/tubes/*.parquet": "links of other diameters",
    "results/uses/*.parquet": "errors of each strategy by use of the robot",
    "results/weighting/*.parquet": "unequal noise: equal weights and those of the noise",
    "results/weights/*.parquet": "weights of the bootstrap",
}
_FOLLOWED = re.compile(r"(\d+) of (\d+) cells followed(?:; not (.*))?")


def kind_of(file: str) -> str:
    """Files that are made alike, by the folder and what they are."""
    parts = file.split("/")
    if parts[0] == "data" and len(parts) > 3:
        return f"data/{parts[1]}/*/{parts[-1]}"
    if parts[1] == "loop" and len(parts) > 3:
        return f"{parts[0]}/loop/*/{parts[-1]}"
    return f"{parts[0]}/{parts[1]}/*{re.sub(r'.*(?=[.])', '', parts[-1])}" if len(parts) > 2 else file


def page(table: pd.DataFrame, facts: Mapping[str, str]) -> str:
    """audit.html, which asks nothing of the network.

    `table`: from `whole.as_table`. `facts`: what heads the page, such as the seed.
    """
    labelled = table.assign(kind=table["file"].map(kind_of))
    of_every_file = labelled["checked"].isin(OF_EVERY_FILE)
    recomputed, alike = labelled[~of_every_file], labelled[of_every_file]
    rest = alike[~alike["kind"].isin(recomputed["kind"])]
    wrong = table[~table["holds"]]
    template = resources.files("elastocal.audit").joinpath("audit.html").read_text("utf-8")
    return (
        Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
        .from_string(template)
        .render(
            facts=facts,
            recomputed=_by_kind(recomputed),
            followed=_followed(table),
            rest=_by_kind(rest),
            wrong=wrong.head(_SHOWN).to_dict("records"),
            hidden=max(len(wrong) - _SHOWN, 0),
            files=table["file"].nunique(),
            files_again=recomputed["file"].nunique(),
            checks=len(table),
            values=int(table["compared"].sum()),
            failed=len(wrong),
        )
    )


def _by_kind(labelled: pd.DataFrame) -> list[dict[str, Any]]:
    """Files that are made alike as one row each."""
    rows = []
    for kind, some in labelled.groupby("kind", sort=True):
        worst = some["worst"].max()
        rows.append(
            {
                "kind": kind,
                "meaning": MEANINGS.get(str(kind), ""),
                "files": some["file"].nunique(),
                "checks": len(some),
                "values": int(some["compared"].sum()),
                "worst": f"{worst:.2g}" if worst < 1e3 else "beyond 1000",
                "failed": int((~some["holds"]).sum()),
                "by": ", ".join(dict.fromkeys(name for name in some["by"] if name)),
            }
        )
    return rows


def _followed(table: pd.DataFrame) -> list[dict[str, Any]]:
    """How many cells of each table of the study were followed back to files."""
    rows = []
    for file, checked in zip(table["file"], table["checked"], strict=True):
        if found := _FOLLOWED.fullmatch(checked):
            cells, of, rest = found.groups()
            rows.append({"file": file, "cells": int(cells), "of": int(of), "rest": rest or ""})
    return rows
