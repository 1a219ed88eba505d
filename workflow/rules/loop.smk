"""Closing the loop on a campaign: readings, noise, declared model, missing effects, held-out errors, verdict, report.

Needs a campaign's folder: the user's own, or data/campaigns/{campaign}/, which is simulated or imported from public data. Writes
results/loop/{campaign}/, a table for each step, and reports/loop/{campaign}/. No step before judge_held_out reads held-out poses.
"""

SIMULATED = [name for name, source in SOURCES.items() if source["source"] == "simulated"]
PUBLIC = [name for name in SOURCES if name not in SIMULATED]
LOOP_FIGURES = ["before_after", "arrows", "residuals", "candidates", "confounding"]
LOOP_REPORTS = [
    "verdict.json",
    "before_after.csv",
    "splits.csv",
    "candidates.parquet",
    "residuals.parquet",
    "next_experiment.csv",
    *(f"figures/{figure}.pdf" for figure in LOOP_FIGURES),
    "report.pdf",
]


rule simulate_campaign:
    input:
        sources=sources("simulate_campaign.py"),
    output:
        document="data/campaigns/{campaign}/campaign.yaml",
        measurements="data/campaigns/{campaign}/measurements.parquet",
    log:
        "results/logs/simulate_campaign/{campaign}.log",
    benchmark:
        "results/timings/simulate_campaign/{campaign}.tsv"
    wildcard_constraints:
        campaign="|".join(SIMULATED) or "none",
    params:
        source=lambda wildcards: SOURCES[wildcards.campaign],
        seed=config["seed"],
    script:
        "../scripts/simulate_campaign.py"


rule import_campaign:
    input:
        robots=expand("config/robots/{robot}.yaml", robot=["fanuc_static", "fanuc_cpa", "fanuc_measured", "ur10"]),
        sources=sources("import_campaign.py"),
    output:
        document="data/campaigns/{campaign}/campaign.yaml",
        measurements="data/campaigns/{campaign}/measurements.parquet",
    log:
        "results/logs/import_campaign/{campaign}.log",
    benchmark:
        "results/timings/import_campaign/{campaign}.tsv"
    wildcard_constraints:
        campaign="|".join(PUBLIC) or "none",
    params:
        source=lambda wildcards: SOURCES[wildcards.campaign],
        kept="data/public",
    script:
        "../scripts/import_campaign.py"


rule read_campaign:
    input:
        files=files_of,
        sources=sources("read_campaign.py"),
    output:
        training="results/loop/{campaign}/training.parquet",
        held_out="results/loop/{campaign}/held_out.parquet",
        descriptions="results/loop/{campaign}/campaign.json",
    log:
        "results/logs/read_campaign/{campaign}.log",
    benchmark:
        "results/timings/read_campaign/{campaign}.tsv"
    params:
        folder=lambda wildcards: folder_of(wildcards.campaign),
        robots="config/robots",
    script:
        "../scripts/read_campaign.py"


rule check_data:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
        sources=sources("check_data.py"),
    output:
        faults="results/loop/{campaign}/faults.json",
    log:
        "results/logs/check_data/{campaign}.log",
    benchmark:
        "results/timings/check_data/{campaign}.tsv"
    script:
        "../scripts/check_data.py"


rule estimate_noise:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
        sources=sources("estimate_noise.py"),
    output:
        noise="results/loop/{campaign}/noise.json",
    log:
        "results/logs/estimate_noise/{campaign}.log",
    benchmark:
        "results/timings/estimate_noise/{campaign}.tsv"
    script:
        "../scripts/estimate_noise.py"


rule fit_declared:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
        noise=rules.estimate_noise.output.noise,
        sources=sources("fit_declared.py"),
    output:
        parameters="results/loop/{campaign}/declared_parameters.parquet",
        correlations="results/loop/{campaign}/declared_correlations.parquet",
    log:
        "results/logs/fit_declared/{campaign}.log",
    benchmark:
        "results/timings/fit_declared/{campaign}.tsv"
    script:
        "../scripts/fit_declared.py"


