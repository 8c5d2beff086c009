# Phase and calibration → cloud, second QA gate; the scan's page.
rule surface:
    input:
        stamps_before("surface"),
    output:
        stamp="results/{scan}/provenance/surface.{key}.{number}",
    threads: 1
    resources:
        mem_mb=500,
    params:
        recipe=recipe_of("surface"),
    message:
        "{wildcards.scan}: triangulating, debanding, reviewing"
    shell:
        "{RAHAS} job surface {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
