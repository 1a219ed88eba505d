"""Every number and row of a table that the report of the study shows."""

import json

from job import Job, run

import pandas as pd

from elastocal.io.atomic_writes import write_text
from elastocal.io.documents import read_document
from elastocal.report.study import collect_study_facts, shorten_titles
from elastocal.study.strategies import strategy_from_document

_PLAIN = (
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
)
# Each table, and how it is read: what looks like a number may be none.
_TABLES = {name: {} for name in _PLAIN} | {
    "comparison": {"dtype": {"table": str}},
    "ladder": {"dtype": {"link_springs": str}},
    "simulated": {"dtype": {"unobservable": str}},
}


def state_answers(job: Job) -> None:
    settings = job.params
    names = shorten_titles(settings.names)
    tables = {
        name: pd.read_csv(getattr(job.input, name), **how)
        for name, how in _TABLES.items()
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
    cited = {
        "date": str(citation["date-released"]),
        "version": citation["version"],
        "license": citation["license"],
    }
    facts |= {
        "citation": {"authors": ", ".join(each["name"] for each in citation["authors"])}
        | cited,
        "names": names,
        "full_names": [settings.names[robot] for robot in settings.robots],
        "size": {name: f"{value:g}" for name, value in settings.size.items()},
    }
    write_text(
        job.output.answers,
        json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False),
    )


run(state_answers, snakemake)
