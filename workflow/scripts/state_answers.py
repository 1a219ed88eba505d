"""Every number that the report's text states."""

import json

from job import Job, run

import pandas as pd

from elastocal.io.atomic_writes import write_text
from elastocal.io.data_frames import read_long
from elastocal.io.documents import read_document
from elastocal.report.answers import answers
from elastocal.report.decision_answers import (
    break_even_rows,
    claim_rows,
    cost_facts,
    few_rows,
    joint_rows,
    kind_rows,
    measured_rows,
    simulated_design_rows,
    smallest_designs,
    stiffness_rows,
    study_facts,
)
from elastocal.report.metric_answers import METRIC_NAMES, metric_summary, score_rows, staged_rows
from elastocal.report.question_answers import (
    brief_names,
    budget_rows,
    design_facts,
    geometry_rows,
    ladder_rows,
    needed_rows,
    observability_rows,
    place_facts,
    stated,
    strategy_rows,
    summaries,
    tube_rows,
    weighting_rows,
)
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import REPLICATES, metrics


def state_answers(job: Job) -> None:
    settings = job.params
    names, length, accuracy = brief_names(settings.names), settings.cells["length"], settings.accuracy_um
    titles = {robot: names[robot] for robot in settings.robots}
    facts = answers(
        comparison=pd.read_csv(job.input.comparison, dtype={"table": str}),
        expectations=pd.read_csv(job.input.expectations),
        table2=pd.read_csv(job.input.table2),
        per_dataset=pd.read_csv(job.input.per_dataset),
        extended=pd.read_csv(job.input.extended),
        solvers=pd.read_csv(job.input.solvers),
        metrics=read_long(job.input.metrics, metrics),
        replicates=read_long(job.input.replicates, lambda joints: REPLICATES),
        noisiest=read_long(job.input.noisiest, metrics),
        titles=titles,
        cells=settings.cells,
    )
    ladder, pairs = pd.read_csv(job.input.ladder, dtype={"link_springs": str}), pd.read_csv(job.input.pairs)
    observability, designs = pd.read_csv(job.input.observability), pd.read_csv(job.input.designs)
    scores = pd.read_csv(job.input.scores)
    simulated, measured = pd.read_csv(job.input.simulated, dtype={"unobservable": str}), pd.read_csv(job.input.studies)
    citation = read_document(job.input.citation)
    cited = {"date": str(citation["date-released"]), "version": citation["version"], "license": citation["license"]}
    facts |= {
        "citation": {"authors": ", ".join(each["name"] for each in citation["authors"])} | cited,
        "accuracy_um": f"{accuracy:g}",
        "claims": claim_rows(pd.read_csv(job.input.claims, keep_default_na=False, na_values={"p": [""]}), titles),
        "joint": joint_rows(pd.read_csv(job.input.joint)),
        "table4": measured_rows(measured, titles),
        "over_studies": [
            {"title": title} | study_facts(measured, robot, settings.cells["classical_strategy"], settings.best)
            for robot, title in titles.items()
        ],
        "break_even": break_even_rows(pd.read_csv(job.input.break_even), accuracy, titles),
        "costs": cost_facts(pd.read_csv(job.input.costs), titles),
        "simulated": simulated_design_rows(simulated, length, titles),
        "smallest": smallest_designs(simulated, accuracy, titles),
        "few": few_rows(pd.read_csv(job.input.few), titles),
        "kinds": kind_rows(pd.read_csv(job.input.kinds), length, titles),
        "stiffness": stiffness_rows(pd.read_csv(job.input.stiffness), titles),
        "strategies": strategy_rows([strategy_from_document(document) for document in settings.strategies]),
        "ladder": ladder_rows(ladder),
        "budget": budget_rows(pd.read_csv(job.input.budget), pairs, length, [*titles]),
        "needed": needed_rows(pd.read_csv(job.input.needed), accuracy, [*titles]),
        "designs": {kind: design_facts(some, length, accuracy, titles) for kind, some in designs.groupby("joint_range")},
        "joint_range": settings.joint_range,
        "places": place_facts(pd.read_csv(job.input.places), titles),
        "scores": score_rows(scores, [*titles]),
        "staged": staged_rows(scores, [*titles]),
        "metrics": metric_summary(pd.read_csv(job.input.score_pairs), titles),
        "metric_names": METRIC_NAMES,
        "tubes": tube_rows(pd.read_csv(job.input.tubes)),
        "observability": observability_rows(observability, [*titles]),
        "summaries": summaries(ladder, pairs, observability),
        "geometry": geometry_rows(pd.read_csv(job.input.geometry), [*titles]),
        "weighting": weighting_rows(pd.read_csv(job.input.weighting), [*titles]),
        "titles": titles,
        "names": names,
        "full_names": [settings.names[robot] for robot in titles],
        "size": {name: f"{value:g}" for name, value in settings.size.items()},
        "stated": stated(settings.stated),
    }
    write_text(job.output.answers, json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False))


run(state_answers, snakemake)
