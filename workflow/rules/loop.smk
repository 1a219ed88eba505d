"""The loop of a campaign: measurements, noise, declared model, missing effects, held-out errors, verdict, report.

Needs a campaign's folder: the user's own, or data/campaigns/{campaign}/, which is simulated or imported from public data. Writes
results/loop/{campaign}/, a table for each step, and reports/loop/{campaign}/. No step before judge_campaign reads held-out poses.
"""

SIMULATED = [name for name, source in SOURCES.items() if source["source"] == "simulated"]
INCLUDED = [name for name, source in SOURCES.items() if source["source"] == "included"]
PUBLIC = [name for name in SOURCES if name not in [*SIMULATED, *INCLUDED]]
# Figures of a campaign, with their titles in `snakemake --report`.
LOOP_FIGURES = {
    "before_after": "Errors before and after",
    "arrows": "Residuals in space",
    "candidates": "Candidates",
}
LOOP_REPORTS = [
    "verdict.json",
    "before_after.csv",
    "candidates.csv",
    "residuals.parquet",
    "next_experiment.csv",
    *(f"figures/{figure}.pdf" for figure in LOOP_FIGURES),
    "report.pdf",
    "report.html",
]


rule simulate_campaign:
    output:
        document="data/campaigns/{campaign}/campaign.yaml",
        measurements="data/campaigns/{campaign}/measurements.parquet",
    wildcard_constraints:
        campaign="|".join(SIMULATED) or "none",
    params:
        source=lambda wildcards: SOURCES[wildcards.campaign],
        seed=config["seed"],
    script:
        "../scripts/simulate_campaign.py"


rule import_campaign:
    input:
        sources=f"{CONFIG}/public_data.yaml",
        robots=robots_of_import,
    output:
        document="data/campaigns/{campaign}/campaign.yaml",
        measurements="data/campaigns/{campaign}/measurements.parquet",
    wildcard_constraints:
        campaign="|".join(PUBLIC) or "none",
    params:
        source=lambda wildcards: SOURCES[wildcards.campaign],
        kept="data/public",
        box=INCLUDED_DATA,
    script:
        "../scripts/import_campaign.py"


rule copy_included_campaign:
    output:
        document="data/campaigns/{campaign}/campaign.yaml",
        measurements="data/campaigns/{campaign}/measurements.parquet",
    wildcard_constraints:
        campaign="|".join(INCLUDED) or "none",
    params:
        source=lambda wildcards: SOURCES[wildcards.campaign],
        folder=included_folder,
        document_sha256=lambda wildcards: digest_of([f"{included_folder(wildcards)}/campaign.yaml"]),
    script:
        "../scripts/copy_included_campaign.py"


rule read_campaign:
    input:
        files=files_of,
    output:
        training="results/loop/{campaign}/training.parquet",
        held_out="results/loop/{campaign}/held_out.parquet",
        descriptions="results/loop/{campaign}/campaign.json",
    params:
        step="elastocal.loop.loading.read_campaign",
        folder=lambda wildcards: folder_of(wildcards.campaign),
        robots=f"{CONFIG}/robots",
        files_sha256=lambda wildcards: (
            digest_of(files_of(wildcards)) if wildcards.campaign in OWN else None
        ),
    script:
        "../scripts/run_step.py"


rule diagnose_campaign:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
    output:
        diagnosis="results/loop/{campaign}/diagnosis.json",
        steps="results/loop/{campaign}/steps.parquet",
        candidates="reports/loop/{campaign}/candidates.csv",
        experiment="reports/loop/{campaign}/next_experiment.csv",
    params:
        step="elastocal.loop.diagnosis_tables.diagnose_campaign",
        seed=config["seed"],
        states=config["loop"]["proposed_states"],
    script:
        "../scripts/run_step.py"


rule judge_campaign:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
        held_out=rules.read_campaign.output.held_out,
        diagnosis=rules.diagnose_campaign.output.diagnosis,
    output:
        verdict="reports/loop/{campaign}/verdict.json",
        before_after=shown(
            "reports/loop/{campaign}/before_after.csv",
            "loop_errors",
            "Campaigns",
            campaign="{campaign}",
            shows="Errors before and after",
            kind="table",
        ),
        residuals="reports/loop/{campaign}/residuals.parquet",
    params:
        step="elastocal.loop.whole.judge_campaign",
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule summarize_campaigns:
    input:
        verdicts=lambda wildcards: expand(
            "reports/loop/{name}/verdict.json", name=config["loop"][wildcards.kind]
        ),
        residuals=lambda wildcards: expand(
            "reports/loop/{name}/residuals.parquet", name=config["loop"][wildcards.kind]
        ),
    output:
        table=shown(
            "reports/loop/{kind}.csv",
            "loop_overview",
            "Campaigns",
            campaign="all of {kind}",
            shows="All campaigns",
            kind="table",
        ),
    wildcard_constraints:
        kind="campaigns|main|measured|cameras|sockets",
    params:
        step="elastocal.loop.summary.summarize_campaigns",
        campaigns=lambda wildcards: config["loop"][wildcards.kind],
        folds=lambda wildcards: folds_of_one(config["loop"][wildcards.kind]),
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule draw_campaign_errors:
    input:
        table=rules.summarize_campaigns.output.table,
    output:
        pdf="reports/loop/{kind}.pdf",
        png=shown(
            "reports/loop/{kind}.png",
            "loop_all_errors",
            "Campaigns",
            campaign="all of {kind}",
            shows="Held-out errors before and after",
            kind="figure",
        ),
    wildcard_constraints:
        kind="campaigns|measured|cameras|sockets",
    script:
        "../scripts/draw_campaign_errors.py"


rule measured_pictures:
    """The picture of docs/measured_data.md, from finished campaigns of measured data."""
    input:
        sources=["reports/loop/measured.png"],
    output:
        copies=["docs/measured_data.png"],
    script:
        "../scripts/copy_into_docs.py"


rule diagnose:
    input:
        reports_of_own,


rule measured:
    input:
        loop_reports(config["loop"]["measured"]),
        "reports/loop/measured.csv",
        "reports/loop/measured.png",
        lambda wildcards: files_behind(rules.measured.input),


# Campaigns of a printed tool and of a camera, whose data come with this repository.
rule cameras:
    input:
        loop_reports(config["loop"]["cameras"]),
        "reports/loop/cameras.csv",
        "reports/loop/cameras.png",
        lambda wildcards: files_behind(rules.cameras.input),


# All Pandas of the source of the printed tool, which are fetched, and the camera with
# other held-out poses.
rule sockets:
    input:
        loop_reports(config["loop"]["sockets"]),
        "reports/loop/sockets.csv",
        "reports/loop/sockets.png",
        lambda wildcards: files_behind(rules.sockets.input),
