"""Few configurations, kinds of measurements, and what claims of the paper need."""

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.question_tables import few_table, kinds_table, stiffness_table
from elastocal.study.table_schemas import FEW, KINDS, STARTS, STIFFNESS


def tabulate_decisions(job: Job) -> None:
    settings, given, made = job.params, job.input, job.output
    few, kinds, stiffness, starts = (
        {robot: read_frame(path, schema) for robot, path in zip(settings.robots, paths, strict=True)}
        for paths, schema in ((given.few, FEW), (given.kinds, KINDS), (given.stiffness, STIFFNESS), (given.starts, STARTS))
    )
    write_csv(made.few, few_table(few))
    write_csv(made.kinds, kinds_table(kinds, settings.length))
    write_csv(made.stiffness, stiffness_table(stiffness))
    write_csv(made.starts, pd.concat([frame.assign(robot=robot) for robot, frame in starts.items()]))


run(tabulate_decisions, snakemake)
