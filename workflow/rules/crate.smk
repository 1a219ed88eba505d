"""A finished run as other programs can read it: `snakemake -j2 crate`.

Makes what is not made yet, then writes ro-crate-metadata.json, which describes the folder that it lies in: every job with its start,
end, inputs and outputs, every file with its SHA-256; and reports/configuration.json, software.csv and datapackage.json.
`--config crate_of='[study, loop, blind]'` names what is described; study and loop are without. `make crate` also validates it.
"""


rule write_crate:
    input:
        files=lambda wildcards: files_behind(described()),
        workflow=placed(ROOT / "Snakefile"),
        rules=[placed(path) for path in sorted((ROOT / "workflow" / "rules").glob("*.smk"))],
        sources=sources("write_crate.py"),
    output:
        configuration="reports/configuration.json",
        software="reports/software.csv",
        tables="reports/datapackage.json",
        crate="ro-crate-metadata.json",
    log:
        "results/logs/write_crate.log",
    benchmark:
        "results/timings/write_crate.tsv"
    params:
        configuration=RESOLVED,
    script:
        "../scripts/write_crate.py"


rule crate:
    input:
        rules.write_crate.output,
