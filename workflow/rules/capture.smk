# Capture → frame store, timeline, first QA gate.
rule capture:
    message: "{wildcards.scan}: reading the capture"
    input:
        stamps_before("capture"),
    output:
        stamp="results/{scan}/provenance/capture.{key}.{number}",
    params:
        recipe=recipe_of("capture"),
    threads: 1
    resources:
        mem_mb=500,
    shell:
        "{RAHAS} job capture {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
