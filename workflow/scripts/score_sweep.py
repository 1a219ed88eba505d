"""The confounding sweep: the verdict on near relatives against the angle between them."""

from pathlib import Path

from job import Job, origin_of, run

from elastocal.figures.style import save
from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.blind.sweep import against_angle, swept
from elastocal_proof.figures.sweep import sweep


def score_sweep(job: Job) -> None:
    files = [file for folder in job.input.sealed for file in Path(folder).glob("*.json")]
    verdicts = {verdict["campaign"]: verdict for path in job.input.verdicts for verdict in read_json(path)}
    cases = swept(load_ground_truth(files, job.input.manifest), verdicts)
    table = against_angle(cases)
    write_csv(job.output.cases, cases)
    write_csv(job.output.table, table)
    save(sweep(table), job.output.pdf, job.output.png, origin_of(job))


run(score_sweep, snakemake)