rule trace_effects:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
        faults=rules.check_data.output.faults,
        noise=rules.estimate_noise.output.noise,
        declared=rules.fit_declared.output.parameters,
        sources=sources("trace_effects.py"),
    output:
        looks="results/loop/{campaign}/looks.parquet",
        found="results/loop/{campaign}/found.parquet",
        parameters="results/loop/{campaign}/final_parameters.parquet",
        correlations="results/loop/{campaign}/final_correlations.parquet",
        confounding="results/loop/{campaign}/confounding.parquet",
    log:
        "results/logs/trace_effects/{campaign}.log",
    benchmark:
        "results/timings/trace_effects/{campaign}.tsv"
    params:
        replicates=config["loop"]["replicates"],
        seed=config["seed"],
    script:
        "../scripts/trace_effects.py"


rule weigh_rivals:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
        noise=rules.estimate_noise.output.noise,
        found=rules.trace_effects.output.found,
        parameters=rules.trace_effects.output.parameters,
        sources=sources("weigh_rivals.py"),
    output:
        rivals="results/loop/{campaign}/rivals.parquet",
        doubts="results/loop/{campaign}/doubts.json",
        experiment="reports/loop/{campaign}/next_experiment.csv",
    log:
        "results/logs/weigh_rivals/{campaign}.log",
    benchmark:
        "results/timings/weigh_rivals/{campaign}.tsv"
    params:
        seed=config["seed"],
        states=config["loop"]["proposed_states"],
    script:
        "../scripts/weigh_rivals.py"


rule judge_held_out:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
        held_out=rules.read_campaign.output.held_out,
        noise=rules.estimate_noise.output.noise,
        declared=rules.fit_declared.output.parameters,
        looks=rules.trace_effects.output.looks,
        found=rules.trace_effects.output.found,
        parameters=rules.trace_effects.output.parameters,
        rivals=rules.weigh_rivals.output.rivals,
        sources=sources("judge_held_out.py"),
    output:
        before_after="reports/loop/{campaign}/before_after.csv",
        splits="reports/loop/{campaign}/splits.csv",
        errors="results/loop/{campaign}/held_out_errors.json",
        residuals="reports/loop/{campaign}/residuals.parquet",
    log:
        "results/logs/judge_held_out/{campaign}.log",
    benchmark:
        "results/timings/judge_held_out/{campaign}.tsv"
    params:
        seed=config["seed"],
    script:
        "../scripts/judge_held_out.py"


rule state_verdict:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
        faults=rules.check_data.output.faults,
        noise=rules.estimate_noise.output.noise,
        declared=rules.fit_declared.output.parameters,
        looks=rules.trace_effects.output.looks,
        found=rules.trace_effects.output.found,
        parameters=rules.trace_effects.output.parameters,
        rivals=rules.weigh_rivals.output.rivals,
        doubts=rules.weigh_rivals.output.doubts,
        before_after=rules.judge_held_out.output.before_after,
        errors=rules.judge_held_out.output.errors,
        sources=sources("state_verdict.py"),
    output:
        verdict="reports/loop/{campaign}/verdict.json",
        candidates="reports/loop/{campaign}/candidates.parquet",
    log:
        "results/logs/state_verdict/{campaign}.log",
    benchmark:
        "results/timings/state_verdict/{campaign}.tsv"
    script:
        "../scripts/state_verdict.py"


rule summarize_campaigns:
    input:
        verdicts=lambda wildcards: expand("reports/loop/{name}/verdict.json", name=config["loop"][wildcards.kind]),
        residuals=lambda wildcards: expand("reports/loop/{name}/residuals.parquet", name=config["loop"][wildcards.kind]),
        sources=sources("summarize_campaigns.py"),
    output:
        table="reports/loop/{kind}.csv",
    log:
        "results/logs/summarize_campaigns/{kind}.log",
    benchmark:
        "results/timings/summarize_campaigns/{kind}.tsv"
    wildcard_constraints:
        kind="campaigns|measured",
    params:
        campaigns=lambda wildcards: config["loop"][wildcards.kind],
        folds=lambda wildcards: folds_of_one(config["loop"][wildcards.kind]),
        seed=config["seed"],
    script:
        "../scripts/summarize_campaigns.py"


rule diagnose:
    input:
        loop_reports(OWN),


rule measured:
    input:
        loop_reports(config["loop"]["measured"]),
        "reports/loop/measured.csv",
