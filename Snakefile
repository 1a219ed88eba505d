"""The study, every table and figure of the paper from seeds, and the loop on simulated campaigns: `snakemake -j2` makes both."""


include: "workflow/rules/begin.smk"


configfile: f"{workflow.basedir}/config.yaml"


# What stands above the results in `snakemake --report`.
report: f"{workflow.basedir}/workflow/report/workflow.rst"


include: "workflow/rules/common.smk"
include: "workflow/rules/simulate.smk"
include: "workflow/rules/identify.smk"
include: "workflow/rules/repeat.smk"
include: "workflow/rules/questions.smk"
include: "workflow/rules/tables.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/loop.smk"
include: "workflow/rules/loop_report.smk"
include: "workflow/rules/blind.smk"
include: "workflow/rules/blind_follow_up.smk"
include: "workflow/rules/blind_report.smk"
include: "workflow/rules/closed_loop.smk"
include: "workflow/rules/bad_rows.smk"
include: "workflow/rules/planning.smk"
include: "workflow/rules/league_files.smk"
include: "workflow/rules/league.smk"
include: "workflow/rules/signatures.smk"
include: "workflow/rules/audit.smk"
include: "workflow/rules/crate.smk"
include: "workflow/rules/store.smk"


watch_sources()


onstart:
    # While Snakemake limits how many jobs start in a time, and by default it does, to 100 a second, each look at what is ready
    # starts a timer for another look, so a second later there are as many looks as there were, and each job adds one for good.
    # No machine of ours starts 100 jobs in a second: what limits them is cores, or Slurm.
    limit = workflow.scheduling_settings.max_jobs_per_timespan
    if limit is not None and limit.max_jobs >= 100 * limit.timespan:
        workflow.scheduler.job_rate_limiter = None


onsuccess:
    for line in outcome(file for job in workflow.dag.jobs for file in job.output):
        logger.info(line)


rule study:
    input:
        rules.compile_report.output.report,
        expand("reports/tables/table{number}.{format}", number=[1, 2, 3, 4], format=["csv", "md", "tex"]),
        expand("reports/tables/{table}.csv", table=["comparison", "expectations", "extended", "per_dataset", "solvers"]),
        rules.tabulate_budget.output,
        rules.tabulate_assumptions.output,
        expand(
            "reports/tables/{table}.csv",
            table=["ladder", "designs", "observability", "claims", "table4_studies", "joint_test"],
        ),
        expand("reports/tables/{table}.csv", table=["costs", "break_even", "simulated_designs_few"]),
        rules.tabulate_decisions.output,
        expand("reports/figures/{figure}.{format}", figure=FIGURES, format=["pdf", "png"]),
        lambda wildcards: files_behind(rules.study.input),


# The paper's Tables 1-4 and Figures 2-5 alone.
rule paper:
    input:
        expand("reports/tables/table{number}.{format}", number=[1, 2, 3, 4], format=["csv", "md", "tex"]),
        expand("reports/figures/{figure}.{format}", figure=PAPER_FIGURES, format=["pdf", "png"]),
        lambda wildcards: files_behind(rules.paper.input),


rule extended_study:
    input:
        "reports/tables/interpretations.csv",
        "reports/tables/simulated_designs_every.csv",


rule loop:
    input:
        loop_reports(config["loop"]["campaigns"]),
        "reports/loop/campaigns.csv",
        lambda wildcards: files_behind(rules.loop.input),


rule all:
    default_target: True
    input:
        rules.study.input,
        rules.loop.input,
