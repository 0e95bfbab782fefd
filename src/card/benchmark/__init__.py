"""Evaluation of depth predictions on a release."""

from card.benchmark.evaluate import evaluate

__all__ = ["evaluate"]
