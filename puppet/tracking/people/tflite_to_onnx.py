"""TensorFlow Lite -> ONNX, for the operators that the pose models use, without TensorFlow.

TFLite keeps images as (batch, height, width, channel), ONNX as (batch, channel, height, width). The
graph is turned once at its inputs: from there every four-dimensional value is channel-first, and
it is turned back only where a reshape or an output looks at the order of its numbers. Weights are
half floats, some of them sparse; they are widened here, so no trace of either is left.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import onnx
import tflite
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

#: Asks ONNX Runtime for nothing newer than version 1.8.
OPSET: Final = 13
IR_VERSION: Final = 8
TO_CHANNELS_FIRST: Final = (0, 3, 1, 2)
TO_CHANNELS_LAST: Final = (0, 2, 3, 1)

_OPERATOR_NAMES: Final = {
    code: name for name, code in vars(tflite.BuiltinOperator).items() if isinstance(code, int)
}
_DTYPES: Final = {
    tflite.TensorType.FLOAT32: np.float32,
    tflite.TensorType.FLOAT16: np.float16,
    tflite.TensorType.INT32: np.int32,
}
_INDEX_VECTORS: Final = {
    tflite.SparseIndexVector.Int32Vector: tflite.Int32Vector,
    tflite.SparseIndexVector.Uint16Vector: tflite.Uint16Vector,
    tflite.SparseIndexVector.Uint8Vector: tflite.Uint8Vector,
}

Array = NDArray[Any]


class UnknownGraphError(ValueError):
    """The graph uses something that this converter does not know."""


def tflite_to_onnx(data: bytes, outputs: Mapping[str, str]) -> bytes:
    """Convert the graph in `data`; the same bytes in give the same bytes out.

    outputs: TFLite output name -> ONNX output name; whatever only other outputs need is left out.
    Values at the graph's inputs and outputs keep their TFLite shape. Raises UnknownGraphError.
    """
    model = _Converter(data).convert(outputs)
    onnx.checker.check_model(model)
    serialized: bytes = model.SerializeToString(deterministic=True)
    return serialized


class _Converter:
    """One pass over the operators. A value is known by its TFLite number all along."""

    def __init__(self, data: bytes) -> None:
        self._model = tflite.Model.GetRootAsModel(data, 0)
        self._graph = self._model.Subgraphs(0)
        tensors = [self._graph.Tensors(i) for i in range(self._graph.TensorsLength())]
        self._shapes = [_shape(tensor) for tensor in tensors]
        self._constants: dict[int, Array] = {}
        for i, tensor in enumerate(tensors):
            if self._model.Buffers(tensor.Buffer()).DataLength():
                self._constants[i] = self._read_constant(tensor)
        self._nodes: list[onnx.NodeProto] = []
        self._initializers: list[onnx.TensorProto] = []

    def convert(self, outputs: Mapping[str, str]) -> onnx.ModelProto:
        graph = self._graph
        inputs = []
        for i in graph.InputsAsNumpy().tolist():
            name = graph.Tensors(i).Name().decode()
            inputs.append(_value_info(name, self._shapes[i]))
            self._add("Transpose", [name], _name(i), perm=TO_CHANNELS_FIRST)
        for k in range(graph.OperatorsLength()):
            self._convert_operator(graph.Operators(k))
        results = []
        found = {graph.Tensors(i).Name().decode(): i for i in graph.OutputsAsNumpy().tolist()}
        for theirs, ours in outputs.items():
            if theirs not in found:
                raise UnknownGraphError(f"no output {theirs!r}; there are {sorted(found)}")
            i = found[theirs]
            results.append(_value_info(ours, self._shapes[i]))
            self._add("Identity", [self._as_stored(i)], ours)
        nodes, initializers = self._needed(set(outputs.values()))
        return helper.make_model(
            helper.make_graph(nodes, "pose", inputs, results, initializers),
            opset_imports=[helper.make_opsetid("", OPSET)],
            ir_version=IR_VERSION,
            producer_name="puppet",
        )

    # Constants

    def _read_constant(self, tensor: Any) -> Array:
        dtype = _DTYPES.get(tensor.Type())
        if dtype is None:
            raise UnknownGraphError(f"tensor type {tensor.Type()} of {tensor.Name().decode()!r}")
        values: Array = self._model.Buffers(tensor.Buffer()).DataAsNumpy().view(dtype)
        if tensor.Sparsity() is not None:
            return _densify(values, _shape(tensor), tensor.Sparsity())
        return values.reshape(_shape(tensor))

    def _constant(self, values: Array, name: str) -> str:
        """`values` as an ONNX initializer: half floats become floats, integers 64 bits wide."""
        wide = np.float32 if values.dtype.kind == "f" else np.int64
        array = np.ascontiguousarray(values, dtype=wide)
        self._initializers.append(numpy_helper.from_array(array, name))
        return name

    # Values

    def _as_stored(self, i: int) -> str:
        """The ONNX name of value `i` with its numbers in TFLite's order."""
        name = _name(i)
        if len(self._shapes[i]) != 4:
            return name
        self._add("Transpose", [name], f"{name}_last", perm=TO_CHANNELS_LAST)
        return f"{name}_last"

    def _add(self, kind: str, inputs: list[str], output: str, **attributes: Any) -> None:
        self._nodes.append(helper.make_node(kind, inputs, [output], **attributes))

    def _add_activated(
        self, kind: str, inputs: list[str], target: int, activation: int, **attributes: Any
    ) -> None:
        """A node that gives value `target`, with TFLite's fused activation after it."""
        name = _name(target)
        if activation == tflite.ActivationFunctionType.NONE:
            self._add(kind, inputs, name, **attributes)
            return
        linear = f"{name}_linear"
        self._add(kind, inputs, linear, **attributes)
        if activation == tflite.ActivationFunctionType.RELU:
            self._add("Relu", [linear], name)
        elif activation == tflite.ActivationFunctionType.RELU6:
            low = self._constant(np.array(0.0), f"{name}_low")
            high = self._constant(np.array(6.0), f"{name}_high")
            self._add("Clip", [linear, low, high], name)
        else:
            raise UnknownGraphError(f"activation {activation}")

    # Operators

    def _convert_operator(self, operator: Any) -> None:
        code = self._model.OperatorCodes(operator.OpcodeIndex())
        kind = _OPERATOR_NAMES[max(code.BuiltinCode(), code.DeprecatedBuiltinCode())]
        sources = operator.InputsAsNumpy().tolist()
        (target,) = operator.OutputsAsNumpy().tolist()
        match kind:
            case "DEQUANTIZE" | "DENSIFY":
                self._constants[target] = self._constants[sources[0]]
            case "CONV_2D":
                options = _options(operator, tflite.Conv2DOptions)
                # (out, height, width, in) -> (out, in, height, width)
                self._convolve(sources, target, options, TO_CHANNELS_FIRST, groups=1)
            case "DEPTHWISE_CONV_2D":
                options = _options(operator, tflite.DepthwiseConv2DOptions)
                channels = self._shapes[sources[0]][3]
                # (1, height, width, out) -> (out, 1, height, width)
                self._convolve(sources, target, options, (3, 0, 1, 2), groups=channels)
            case "ADD":
                options = _options(operator, tflite.AddOptions)
                fused = options.FusedActivationFunction()
                self._add_activated("Add", [_name(i) for i in sources], target, fused)
            case "PAD":
                # ((before, after) of each axis, TFLite's order) -> all befores, then all afters
                pads = self._constants[sources[1]][list(TO_CHANNELS_FIRST)].T.ravel()
                amount = self._constant(pads, f"{_name(target)}_pads")
                self._add("Pad", [_name(sources[0]), amount], _name(target))
            case "MAX_POOL_2D":
                options = _options(operator, tflite.Pool2DOptions)
                kernel = (options.FilterHeight(), options.FilterWidth())
                window = self._window(sources[0], kernel, (1, 1), options)
                fused = options.FusedActivationFunction()
                self._add_activated("MaxPool", [_name(sources[0])], target, fused, **window)
            case "RESIZE_BILINEAR":
                self._resize(sources[0], target, _options(operator, tflite.ResizeBilinearOptions))
            case "DEPTH_TO_SPACE":
                size = _options(operator, tflite.DepthToSpaceOptions).BlockSize()
                self._add("DepthToSpace", [_name(sources[0])], _name(target), blocksize=size)
            case "RESHAPE" if len(self._shapes[target]) != 4:
                shape = self._constant(np.array(self._shapes[target]), f"{_name(target)}_shape")
                self._add("Reshape", [self._as_stored(sources[0]), shape], _name(target))
            case "CONCATENATION" if len(self._shapes[target]) != 4:
                axis = _options(operator, tflite.ConcatenationOptions).Axis()
                self._add("Concat", [_name(i) for i in sources], _name(target), axis=axis)
            case "LOGISTIC":
                self._add("Sigmoid", [_name(sources[0])], _name(target))
            case _:
                raise UnknownGraphError(f"operator {kind} that gives {self._shapes[target]}")

    def _convolve(
        self, sources: list[int], target: int, options: Any, order: tuple[int, ...], groups: int
    ) -> None:
        image, weights, bias = sources
        kernel = self._constants[weights].transpose(order)
        dilation = (options.DilationHFactor(), options.DilationWFactor())
        inputs = [
            _name(image),
            self._constant(kernel, f"{_name(target)}_weights"),
            self._constant(self._constants[bias], f"{_name(target)}_bias"),
        ]
        window = self._window(image, kernel.shape[2:], dilation, options)
        window.update(dilations=dilation, group=groups)
        fused = options.FusedActivationFunction()
        self._add_activated("Conv", inputs, target, fused, **window)

    def _window(
        self, source: int, kernel: tuple[int, ...], dilation: tuple[int, int], options: Any
    ) -> dict[str, Any]:
        """Kernel, strides and padding of a sliding window, as ONNX attributes."""
        strides = (options.StrideH(), options.StrideW())
        before, after = [0, 0], [0, 0]
        if options.Padding() == tflite.Padding.SAME:
            for axis in range(2):
                length = self._shapes[source][1 + axis]
                reach = (kernel[axis] - 1) * dilation[axis] + 1
                count = -(-length // strides[axis])
                total = max((count - 1) * strides[axis] + reach - length, 0)
                before[axis], after[axis] = total // 2, total - total // 2
        return {"kernel_shape": kernel, "strides": strides, "pads": before + after}

    def _resize(self, source: int, target: int, options: Any) -> None:
        if options.AlignCorners():
            mode = "align_corners"
        elif options.HalfPixelCenters():
            mode = "half_pixel"
        else:
            mode = "asymmetric"
        shape = np.array(self._shapes[target])[list(TO_CHANNELS_FIRST)]
        sizes = self._constant(shape, f"{_name(target)}_sizes")
        self._add(
            "Resize",
            [_name(source), "", "", sizes],
            _name(target),
            mode="linear",
            coordinate_transformation_mode=mode,
        )

    def _needed(self, names: set[str]) -> tuple[list[onnx.NodeProto], list[onnx.TensorProto]]:
        """The nodes and initializers on which the values `names` depend, in their order."""
        nodes = []
        for node in reversed(self._nodes):
            if names.intersection(node.output):
                nodes.append(node)
                names = names.union(node.input)
        return nodes[::-1], [value for value in self._initializers if value.name in names]


def _name(i: int) -> str:
    return f"v{i}"


def _shape(tensor: Any) -> tuple[int, ...]:
    return tuple(tensor.ShapeAsNumpy().tolist()) if tensor.ShapeLength() else ()


def _value_info(name: str, shape: tuple[int, ...]) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, list(shape))


