# From raw drives to licensed, anonymized, validated release trees.
#
#   snakemake release --cores 2           build and validate all trees (the default)
#   snakemake validate --cores 2          the same without the rest of the embedded input
#   snakemake report --cores 2            a page of maps, overlays and quality figures
#   snakemake benchmark --cores 2         evaluate predictions on the release
#   snakemake proposals --cores 2         let your detector propose labels, and compare them with the reviewed ones
#   snakemake label_consistency --cores 2   how well that detector repeats the labels
#   snakemake upload --cores 2            what an upload would do; with --config send=true do it
#   snakemake assign_splits --cores 2     give new sequences their rows in the splits ledger
#   snakemake assign_batches --cores 2    move sequences that do not fit into further repositories
from snakemake.utils import min_version

min_version("9.27")


configfile: "config/config.yaml"


include: "workflow/rules/days.smk"
include: "workflow/rules/common.smk"
include: "workflow/rules/sequences.smk"
include: "workflow/rules/repositories.smk"
include: "workflow/rules/simulation.smk"
include: "workflow/rules/ingest.smk"
include: "workflow/rules/sessions.smk"
include: "workflow/rules/calibration.smk"
include: "workflow/rules/poses.smk"
include: "workflow/rules/ground_truth.smk"
include: "workflow/rules/wheels.smk"
include: "workflow/rules/annotations.smk"
include: "workflow/rules/privacy.smk"
include: "workflow/rules/irregularities.smk"
include: "workflow/rules/proposals.smk"
include: "workflow/rules/splits.smk"
include: "workflow/rules/packaging.smk"
include: "workflow/rules/upload.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/benchmark.smk"


# They write into the configuration or to the Hub, or only show: not for a node of a cluster.
localrules:
    assign_splits,
    assign_batches,
    upload,


rule release:
    default_target: True
    input:
        validations(),
        rules.firewall.output,
        rules.split_lists.output,
        simulated_days(),


onstart:
    check_space()


onsuccess:
    print_summary()


onerror:
    print_failure()
