# Needs: the artifacts and reports of all sequences, the validated trees.
# Makes: results/report/index.html, a page of maps, overlays and quality figures with their gates.


def report_inputs(wildcards):
    return [
        path
        for sequence in SEQUENCES.values()
        for stage in [*stages_of(sequence), "package"]
        for path in expand(list(getattr(rules, stage).output), id=sequence.id)
    ]


rule report:
    input:
        artifacts=report_inputs,
        validations=validations(),
    output:
        page="results/report/index.html",
    log:
        "logs/report.log",
    params:
        code=code("report"),
        sequences=[SEQUENCES[name].as_dict() for name in SEQUENCES],
        out=subpath(output.page, parent=True),
    script:
        "../scripts/report.py"
