# Capture → frame store, timeline, first QA gate.
rule capture:
    input:
        stamps_before("capture"),
    output:
        stamp="results/{scan}/provenance/capture.{key}.{number}",
    group:
        group_of
    threads: 1
    resources:
        mem_mb=memory_of("capture"),
        runtime=runtime_of("capture"),
    params:
        recipe=recipe_of("capture"),
    message:
        "{wildcards.scan}: reading the capture"
    shell:
        "{RAHAS} job capture {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
