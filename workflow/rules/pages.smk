# The expedition at a glance; written once more, with the closing lines, at the end of every run, failed or not.


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


onsuccess:
    shell("{RAHAS} summary {OPTIONS}")


onerror:
    shell("{RAHAS} summary {OPTIONS}")
