"""The audit: recompute samples of every file of a finished run with libraries that share no code with the pipeline.

`make audit` first makes what `make paper` makes, if it is missing, then writes reports/audit.html and reports/audit.csv. If all checks
hold, it also writes reports/audit.txt; otherwise it ends with an error. Finished files of other targets, such as blind, are audited too.
"""

# Targets that are audited too if they have finished, with the last file of each.
AUDITED_TOO = {
    "study": "reports/study.pdf",
    "loop": "reports/loop/campaigns.csv",
    "measured": "reports/loop/measured.csv",
    "league": "reports/league/all/league.csv",
    "league_small": "reports/league/small/league.csv",
    "blind": "reports/blind/summary.csv",
    "closed_loop": "reports/closed_loop/goals.csv",
}


rule audit_files:
    input:
        files=audited,
        reference=f"{CONFIG}/paper/reference.csv",
    output:
        table="reports/audit.csv",
        page=shown("reports/audit.html", "audit", "Audit", shows="The audit", kind="report"),
    params:
        robots=STUDY.robots,
        strategies=STUDY.strategies,
        configuration={key: config[key] for key in AUDITED_KEYS},
        rows=config["audit"]["rows"],
        # The audit runs again after another target has finished; it does not start one.
        others=lambda wildcards: {
            target: compute_sha256(file) if Path(file).is_file() else ""
            for target, file in AUDITED_TOO.items()
        },
    script:
        "../scripts/audit_files.py"


rule judge_audit:
    input:
        table=rules.audit_files.output.table,
        page=rules.audit_files.output.page,
    output:
        verdict="reports/audit.txt",
    script:
        "../scripts/judge_audit.py"


rule audit:
    input:
        rules.audit_files.output,
        rules.judge_audit.output,
