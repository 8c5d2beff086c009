# Frame store → snake matrices → wrapped and unwrapped phase.
rule phase:
    input:
        stamps_before("phase"),
    output:
        stamp="results/{scan}/provenance/phase.{key}.{number}",
    threads: 1
    resources:
        mem_mb=500,
    params:
        recipe=recipe_of("phase"),
    message:
        "{wildcards.scan}: tracking snakes, solving phase"
    shell:
        "{RAHAS} job phase {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
