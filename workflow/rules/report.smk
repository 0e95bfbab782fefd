# Needs: the artifacts and reports of all sequences, the validated trees.
# Makes: results/report/index.html, a page of maps, overlays and quality figures with their gates.


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
