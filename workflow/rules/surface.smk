# Phase and calibration → cloud, second QA gate; the scan's page.
rule surface:
    input:
        stamps_before("surface"),
    output:
        stamp="results/{scan}/provenance/surface.{key}.{number}",
    group:
        group_of
    threads: 1
    resources:
        mem_mb=memory_of("surface"),
        runtime=runtime_of("surface"),
    params:
        recipe=recipe_of("surface"),
    message:
        "{wildcards.scan}: triangulating, debanding, reviewing"
    shell:
        "{RAHAS} job surface {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
