# Phase of the target → camera, projector and texture-camera models; the calibration's page.
rule calibrate:
    message: "{wildcards.scan}: finding the target, fitting camera and projector"
    input:
        stamps_before("calibrate"),
    output:
        stamp="results/{scan}/provenance/calibrate.{key}.{number}",
    params:
        recipe=recipe_of("calibrate"),
    threads: 1
    resources:
        mem_mb=500,
    shell:
        "{RAHAS} job calibrate {wildcards.scan:q} --stamp {output.stamp:q} {OPTIONS}"
