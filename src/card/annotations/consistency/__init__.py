"""How well a detector repeats the labels: the measure of how consistently they were drawn."""
