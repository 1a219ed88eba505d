"""Each figure that the paper prints beside ours."""

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import read_frame, read_long, read_studies, write_csv
from elastocal.study.comparison import OurResults, comparison_table
from elastocal.study.table_schemas import INITIAL, REPLICATES, metrics, repeated


def compare_with_paper(job: Job) -> None:
    settings = job.params
    ours = OurResults(
        tables={name: pd.read_csv(job.input[name]) for name in ("table1", "table2", "table3", "table4", "extended")},
        metrics=read_long(job.input.metrics, metrics),
        replicates=read_long(job.input.replicates, lambda joints: REPLICATES),
        noise_um=settings.noise_um,
        length=settings.length,
        studies=read_studies(job.input.studies, repeated),
        initial={robot: read_frame(path, INITIAL) for robot, path in zip(settings.robots, job.input.initial, strict=True)},
    )
    reference = pd.read_csv(job.input.reference, dtype={"table": str}, keep_default_na=False)
    write_csv(job.output.table, comparison_table(reference, ours))


run(compare_with_paper, snakemake)
