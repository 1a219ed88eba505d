"""What may be missing in the model of a campaign: probabilities of hypotheses, and candidates one by one."""

from job import Job, origin_of, run

from elastocal.figures.candidates import probabilities
from elastocal.figures.style import save
from elastocal.io.json_files import read_json
from elastocal.io.storage import read_table
from elastocal.loop.schemas import CANDIDATES


def draw_candidates(job: Job) -> None:
    stated = read_json(job.input.diagnosis)["document"]["probabilities"]
    save(probabilities(stated, read_table(job.input.candidates, CANDIDATES)), job.output.pdf, job.output.png, origin_of(job))


run(draw_candidates, snakemake)
