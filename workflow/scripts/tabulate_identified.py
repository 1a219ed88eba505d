"""Table 3: compliances by the classical strategy."""

from job import Job, run

from elastocal.io.data_frames import read_long, write_csv
from elastocal.study.table_schemas import metrics
from elastocal.study.tables import table3


def tabulate_identified(job: Job) -> None:
    settings = job.params
    frame = read_long(job.input.metrics, metrics)
    write_csv(job.output.table, table3(frame, settings.robots, settings.strategy, settings.noise_um, settings.length))


run(tabulate_identified, snakemake)
