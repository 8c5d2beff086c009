# A scan's artifact asked for by its name: made by its job, or refused with the reason.


def stamp_that_makes(wildcards):
    try:
        entry = PLAN.expedition.entry(wildcards.scan)
    except ExpeditionError as error:
        raise WorkflowError(str(error)) from None
    job = makes(PLAN.expedition.scan(wildcards.scan), wildcards.artifact, entry)
    if job is None:
        raise WorkflowError(
            f"{wildcards.scan}: a {entry.role} has no {wildcards.artifact}"
        )
    return PLAN.stamp(job, wildcards.scan)


rule file_by_name:
    input:
        stamp_that_makes,
    output:
        update("results/{scan}/{artifact}"),
    wildcard_constraints:
        artifact=r"timeline\.json|calibration\.json|cloud\.ply|qa\.json|report\.html",
    localrule: True
    message:
        "{wildcards.scan}: {wildcards.artifact}"
    shell:
        "{RAHAS} why {wildcards.scan:q} {wildcards.artifact:q} {OPTIONS}"


rule store_by_name:
    input:
        stamp_that_makes,
    output:
        update(directory("results/{scan}/{artifact}")),
    wildcard_constraints:
        artifact=r"frames\.zarr|snakes\.zarr|phase\.zarr|cloud\.zarr",
    localrule: True
    message:
        "{wildcards.scan}: {wildcards.artifact}"
    shell:
        "{RAHAS} why {wildcards.scan:q} {wildcards.artifact:q} {OPTIONS}"
