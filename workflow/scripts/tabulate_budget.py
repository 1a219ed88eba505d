"""Sets of measuring points at an equal budget, paired, and how many configurations each needs."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.budget_tables import budget_table, lengths_table, paired_table
from elastocal.study.table_schemas import BUDGET


def tabulate_budget(job: Job) -> None:
    settings = job.params
    frames = {robot: read_frame(path, BUDGET) for robot, path in zip(settings.robots, job.input.budgets, strict=True)}
    write_csv(job.output.budget, budget_table(frames, settings.point_sets, settings.length))
    write_csv(job.output.pairs, paired_table(frames, settings.point_sets, settings.length))
    write_csv(job.output.lengths, lengths_table(frames, settings.point_sets, settings.accuracies_um))


run(tabulate_budget, snakemake)
