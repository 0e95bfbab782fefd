"""Hand-made ONNX models in the layout of the YOLOv8 family."""

import hashlib
from pathlib import Path

CELL = 32
"""Side in px of the cells, and of every box, of the model."""


def write_block_detector(path: Path, *, side: int | None = None, shape: str = "good") -> str:
    """Write a model of two classes that finds red and green cells of the image; returns the file's hash.

    side : of an input of one size; None for any. The confidence of a cell is how much more of its colour it
    has than of the others. shape : ``good``; ``rows`` for (1, N, 6); ``logits`` for confidences beyond 1.
    """
    from numpy import array, float32, int64
    from onnx import TensorProto, helper, numpy_helper

    weights = array([[1, -0.5, -0.5], [-0.5, 1, -0.5]], float32).reshape(2, 3, 1, 1)
    constants = {
        "weights": weights * (9 if shape == "logits" else 1),
        "zero": array(0, float32),
        "one": array(1, float32),
        "cell": array(CELL, float32),
        "half": array(CELL / 2, float32),
        "rows_axis": array(2, int64),
        "columns_axis": array(3, int64),
        "flat": array([1, 6, -1], int64),
        "first": array([0], int64),
        "second": array([1], int64),
        "channels": array([1], int64),
    }
    node = helper.make_node
    nodes = [
        node("AveragePool", ["images"], ["cells"], kernel_shape=[CELL, CELL], strides=[CELL, CELL]),
        node("Conv", ["cells", "weights"], ["contrast"]),
        node("Relu", ["contrast"], ["scores"]),
        node("Slice", ["cells", "first", "second", "channels"], ["any"]),
        node("Mul", ["any", "zero"], ["zeros"]),
        node("Add", ["zeros", "one"], ["ones"]),
        node("CumSum", ["ones", "columns_axis"], ["columns"]),
        node("CumSum", ["ones", "rows_axis"], ["rows"]),
        node("Mul", ["columns", "cell"], ["right"]),
        node("Mul", ["rows", "cell"], ["bottom"]),
        node("Sub", ["right", "half"], ["x"]),
        node("Sub", ["bottom", "half"], ["y"]),
        node("Mul", ["ones", "cell"], ["extent"]),
        node("Concat", ["x", "y", "extent", "extent", "scores"], ["stacked"], axis=1),
        node("Reshape", ["stacked", "flat"], ["output0" if shape != "rows" else "columns_of"]),
    ]
    if shape == "rows":
        nodes.append(node("Transpose", ["columns_of"], ["output0"], perm=[0, 2, 1]))
    sides = [side, side] if side else ["height", "width"]
    graph = helper.make_graph(
        nodes,
        "blocks",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, *sides])],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, None)],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path.write_bytes(model.SerializeToString())
    return hashlib.sha256(path.read_bytes()).hexdigest()
