# Needs: validated trees; for each method a folder <repository>/<sequence>/<frame:06d>.{npz,npy,png,exr} of depth maps.
# Makes: results/benchmark/{method}/{repository}/: evaluation, tables as Markdown and Parquet;
#        results/benchmark/{repository}/: all methods side by side as JSON, Markdown, LaTeX and figures.


rule evaluate:
    input:
        sums=rules.assemble.output.sums,
        validation=rules.validate_tree.output.validation,
    output:
        evaluation="results/benchmark/{method}/{repository}/evaluation.json",
        table="results/benchmark/{method}/{repository}/table.md",
        parquet=[
            f"results/benchmark/{{method}}/{{repository}}/{name}.parquet"
            for name in ("frames", "boxes", "distances")
        ],
        report="results/benchmark/{method}/{repository}.report.json",
    log:
        "logs/benchmark/{method}/{repository}.log",
    wildcard_constraints:
        method=one_of(methods_of("depth", "completion")),
        repository=one_of(REPOSITORIES),
    threads: 2
    params:
        cfg=cfg("benchmark", *PROTOCOL),
        code=code("evaluate"),
        method=method_of,
        raw=predictions_fingerprint,
        tree=subpath(input.sums, parent=True),
        out=subpath(output.evaluation, parent=True),
    script:
        "../scripts/evaluate.py"


rule evaluate_odometry:
    input:
        sums=rules.assemble.output.sums,
        validation=rules.validate_tree.output.validation,
    output:
        evaluation="results/benchmark/{method}/{repository}/odometry.json",
        table="results/benchmark/{method}/{repository}/table.md",
        report="results/benchmark/{method}/{repository}.report.json",
    log:
        "logs/benchmark/{method}/{repository}.log",
    wildcard_constraints:
        method=one_of(methods_of("odometry")),
        repository=one_of(REPOSITORIES),
    params:
        cfg=cfg("benchmark", "segment_lengths_m"),
        code=code("evaluate_odometry"),
        method=method_of,
        raw=predictions_fingerprint,
        tree=subpath(input.sums, parent=True),
        out=subpath(output.evaluation, parent=True),
    script:
        "../scripts/evaluate_odometry.py"


rule compare_methods:
    input:
        evaluations=compared_evaluations,
        sums=rules.assemble.output.sums,
    output:
        comparison="results/benchmark/{repository}/comparison.json",
        table="results/benchmark/{repository}/table.md",
        tex="results/benchmark/{repository}/table.tex",
        figure="results/benchmark/{repository}/figures/distance.png",
        report="results/benchmark/{repository}.report.json",
    log:
        "logs/benchmark/{repository}.log",
    wildcard_constraints:
        repository=one_of(REPOSITORIES),
    params:
        cfg=cfg("benchmark", *PROTOCOL),
        code=code("compare_methods"),
        methods=compared_methods,
        tree=subpath(input.sums, parent=True),
        figures=subpath(output.figure, parent=True),
    script:
        "../scripts/compare_methods.py"


rule benchmark:
    input:
        evaluations,
