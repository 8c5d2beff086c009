# Rows whose capture lies under captures/simulated/ are rendered from config/simulation.yaml.


rule simulate:
    message: "{wildcards.scan}: rendering the capture"
    output:
        stamp="results/{scan}/provenance/render.{key}.{number}",
    threads: 1
    resources:
        mem_mb=1000,
    shell:
        "{RAHAS} simulate {wildcards.scan:q} --stamp {output.stamp:q}"
