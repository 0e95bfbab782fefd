"""The assisted labelling loop: sample, export, propose, review (paper, supplement, Annotation Pipeline)."""
