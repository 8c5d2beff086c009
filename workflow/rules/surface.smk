# Phase and calibration → cloud, second QA gate; the scan's page.
rule surface:
    message: "{wildcards.scan}: triangulating, debanding, reviewing"
    input:
        stamps_before("surface"),
    output:
        stamp="results/{scan}/provenance/surface.{key}.{number}",
    params:
        recipe=recipe_of("surface"),
    threads: 1
    resources:
        mem_mb=500,
    shell:
        "{RAHAS} job surface {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
