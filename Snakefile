# RAHAS: from field_log.csv to measured surfaces, in the order of the data.
# `snakemake --cores 2` here, or `--snakefile THIS --directory EXPEDITION` for any other expedition.


include: "workflow/rules/common.smk"
include: "workflow/rules/simulate.smk"
include: "workflow/rules/capture.smk"
include: "workflow/rules/phase.smk"
include: "workflow/rules/calibrate.smk"
include: "workflow/rules/surface.smk"
include: "workflow/rules/pages.smk"
include: "workflow/rules/by_name.smk"


rule all:
    default_target: True
    input:
        lambda wildcards: PLAN.targets(),
        rules.summary.output,
