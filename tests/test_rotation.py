"""Quaternions against SciPy, and the promises that the drive rests on."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet import rotation
from tests.armatures import quaternions

vectors = st.tuples(*[st.floats(-3, 3, allow_subnormal=False)] * 3).map(np.array)


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two quaternions are the same rotation."""
    return bool(abs(abs(float(a @ b)) - 1.0) < 1e-9)


@given(quaternions(), quaternions(), vectors)
def test_products_and_turned_vectors_agree_with_scipy(
    a: np.ndarray, b: np.ndarray, v: np.ndarray
) -> None:
    product = Rotation.from_quat(a) * Rotation.from_quat(b)
    assert same(rotation.multiply(a, b), product.as_quat())
    np.testing.assert_allclose(rotation.rotate(a, v), Rotation.from_quat(a).apply(v), atol=1e-9)
    np.testing.assert_allclose(
        rotation.rotate(rotation.conjugate(a), rotation.rotate(a, v)), v, atol=1e-9
    )


@given(quaternions())
def test_exp_undoes_log_and_keeps_the_sign(q: np.ndarray) -> None:
    np.testing.assert_allclose(rotation.exp(rotation.log(q)), q, atol=1e-9)


def test_log_passes_the_half_turn_without_a_jump() -> None:
    angles = np.linspace(3.0, 3.3, 50)
    quarter = rotation.exp(np.array([0.0, 0.0, np.pi / 2]))
    logs = [
        rotation.log(rotation.multiply(rotation.exp(np.array([0.0, 0.0, a - np.pi / 2])), quarter))
        for a in angles
    ]
    np.testing.assert_allclose([v[2] for v in logs], angles, atol=1e-9)


@given(vectors, vectors)
def test_a_swing_brings_the_first_direction_to_the_second(a: np.ndarray, b: np.ndarray) -> None:
    if np.linalg.norm(a) < 1e-3 or np.linalg.norm(b) < 1e-3:
        np.testing.assert_allclose(rotation.swing(a * 0, b), rotation.IDENTITY)
        return
    turned = rotation.rotate(rotation.swing(a, b), a / np.linalg.norm(a))
    np.testing.assert_allclose(turned, b / np.linalg.norm(b), atol=1e-4)


@given(vectors)
def test_a_swing_to_the_opposite_is_still_a_rotation(a: np.ndarray) -> None:
    if np.linalg.norm(a) < 1e-3:
        return
    np.testing.assert_allclose(rotation.rotate(rotation.swing(a, -a), a), -a, atol=1e-6)


@given(quaternions())
def test_axes_of_a_rotation_give_the_rotation_back(q: np.ndarray) -> None:
    x, y, z = (np.ascontiguousarray(axis) for axis in Rotation.from_quat(q).as_matrix().T)
    assert same(rotation.from_axes(x, y, z), q)


@given(quaternions(), quaternions(), st.floats(0, 1))
def test_slerp_goes_the_short_way_at_constant_speed(a: np.ndarray, b: np.ndarray, t: float) -> None:
    whole = (Rotation.from_quat(b) * Rotation.from_quat(a).inv()).magnitude()
    part = (Rotation.from_quat(rotation.slerp(a, b, t)) * Rotation.from_quat(a).inv()).magnitude()
    assert abs(part - t * whole) < 1e-6
