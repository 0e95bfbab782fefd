"""A detector in ONNX with the output of the YOLOv8 family: (1, 4 + classes, N), boxes as centre and size."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import sha256_file
from card.detection.boxes import Found, as_found, keep_best
from card.detection.views import STRIDE, View, letterbox, native, tiles
from card.errors import CardError

UNUSED = "-"


class OnnxDetector:
    """Finds things in images with a user's model.

    Parameters
    ----------
    model : the ONNX file; its input is (1, 3, H, W) float32 RGB in 0..1.
    sha256 : hash that the file must have.
    classes : what each class of the model is called here, in the order of its ids; ``-`` leaves one out.
    settings : ``input`` (``native``, ``letterbox`` or ``tiles``), ``size_px`` and ``overlap_px`` of the
        latter two, ``confidence`` (a box below is dropped), ``nms_iou`` (of two above, the lesser is).
    threads : of the runtime.

    Raises
    ------
    CardError
        For a missing file, another hash, no ONNX, or an input or output of another shape.
    """

    def __init__(
        self,
        model: Path,
        *,
        sha256: str,
        classes: Sequence[str],
        settings: Mapping[str, Any],
        threads: int = 1,
    ) -> None:
        self.name = model.name
        self.version = sha256
        self._model = model
        self._classes = list(classes)
        self._settings = settings
        self._session = _session(model, sha256, threads)
        self._check_input()

    def detect(self, image: NDArray[np.uint8]) -> list[Found]:
        """Boxes in ``image``, (H, W, 3) uint8 RGB, the surest first; the same image gives the same boxes."""
        parts = [self._detect(view) for view in self._views(image)]
        edges, scores, classes = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        height, width = image.shape[:2]
        edges = np.clip(edges, 0.0, [width, height, width, height])
        used = (edges[:, 2] > edges[:, 0]) & (edges[:, 3] > edges[:, 1])
        edges, scores, classes = edges[used], scores[used], classes[used]
        kept = keep_best(edges, scores, classes, self._settings["nms_iou"])
        return as_found(edges[kept], scores[kept], classes[kept], self._classes)

    def _views(self, image: NDArray[np.uint8]) -> Iterator[View]:
        kind, size = self._settings["input"], self._settings["size_px"]
        if kind == "native":
            yield native(image)
        elif kind == "letterbox":
            yield letterbox(image, size)
        else:
            yield from tiles(image, size, self._settings["overlap_px"])

    def _detect(self, view: View) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        pixels = np.ascontiguousarray(view.pixels.transpose(2, 0, 1)[None], dtype=np.float32) / 255
        try:
            outputs = self._session.run(None, {self._session.get_inputs()[0].name: pixels})
        except Exception as error:
            raise CardError("model cannot run", where=self._model, found=_first_line(error)) from error
        rows = self._rows(outputs)
        scores = rows[:, 4:]
        classes = scores.argmax(axis=1)
        best = scores[np.arange(len(rows)), classes]
        named = np.array([name != UNUSED for name in self._classes])
        kept = (best >= self._settings["confidence"]) & named[classes]
        centre, half = rows[kept, :2], rows[kept, 2:4] / 2
        edges = view.to_image(np.concatenate([centre - half, centre + half], axis=1))
        return edges, best[kept], classes[kept]

    def _rows(self, outputs: Sequence[Any]) -> NDArray[np.float64]:
        """The one output as (N, 4 + classes)."""
        wanted = (1, 4 + len(self._classes), "N")
        shape = np.shape(outputs[0])
        if len(outputs) != 1 or len(shape) != 3 or shape[:2] != wanted[:2]:
            found = [np.shape(output) for output in outputs]
            raise CardError(
                "model has another output", where=self._model, found=found, wanted=f"one of {wanted}"
            )
        rows: NDArray[np.float64] = np.asarray(outputs[0][0].T, dtype=np.float64)
        if not np.isfinite(rows).all():
            raise CardError("model returns numbers that are not finite", where=self._model)
        if rows.size and not (rows[:, 4:].min() >= 0 and rows[:, 4:].max() <= 1):
            raise CardError(
                "model returns no confidences",
                where=self._model,
                found=f"{rows[:, 4:].min():.3g} to {rows[:, 4:].max():.3g}",
                wanted="0 to 1",
            )
        return rows

    def _check_input(self) -> None:
        inputs = self._session.get_inputs()
        shape = inputs[0].shape
        if len(inputs) != 1 or len(shape) != 4 or shape[1] != 3 or inputs[0].type != "tensor(float)":
            found = [(one.type, one.shape) for one in inputs]
            raise CardError(
                "model has another input", where=self._model, found=found, wanted="float (1, 3, H, W)"
            )
        kind, size = self._settings["input"], self._settings["size_px"]
        if kind == "native" and any(isinstance(side, int) for side in shape[2:]):
            raise CardError(
                "model takes images of one size only",
                where=self._model,
                found=shape,
                wanted="free height and width, or input letterbox or tiles",
            )
        if kind != "native" and size % STRIDE:
            raise CardError(
                "side of the input is no multiple", where=self._model, found=size, wanted=f"{STRIDE} k"
            )
        if kind != "native" and any(isinstance(side, int) and side != size for side in shape[2:]):
            raise CardError("model takes another size", where=self._model, found=shape[2:], wanted=size)


def _providers() -> list[str]:
    """A GPU's execution provider where the installed runtime has one, then the CPU's."""
    import onnxruntime

    there = onnxruntime.get_available_providers()
    return [name for name in ("CUDAExecutionProvider", "CPUExecutionProvider") if name in there]


def open_session(model: str | bytes, where: object, threads: int) -> Any:
    """An onnxruntime session of a file or its content, on the best provider there is.

    Raises
    ------
    CardError
        If it is no ONNX; ``where`` names the model.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4  # errors are raised
    try:
        return onnxruntime.InferenceSession(model, options, providers=_providers())
    except Exception as error:
        raise CardError("model is no ONNX", where=where, found=_first_line(error)) from error


def _session(model: Path, sha256: str, threads: int) -> Any:
    if not model.is_file():
        raise CardError("model is missing", where=model)
    if (found := sha256_file(model)) != sha256:
        raise CardError("model has another hash", where=model, found=found, wanted=sha256)
    return open_session(str(model), model, threads)


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0][:160]
