# Needs: anonymized images, labels, the sample of frames with irregularities, a user's detector.
# Makes: results/{id}/detections/, what people made of them, and results/annotations/, how consistent labels are.


rule detections:
    input:
        images=rules.privacy.output.images,
        frames=rules.ingest.output.frames,
    output:
        detections="results/{id}/detections/{way}.parquet",
        report="results/{id}/detections/{way}.report.json",
    log:
        "logs/{id}/detections-{way}.log",
    wildcard_constraints:
        way="random|grouped",
    params:
        cfg=cfg("proposals", "least_confidence", "nms_iou"),
        code=code("detections"),
        sample=SETTINGS["proposals"]["sample"],
        rows=sample_rows,
        detector=lambda wildcards: SETTINGS["proposals"]["detectors"][wildcards.way],
    script:
        "../scripts/detections.py"


rule proposal_review:
    input:
        detections=rules.detections.output.detections,
        detections_report=rules.detections.output.report,
        labels=rules.annotations.output.labels,
        label_states=rules.annotations.output.label_states,
        ingest_report=rules.ingest.output.report,
    output:
        review="results/{id}/detections/{way}-review.parquet",
        report="results/{id}/detections/{way}-review.report.json",
    log:
        "logs/{id}/proposal_review-{way}.log",
    params:
        cfg=cfg("proposals", "proposal_confidence", "moved_iou", "same_px"),
        code=code("proposal_review"),
        rows=sample_rows,
    script:
        "../scripts/proposal_review.py"


rule consistency:
    input:
        detections=lambda wildcards: sampled_outputs(rules.detections, wildcards.way),
        labels=lambda wildcards: sampled_outputs(rules.annotations, wildcards.way),
    output:
        scores="results/annotations/consistency-{way}.json",
        table="results/annotations/consistency-{way}.md",
        report="results/annotations/consistency-{way}.report.json",
    log:
        "logs/annotations/consistency-{way}.log",
    params:
        cfg=cfg("proposals", "near_frames"),
        code=code("consistency"),
        classes=SETTINGS["annotations"]["classes"],
        sample=SETTINGS["proposals"]["sample"],
        rows=lambda wildcards: [asdict(row) for row in sampled()],
        results=subpath(output.scores, ancestor=2),
    script:
        "../scripts/consistency.py"


rule proposals:
    input:
        proposals_of_all,


rule label_consistency:
    input:
        lambda wildcards: expand(rules.consistency.output.table, way=detectors()),
