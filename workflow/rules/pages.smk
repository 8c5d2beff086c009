# The expedition at a glance, with the closing lines: the last job of a run, and where a job failed, its end.


# On a cluster it runs beside the scheduler; a node, which does a job of one scan, does not ask for its name.
rule summary:
    input:
        lambda wildcards: PLAN.targets(),
    output:
        page="results/index.html",
        table="results/scans.csv",
        stamp=PLAN.summary_stamp() if workflow.is_main_process else SUMMARY_UNASKED,
    localrule: True
    message:
        "the expedition at a glance"
    shell:
        "{RAHAS} summary --stamp {output.stamp:q} {OPTIONS}"


onerror:
    shell("{RAHAS} summary {OPTIONS}")
