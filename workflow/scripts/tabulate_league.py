"""The league as tables and pictures: errors, costs, and which mechanisms real robots have."""

import sys
from pathlib import Path

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.style import save
from elastocal.io.atomic_writes import write_text
from elastocal.io.data_frames import read_frame, write_csv
from elastocal_proof.figures.league import league_picture, mechanism_picture
from elastocal_proof.league.folds import RANDOM
from elastocal_proof.league.methods import Method
from elastocal_proof.league.pages import league_page
from elastocal_proof.league.schemas import ENTRIES, MECHANISMS
from elastocal_proof.league.table import Result, cost_table, league_table, mechanism_table


def timing(folder: str, *names: str) -> dict[str, float]:
    row = pd.read_csv(Path(folder, *names).with_suffix(".tsv"), sep="\t").iloc[0]
    return {"seconds": float(row["cpu_time"]), "memory_MB": float(row["max_rss"])}


def tabulate_league(job: Job) -> None:
    settings = job.params
    methods = {name: Method(**described) for name, described in settings.methods.items()}
    keys, rounds = ([tuple(key) for key in each] for each in (settings.entered, settings.rounds))
    results = [Result(*key, read_frame(path, ENTRIES)) for key, path in zip(keys, job.input.entries, strict=True)]
    table = league_table(results, settings.robots, settings.reference, settings.seed)
    timings = {key: timing(settings.timings, "enter_league", *key) for key in keys}
    diagnosed = {key: timing(settings.timings, "diagnose_league_folds", *key) for key in rounds}
    folds = {(result.data, result.split): int(result.entries["fold"].max()) for result in results}
    costs = cost_table(timings, diagnosed, folds, methods)
    random = [data for data, split in rounds if split == RANDOM]
    found = {data: read_frame(path, MECHANISMS) for data, path in zip(random, job.input.mechanisms, strict=True)}
    mechanisms = mechanism_table(found, settings.robots, settings.folds)
    published = pd.read_csv(job.input.published)
    write_csv(job.output.league, table)
    write_csv(job.output.costs, costs)
    write_csv(job.output.mechanisms, mechanisms)
    write_text(job.output.page, league_page(table, costs, mechanisms, published, methods, settings.missing))
    for name, file in settings.missing.items():
        print(f"left out of the league: {name}, as {file} is missing in ELASTOCAL_DATA", file=sys.stderr)
    save(league_picture(table, methods), job.output.picture_pdf, job.output.picture_png, origin_of(job))
    save(mechanism_picture(mechanisms), job.output.mechanisms_pdf, job.output.mechanisms_png, origin_of(job))


run(tabulate_league, snakemake)
