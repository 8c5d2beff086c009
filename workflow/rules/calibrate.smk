# Phase of the target → camera, projector and texture-camera models; the calibration's page.
rule calibrate:
    input:
        stamps_before("calibrate"),
    output:
        stamp="results/{scan}/provenance/calibrate.{key}.{number}",
    group:
        group_of
    threads: 1
    resources:
        mem_mb=memory_of("calibrate"),
        runtime=runtime_of("calibrate"),
    params:
        recipe=recipe_of("calibrate"),
    message:
        "{wildcards.scan}: finding the target, fitting camera and projector"
    shell:
        "{RAHAS} job calibrate {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
