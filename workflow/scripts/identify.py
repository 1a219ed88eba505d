"""One strategy on the data sets of one robot at one noise level, every prefix length."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, write_table
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.robot import with_target_offset
from elastocal.study.steps.columns import DEFLECTION_COLUMNS
from elastocal.study.steps.identify import identified_blocks, paired_blocks
from elastocal.study.strategies import strategy_from_document, without_forgotten_stages
from elastocal.study.table_schemas import DEFLECTIONS, design, experiments, identified


def identify(job: Job) -> None:
    settings = job.params
    chain = with_target_offset(parse_chain(settings.chain, settings.lengths_m, job.wildcards.robot), settings.tool_offset_m)
    strategy = strategy_from_document(settings.strategy)
    if settings.start is None:
        strategy = without_forgotten_stages(strategy, chain.coordinates)
    blocks = paired_blocks(
        read_blocks(job.input.experiments, experiments(chain.coordinates)),
        {name: read_blocks(job.input.measured, DEFLECTIONS, DEFLECTION_COLUMNS, point=name) for name in strategy.points},
    )
    designs = read_blocks(job.input.design, design(chain.coordinates), ["condition"])
    solved = identified_blocks(blocks, designs, chain, strategy, settings.rows, settings.wrench_at, settings.start)
    write_table(job.output.identified, identified(chain.coordinates), solved, provenance(settings, **dict(job.wildcards)))


run(identify, snakemake)
