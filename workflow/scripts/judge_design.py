"""What one strategy can identify from the experiments of one robot."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, write_table
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.robot import with_target_offset
from elastocal.study.steps.design import design_blocks
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import design, experiments


def judge_design(job: Job) -> None:
    settings = job.params
    chain = with_target_offset(parse_chain(settings.chain, settings.lengths_m, job.wildcards.robot), settings.tool_offset_m)
    strategy = strategy_from_document(settings.strategy)
    blocks = read_blocks(job.input.experiments, experiments(chain.coordinates))
    judged = design_blocks(blocks, chain, strategy, settings.rows, settings.wrench_at)
    write_table(job.output.design, design(chain.coordinates), judged, provenance(settings, **dict(job.wildcards)))


run(judge_design, snakemake)
