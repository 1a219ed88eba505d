"""Write the evidence of a campaign's diagnosis for the audit, which computes its
probabilities again."""

from job import Job, run

from elastocal.io.json_files import write_json
from elastocal.loop.diagnosis_tables import load_case
from elastocal.loop.traced_evidence import trace_evidence


def write_evidence(job: Job) -> None:
    case = load_case(job.input.descriptions, job.input.training)
    write_json(job.output.evidence, trace_evidence(case, job.params.seed))


run(write_evidence, snakemake)
