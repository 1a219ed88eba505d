"""Both solvers on the data sets of one robot, for every strategy at one length."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, write_table
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.robot import with_target_offset
from elastocal.study.steps.columns import DEFLECTION_COLUMNS
from elastocal.study.steps.identify import paired_blocks
from elastocal.study.steps.solvers import solver_table
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import DEFLECTIONS, experiments, solvers


def compare_solvers(job: Job) -> None:
    settings = job.params
    chain = with_target_offset(parse_chain(settings.chain, settings.lengths_m, job.wildcards.robot), settings.tool_offset_m)
    strategies = [strategy_from_document(document) for document in settings.strategies]
    points = dict.fromkeys(name for strategy in strategies for name in strategy.points)
    blocks = paired_blocks(
        read_blocks(job.input.experiments, experiments(chain.coordinates)),
        {name: read_blocks(job.input.measured, DEFLECTIONS, DEFLECTION_COLUMNS, point=name) for name in points},
    )
    solved = solver_table(blocks, chain, strategies, settings.rows, settings.wrench_at, settings.length, settings.start)
    write_table(job.output.solvers, solvers(chain.coordinates), solved, provenance(settings))


run(compare_solvers, snakemake)
