"""Every number that the report's text states."""

import json

from job import Job, run

import pandas as pd

from elastocal.io.atomic_writes import write_text
from elastocal.io.data_frames import read_long
from elastocal.io.documents import read_document
from elastocal.report.answers import answers
from elastocal.report.question_answers import brief_names, stated
from elastocal.report.study_questions import Asked, answer_questions
from elastocal.study.evaluation import REPLICATES, metrics
from elastocal.study.strategies import strategy_from_document

_PLAIN = (
    *("expectations", "table2", "per_dataset", "extended", "solvers"),
    *("joint", "studies", "break_even", "costs", "few", "kinds", "stiffness", "budget", "pairs", "needed", "designs"),
    *("places", "scores", "score_pairs", "tubes", "observability", "geometry", "weighting"),
)
# Each table, and how it is read: what looks like a number may be none.
_TABLES = {name: {} for name in _PLAIN} | {
    "comparison": {"dtype": {"table": str}},
    "claims": {"keep_default_na": False, "na_values": {"p": [""]}},
    "ladder": {"dtype": {"link_springs": str}},
    "simulated": {"dtype": {"unobservable": str}},
}
# Of every cell.
_LONG = {"metrics": metrics, "replicates": lambda joints: REPLICATES, "noisiest": metrics}


def state_answers(job: Job) -> None:
    settings = job.params
    names = brief_names(settings.names)
    titles = {robot: names[robot] for robot in settings.robots}
    tables = {name: pd.read_csv(getattr(job.input, name), **how) for name, how in _TABLES.items()}
    tables |= {name: read_long(getattr(job.input, name), schema) for name, schema in _LONG.items()}
    facts = answers(tables, titles, settings.cells)
    strategies = [strategy_from_document(document) for document in settings.strategies]
    classical, length = settings.cells["classical_strategy"], settings.cells["length"]
    asked = Asked(titles, strategies, classical, settings.best, length, settings.accuracy_um, settings.joint_range)
    citation = read_document(job.input.citation)
    cited = {"date": str(citation["date-released"]), "version": citation["version"], "license": citation["license"]}
    facts |= {"citation": {"authors": ", ".join(each["name"] for each in citation["authors"])} | cited}
    facts |= answer_questions(tables, asked)
    facts |= {
        "titles": titles,
        "names": names,
        "full_names": [settings.names[robot] for robot in titles],
        "size": {name: f"{value:g}" for name, value in settings.size.items()},
        "stated": stated(settings.stated),
    }
    write_text(job.output.answers, json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False))


run(state_answers, snakemake)
