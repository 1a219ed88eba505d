"""Table 4: the strategies compared."""

from job import Job, run

from elastocal.io.data_frames import read_long, write_csv
from elastocal.study.table_schemas import REPLICATES, metrics
from elastocal.study.tables import add_slugs, table4


def tabulate_strategies(job: Job) -> None:
    settings = job.params
    table = table4(
        read_long(job.input.metrics, metrics),
        read_long(job.input.replicates, lambda joints: REPLICATES),
        settings.robots,
        [*settings.strategies],
        **settings.cells,
    )
    write_csv(job.output.table, add_slugs(table, settings.strategies))


run(tabulate_strategies, snakemake)
