"""`snakemake -j2` makes the paper's tables and figures from seeds and closes the loop on a simulated and a measured robot; the
target `study` makes the rest of the study: further questions, repeated studies and designs."""


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
include: "workflow/rules/closed_loop.smk"
include: "workflow/rules/league_files.smk"
include: "workflow/rules/league.smk"
include: "workflow/rules/signatures.smk"
include: "workflow/rules/audit.smk"


complete_rules()
watch_sources()


onstart:
    # While Snakemake limits how many jobs start in a time, and by default it does, to 100 a second, each look at what is ready
    # starts a timer for another look, so a second later there are as many looks as there were, and each job adds one for good.
    # No machine of ours starts 100 jobs in a second: what limits them is cores, or Slurm.
    limit = workflow.scheduling_settings.max_jobs_per_timespan
    if limit is not None and limit.max_jobs >= 100 * limit.timespan:
        workflow.scheduler.job_rate_limiter = None
    remember_checksums()
    # Not of jobs that another machine runs; on Linux alone a process can wait for others and for requests at once.
    if workflow.local_exec and hasattr(os, "pidfd_open"):
        start_warm()


onsuccess:
    for line in outcome(file for job in workflow.dag.jobs for file in job.output):
        logger.info(line)


# The paper's Tables 1-4 and Figures 2-5, each printed figure beside ours.
rule paper:
    input:
        rules.compile_paper.output.report,
        expand(
            "reports/tables/table{number}.{format}",
            number=[1, 2, 3, 4],
            format=["csv", "md", "tex"],
        ),
        expand("reports/figures/{figure}.{format}", figure=PAPER_FIGURES, format=["pdf", "png"]),
        lambda wildcards: files_behind(rules.paper.input),


# What the study asks beyond the paper's tables, and its report.
rule study:
    input:
        rules.paper.input,
        rules.compile_report.output.report,
        expand(
            "reports/tables/{table}.csv",
            table=[
                "comparison",
                "joint_test",
                "extended",
                "strategies_over_studies",
                "break_even",
            ],
        ),
        expand("reports/tables/{table}.csv", table=["ladder", "simulated_designs"]),
        rules.tabulate_budget.output,
        # Scores of every strategy at every noise level.
        cells("metrics", config["robots"], NOISE),
        expand("reports/figures/{figure}.{format}", figure=FIGURES, format=["pdf", "png"]),
        lambda wildcards: files_behind(rules.study.input),


# All simulated campaigns.
rule loop:
    input:
        loop_reports(config["loop"]["campaigns"]),
        "reports/loop/campaigns.csv",
        lambda wildcards: files_behind(rules.loop.input),


# One simulated and one measured robot.
rule main_loops:
    input:
        loop_reports(config["loop"]["main"]),
        lambda wildcards: files_behind(rules.main_loops.input),


rule all:
    default_target: True
    input:
        rules.paper.input,
        rules.main_loops.input,