def _options(operator: Any, kind: type[Any]) -> Any:
    table = operator.BuiltinOptions()
    options = kind()
    options.Init(table.Bytes, table.Pos)
    return options


def _densify(values: Array, shape: tuple[int, ...], sparsity: Any) -> Array:
    """Compressed sparse rows over the last axis -> a full array. TFLite allows far more than that,
    but the pose models use nothing else."""
    levels = [sparsity.DimMetadata(i) for i in range(sparsity.DimMetadataLength())]
    sparse = [level.Format() == tflite.DimensionType.SPARSE_CSR for level in levels]
    order = [sparsity.TraversalOrder(i) for i in range(sparsity.TraversalOrderLength())]
    if sparse != [False] * (len(shape) - 1) + [True] or order != list(range(len(shape))):
        raise UnknownGraphError("sparse weights that are not compressed along their last axis")
    row_ends = _indices(levels[-1].ArraySegmentsType(), levels[-1].ArraySegments())
    columns = _indices(levels[-1].ArrayIndicesType(), levels[-1].ArrayIndices())
    dense = np.zeros((len(row_ends) - 1, shape[-1]), values.dtype)
    dense[np.repeat(np.arange(len(dense)), row_ends[1:] - row_ends[:-1]), columns] = values
    return dense.reshape(shape)


def _indices(kind: int, table: Any) -> NDArray[np.int64]:
    vector = _INDEX_VECTORS[kind]()
    vector.Init(table.Bytes, table.Pos)
    return np.asarray(vector.ValuesAsNumpy(), np.int64)
