"""Strategies by every metric, and where metrics rank them differently."""

from job import Job, run

from elastocal.io.data_frames import read_frame, read_long, write_csv
from elastocal.study.ranks import pairs_table, ranks_table, scores
from elastocal.study.table_schemas import REPLICATES, USES, metrics


def tabulate_uses(job: Job) -> None:
    settings = job.params
    averaged, drawn = read_long(job.input.metrics, metrics), read_long(job.input.replicates, lambda joints: REPLICATES)
    found = {
        robot: scores(read_frame(path, USES), averaged[averaged.robot == robot], drawn[drawn.robot == robot], settings.length)
        for robot, path in zip(settings.robots, job.input.uses, strict=True)
    }
    write_csv(job.output.scores, ranks_table(found, settings.classical))
    write_csv(job.output.pairs, pairs_table(found))


run(tabulate_uses, snakemake)
