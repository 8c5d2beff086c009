# Rows whose capture lies under captures/simulated/ are rendered from config/simulation.yaml.


rule simulate:
    output:
        stamp="results/{scan}/provenance/render.{key}.{number}",
    group:
        group_of
    threads: 1
    resources:
        mem_mb=memory_of("simulate"),
        runtime=runtime_of("simulate"),
    message:
        "{wildcards.scan}: rendering the capture"
    shell:
        "{RAHAS} simulate {wildcards.scan:q} --stamp {output.stamp:q}"
