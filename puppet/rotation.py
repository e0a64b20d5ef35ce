"""Unit quaternions, ``xyzw`` (as in SciPy, glTF and VMC), as kernels on flat arrays.

``q`` and ``-q`` are the same rotation, but not the same quaternion: `log` gives angles up to 2π,
so a rotation built from factors that each keep ``w > 0`` passes 180° without a jump. `shortest`
picks the representative that is nearest to the identity where that is wanted instead.
"""

from __future__ import annotations

import math

import numpy as np

from puppet.kernel import Floats, kernel

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
IDENTITY.setflags(write=False)


@kernel
def multiply(a: Floats, b: Floats) -> Floats:
    """The rotation that does `b` first, then `a`. (4,), (4,) -> (4,)"""
    out = np.empty(4)
    out[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1]
    out[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0]
    out[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3]
    out[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]
    return out


@kernel
def conjugate(q: Floats) -> Floats:
    """The opposite rotation. (4,) -> (4,)"""
    out = np.empty(4)
    out[0], out[1], out[2], out[3] = -q[0], -q[1], -q[2], q[3]
    return out


@kernel
def rotate(q: Floats, v: Floats) -> Floats:
    """`v` turned by `q`. (4,), (3,) -> (3,)"""
    tx = 2.0 * (q[1] * v[2] - q[2] * v[1])
    ty = 2.0 * (q[2] * v[0] - q[0] * v[2])
    tz = 2.0 * (q[0] * v[1] - q[1] * v[0])
    out = np.empty(3)
    out[0] = v[0] + q[3] * tx + q[1] * tz - q[2] * ty
    out[1] = v[1] + q[3] * ty + q[2] * tx - q[0] * tz
    out[2] = v[2] + q[3] * tz + q[0] * ty - q[1] * tx
    return out


@kernel
def normalized(q: Floats) -> Floats:
    """`q` scaled to length 1; the identity where it has no length. (4,) -> (4,)"""
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    out = np.empty(4)
    if length < 1e-12:
        out[0], out[1], out[2], out[3] = 0.0, 0.0, 0.0, 1.0
        return out
    for i in range(4):
        out[i] = q[i] / length
    return out


@kernel
def shortest(q: Floats) -> Floats:
    """The representative with ``w >= 0``. (4,) -> (4,)"""
    out = np.empty(4)
    sign = 1.0 if q[3] >= 0.0 else -1.0
    for i in range(4):
        out[i] = sign * q[i]
    return out


@kernel
def log(q: Floats) -> Floats:
    """Rotation vector (axis × angle) of `q`, angle in [0, 2π), rad. (4,) -> (3,)"""
    sine = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    factor = 2.0 * math.atan2(sine, q[3]) / sine if sine > 1e-9 else 2.0
    out = np.empty(3)
    for i in range(3):
        out[i] = q[i] * factor
    return out


@kernel
def exp(v: Floats) -> Floats:
    """The rotation about `v` by its length in radians. (3,) -> (4,)"""
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    factor = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    out = np.empty(4)
    for i in range(3):
        out[i] = v[i] * factor
    out[3] = math.cos(0.5 * angle)
    return out


@kernel
def swing(start: Floats, end: Floats) -> Floats:
    """The shortest rotation that turns direction `start` into `end`; ``w >= 0``.

    (3,), (3,) -> (4,). Lengths do not matter; a direction without length gives the identity. For
    opposite directions it is a half turn about some axis square to `start`.
    """
    out = np.empty(4)
    ls = math.sqrt(start[0] ** 2 + start[1] ** 2 + start[2] ** 2)
    le = math.sqrt(end[0] ** 2 + end[1] ** 2 + end[2] ** 2)
    if ls < 1e-9 or le < 1e-9:
        out[0], out[1], out[2], out[3] = 0.0, 0.0, 0.0, 1.0
        return out
    ax, ay, az = start[0] / ls, start[1] / ls, start[2] / ls
    bx, by, bz = end[0] / le, end[1] / le, end[2] / le
    w = 1.0 + ax * bx + ay * by + az * bz
    if w < 1e-9:
        if abs(ax) < 0.6:
            out[0], out[1], out[2] = 0.0, az, -ay
        else:
            out[0], out[1], out[2] = -az, 0.0, ax
        out[3] = 0.0
        return normalized(out)
    out[0] = ay * bz - az * by
    out[1] = az * bx - ax * bz
    out[2] = ax * by - ay * bx
    out[3] = w
    return normalized(out)


@kernel
def from_axes(x: Floats, y: Floats, z: Floats) -> Floats:
    """The rotation whose matrix has the unit, right-handed columns x, y, z; ``w >= 0``.

    (3,), (3,), (3,) -> (4,)
    """
    out = np.empty(4)
    trace = x[0] + y[1] + z[2]
    if trace > 0.0:
        s = 2.0 * math.sqrt(trace + 1.0)
        out[0] = (y[2] - z[1]) / s
        out[1] = (z[0] - x[2]) / s
        out[2] = (x[1] - y[0]) / s
        out[3] = 0.25 * s
    elif x[0] > y[1] and x[0] > z[2]:
        s = 2.0 * math.sqrt(max(1.0 + x[0] - y[1] - z[2], 1e-18))
        out[0] = 0.25 * s
        out[1] = (y[0] + x[1]) / s
        out[2] = (z[0] + x[2]) / s
        out[3] = (y[2] - z[1]) / s
    elif y[1] > z[2]:
        s = 2.0 * math.sqrt(max(1.0 + y[1] - x[0] - z[2], 1e-18))
        out[0] = (y[0] + x[1]) / s
        out[1] = 0.25 * s
        out[2] = (z[1] + y[2]) / s
        out[3] = (z[0] - x[2]) / s
    else:
        s = 2.0 * math.sqrt(max(1.0 + z[2] - x[0] - y[1], 1e-18))
        out[0] = (z[0] + x[2]) / s
        out[1] = (z[1] + y[2]) / s
        out[2] = 0.25 * s
        out[3] = (x[1] - y[0]) / s
    return shortest(normalized(out))


@kernel
def slerp(a: Floats, b: Floats, t: float) -> Floats:
    """From `a` (t = 0) to `b` (t = 1) the short way round, at constant speed. -> (4,)"""
    step = log(shortest(multiply(b, conjugate(a))))
    return normalized(multiply(exp(step * t), a))
