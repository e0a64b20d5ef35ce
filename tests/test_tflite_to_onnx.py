from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import tflite
from hypothesis import given
from hypothesis import strategies as st

from puppet.tracking.people import tflite_to_onnx


class Level:
    """One axis of a sparse tensor, with the accessors of the flatbuffer."""

    def __init__(self, *, sparse: bool) -> None:
        kind = tflite.DimensionType
        self.Format = lambda: kind.SPARSE_CSR if sparse else kind.DENSE
        self.ArraySegmentsType = lambda: "ends"
        self.ArrayIndicesType = lambda: "columns"
        self.ArraySegments = self.ArrayIndices = lambda: None


def sparsity(*sparse: bool) -> Any:
    levels = [Level(sparse=value) for value in sparse]
    return SimpleNamespace(
        DimMetadata=levels.__getitem__,
        DimMetadataLength=lambda: len(levels),
        TraversalOrder=lambda i: i,
        TraversalOrderLength=lambda: len(levels),
    )


@given(data=st.data())
def test_sparse_rows_come_out_as_they_went_in(data: st.DataObject) -> None:
    rows, width = data.draw(st.integers(1, 5)), data.draw(st.integers(1, 6))
    cells = st.sampled_from([0.0, 0.0, 1.5, -2.0])
    dense = np.array(
        data.draw(st.lists(cells, min_size=rows * width, max_size=rows * width)), np.float16
    ).reshape(rows, 1, 1, width)
    flat = dense.reshape(rows, width)
    row, columns = np.nonzero(flat)
    indices = {
        "ends": np.searchsorted(row, np.arange(rows + 1)).astype(np.int64),
        "columns": columns.astype(np.int64),
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tflite_to_onnx, "_indices", lambda kind, _table: indices[kind])
        result = tflite_to_onnx._densify(
            flat[row, columns], dense.shape, sparsity(False, False, False, True)
        )
    np.testing.assert_array_equal(result, dense)


def test_other_ways_to_be_sparse_are_refused() -> None:
    with pytest.raises(tflite_to_onnx.UnknownGraphError, match="last axis"):
        tflite_to_onnx._densify(np.zeros(1), (2, 2), sparsity(True, False))
