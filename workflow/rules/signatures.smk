"""Pictures of the catalogue: what each effect does to a measured point, for the site.

`snakemake -j1 signatures`. Writes reports/figures/signatures/EFFECT.svg.
"""


rule draw_signatures:
    input:
        # It has a compensator and a rated load, without which some effects are not offered.
        robot=f"{CONFIG}/robots/gp180.yaml",
    output:
        figures=directory("reports/figures/signatures"),
    script:
        "../scripts/draw_signatures.py"


rule signatures:
    input:
        rules.draw_signatures.output,
