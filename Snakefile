"""Regenerate the paper's tables and figures from seeds, and close the loop on a simulated and a measured robot: `snakemake -j2`.

The target `study` makes the rest of the study: further questions, repeated studies and designs.
"""


include: "workflow/rules/begin.smk"


configfile: f"{workflow.basedir}/config.yaml"


# Introduction of `snakemake --report`.
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
    snakemake_internals.lift_rate_limit(workflow)
    snakemake_internals.remember_checksums()
    if snakemake_internals.runs_jobs_here(workflow):
        start_script = start_server()
        # Without a server Snakemake starts an interpreter for each job, which is slower and otherwise the same.
        if start_script is not None:
            snakemake_internals.replace_script_runner(start_script)


onsuccess:
    made = snakemake_internals.files_of_jobs(workflow)
    for line in describe_outcome(made, folder=config.get("campaign") or "CAMPAIGN"):
        logger.info(line)


# The paper's Tables 1 to 4 and Figures 2 to 5, with each printed figure beside ours.
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


# The questions of the study beyond the paper's tables, and its report.
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
                "multiverse",
                "multiverse_summary",
                "claims",
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
