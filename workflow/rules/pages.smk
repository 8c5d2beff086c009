# The expedition at a glance, with the closing lines: the last job of a run, and where a job failed, its end.


rule summary:
    input:
        PLAN.targets(),
    output:
        page="results/index.html",
        table="results/scans.csv",
        stamp=PLAN.summary_stamp(),
    message:
        "the expedition at a glance"
    shell:
        "{RAHAS} summary --stamp {output.stamp:q} {OPTIONS}"


onerror:
    shell("{RAHAS} summary {OPTIONS}")
