"""A user's own ONNX detector, for every stage that looks for things in images."""

from card.detection.boxes import Found
from card.detection.onnx import OnnxDetector

__all__ = ["Found", "OnnxDetector"]
