"""The model as declared, fitted to the training poses."""

from elastocal.fitting import fit
from elastocal.json_files import read_json
from elastocal.loop.case import noise_from
from elastocal.loop.fit_columns import correlation_columns, parameter_columns
from elastocal.loop.opened import opened_case
from elastocal.loop.schemas import CORRELATIONS, PARAMETERS
from elastocal.provenance import provenance
from elastocal.storage import write_table

from job import run


def fit_declared(job):
    case = opened_case(job.input.descriptions, job.input.training)
    fitted = fit(case.model, case.observations, noise_from(read_json(job.input.noise)))
    origin = provenance({}, **job.wildcards)
    write_table(job.output.parameters, PARAMETERS, [parameter_columns(fitted)], origin)
    write_table(job.output.correlations, CORRELATIONS, [correlation_columns(fitted)], origin)


run(fit_declared, snakemake)
