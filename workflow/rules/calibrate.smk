# Phase of the target → camera, projector and texture-camera models; the calibration's page.
rule calibrate:
    input:
        stamps_before("calibrate"),
    output:
        stamp="results/{scan}/provenance/calibrate.{key}.{number}",
    threads: 1
    resources:
        mem_mb=500,
    params:
        recipe=recipe_of("calibrate"),
    message:
        "{wildcards.scan}: finding the target, fitting camera and projector"
    shell:
        "{RAHAS} job calibrate {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
