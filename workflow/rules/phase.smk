# Frame store → snake matrices → wrapped and unwrapped phase.
rule phase:
    message: "{wildcards.scan}: tracking snakes, solving phase"
    input:
        stamps_before("phase"),
    output:
        stamp="results/{scan}/provenance/phase.{key}.{number}",
    params:
        recipe=recipe_of("phase"),
    threads: 1
    resources:
        mem_mb=500,
    shell:
        "{RAHAS} job phase {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
