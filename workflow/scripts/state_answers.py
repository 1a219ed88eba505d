"""Collect every number and row that the report of the study shows."""

import json

from job import Job, run

import pandas as pd

from elastocal.io.atomic_writes import write_text
from elastocal.io.documents import read_document
from elastocal.report.study import collect_study_facts, shorten_titles
from elastocal.study.strategies import strategy_from_document

TABLES = (
    "table2",
    "extended",
    "joint",
    "studies",
    "break_even",
    "budget",
    "pairs",
    "needed",
    "scores",
    "score_pairs",
    "comparison",
    "multiverse_summary",
    "claims",
    "ladder",
    "simulated",
)
# Columns that hold text which looks like numbers, by table.
TEXT_COLUMNS = {
    "comparison": {"table": str},
    "ladder": {"link_springs": str},
    "simulated": {"unobservable": str},
}


def state_answers(job: Job) -> None:
    settings = job.params
    names = shorten_titles(settings.names)
    tables = {
        name: pd.read_csv(getattr(job.input, name), dtype=TEXT_COLUMNS.get(name))
        for name in TABLES
    }
    strategies = [strategy_from_document(document) for document in settings.strategies]
    chosen = {
        name: getattr(settings, name)
        for name in ("classical", "best", "accuracy_um", "stated")
    }
    facts = collect_study_facts(
        tables,
        names,
        settings.robots,
        settings.cells | chosen | {"strategies": strategies},
    )
    citation = read_document(job.input.citation)
    facts |= {
        "citation": {
            "authors": ", ".join(author["name"] for author in citation["authors"]),
            "version": citation["version"],
            "license": citation["license"],
        },
        "names": names,
        "full_names": [settings.names[robot] for robot in settings.robots],
        "size": {name: f"{value:g}" for name, value in settings.size.items()},
    }
    write_text(
        job.output.answers,
        json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False),
    )


run(state_answers, snakemake)
