# Frame store → snake matrices → wrapped and unwrapped phase.
rule phase:
    input:
        stamps_before("phase"),
    output:
        stamp="results/{scan}/provenance/phase.{key}.{number}",
    group:
        group_of
    threads: 1
    resources:
        mem_mb=memory_of("phase"),
        runtime=runtime_of("phase"),
    params:
        recipe=recipe_of("phase"),
    message:
        "{wildcards.scan}: tracking snakes, solving phase"
    shell:
        "{RAHAS} job phase {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
