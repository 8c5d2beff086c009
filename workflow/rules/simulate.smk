# Rows whose capture lies under captures/simulated/ are rendered from config/simulation.yaml.


rule simulate:
    output:
        stamp="results/{scan}/provenance/render.{key}.{number}",
    threads: 1
    resources:
        mem_mb=1000,
    message:
        "{wildcards.scan}: rendering the capture"
    shell:
        "{RAHAS} simulate {wildcards.scan:q} --stamp {output.stamp:q}"
