"""Each figure that the paper prints beside ours."""

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import read_long, write_csv
from elastocal.study.comparison import OurResults, beside_paper
from elastocal.study.table_schemas import REPLICATES, metrics


def compare_with_paper(job: Job) -> None:
    ours = OurResults(
        tables={name: pd.read_csv(job.input[name]) for name in ("table1", "table2", "table3", "table4", "extended")},
        metrics=read_long(job.input.metrics, metrics),
        replicates=read_long(job.input.replicates, lambda joints: REPLICATES),
        noise_um=job.params.noise_um,
        length=job.params.length,
    )
    reference = pd.read_csv(job.input.reference, dtype={"table": str}, keep_default_na=False)
    write_csv(job.output.table, beside_paper(reference, ours))


run(compare_with_paper, snakemake)
