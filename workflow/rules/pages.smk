# The expedition at a glance; also written, with the closing lines, at the end of every run, failed or not.


rule summary:
    input:
        PLAN.targets(),
    output:
        "results/index.html",
        "results/scans.csv",
    message:
        "the expedition at a glance"
    shell:
        "{RAHAS} summary {OPTIONS}"


onsuccess:
    shell("{RAHAS} summary {OPTIONS}")


onerror:
    shell("{RAHAS} summary {OPTIONS}")
