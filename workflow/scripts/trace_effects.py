"""What the declared model lacks: looks at all candidates until none stands out any more."""

import sys

from elastocal.attribution import confounding
from elastocal.json_files import read_json
from elastocal.loop.fit_columns import correlation_columns, parameter_columns
from elastocal.loop.opened import opened_case, opened_fit
from elastocal.loop.schemas import CONFOUNDING, CORRELATIONS, FOUND, LOOKS, PARAMETERS
from elastocal.loop.search_columns import confounding_columns, found_columns, look_blocks
from elastocal.provenance import provenance
from elastocal.random_streams import stream
from elastocal.selection import search
from elastocal.storage import write_table

from job import run


def trace_effects(job):
    case = opened_case(job.input.descriptions, job.input.training)
    declared, _ = opened_fit(case, job.input.declared, job.input.noise)
    decisive = [fault for fault in read_json(job.input.faults) if fault["decisive"]]
    # Readings that must be corrected first tell nothing of the robot.
    candidates = [] if decisive else list(case.candidates.values())
    draws = stream(job.params.seed, case.campaign.name, "signs of poses", 0)
    campaign = job.wildcards.campaign
    found = search(
        declared,
        case.observations,
        candidates,
        job.params.replicates,
        draws,
        lambda line: print(f"{campaign}: {line}", file=sys.stderr, flush=True),
    )
    origin = provenance(job.params, **job.wildcards)
    write_table(job.output.looks, LOOKS, look_blocks(found.looks, case.candidates), origin)
    write_table(job.output.found, FOUND, [found_columns(found)], origin)
    write_table(job.output.parameters, PARAMETERS, [parameter_columns(found.final)], origin)
    write_table(job.output.correlations, CORRELATIONS, [correlation_columns(found.final)], origin)
    seen = found.looks[0].directions
    write_table(job.output.confounding, CONFOUNDING, [confounding_columns(seen, confounding(seen))], origin)


run(trace_effects, snakemake)
