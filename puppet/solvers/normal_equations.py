"""The linear problem inside damped least squares, as kernels: ``(J Jᵀ + λ) y = e``, then ``Jᵀ y``.

J says how the tips move as bones turn. A free bone turns about the armature's three axes; at a
distance (arm) r from one tip and t from another it adds the block ``(r·t) I − t rᵀ`` to J Jᵀ, so
all that is kept of it is its arms. A bounded bone turns as the components of its rotation vector
grow, and what is kept is how each of them moves the tip. Rows of J are scaled by the roots of the
goals' weights.

Shapes: B bones, E effectors, P bones on paths (see `effector_paths.py`).
"""

from __future__ import annotations

import math

from puppet.kernel import Floats, Ints, kernel
from puppet.solvers.joint_limits import FREE


@kernel
def turn_axes(above: Floats, vector: Floats, axes: Floats) -> None:
    """About which axes a bone turns as its rotation vector's components grow.

    above: (4,) armature_from_rest, the bone's rest frame. vector: (3,). axes: (3, 3), a row each,
    in the armature's frame: the columns of the left Jacobian of the exponential.
    """
    x, y, z = vector[0], vector[1], vector[2]
    square = x * x + y * y + z * z
    if square < 1e-8:
        first, second = 0.5, 1.0 / 6.0
    else:
        angle = math.sqrt(square)
        first = (1.0 - math.cos(angle)) / square
        second = (angle - math.sin(angle)) / (square * angle)
    qx, qy, qz, qw = above[0], above[1], above[2], above[3]
    for i in range(3):
        ux, uy, uz = 1.0 * (i == 0), 1.0 * (i == 1), 1.0 * (i == 2)
        cx, cy, cz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
        along = vector[i]
        ax = ux + first * cx + second * (x * along - square * ux)
        ay = uy + first * cy + second * (y * along - square * uy)
        az = uz + first * cz + second * (z * along - square * uz)
        tx, ty, tz = 2.0 * (qy * az - qz * ay), 2.0 * (qz * ax - qx * az), 2.0 * (qx * ay - qy * ax)
        axes[i, 0] = ax + qw * tx + qy * tz - qz * ty
        axes[i, 1] = ay + qw * ty + qz * tx - qx * tz
        axes[i, 2] = az + qw * tz + qx * ty - qy * tx


@kernel
def fill_columns(
    starts: Ints,
    path: Ints,
    kinds: Ints,
    mobile: Ints,
    origins: Floats,
    axes: Floats,
    tips: Floats,
    columns: Floats,
) -> None:
    """Fill `columns`, (P, 3, 3) metres: of a free bone its arm in row 0, else a row for each axis.

    mobile: (B, 3) whether a bone turns about that axis. axes: (B, 3, 3), see `turn_axes`.
    """
    for e in range(len(tips)):
        for k in range(starts[e], starts[e + 1]):
            bone = path[k]
            x = tips[e, 0] - origins[bone, 0]
            y = tips[e, 1] - origins[bone, 1]
            z = tips[e, 2] - origins[bone, 2]
            if kinds[bone] == FREE:
                columns[k, 0, 0], columns[k, 0, 1], columns[k, 0, 2] = x, y, z
                continue
            for i in range(3):
                if mobile[bone, i]:
                    ax, ay, az = axes[bone, i, 0], axes[bone, i, 1], axes[bone, i, 2]
                    columns[k, i, 0] = ay * z - az * y
                    columns[k, i, 1] = az * x - ax * z
                    columns[k, i, 2] = ax * y - ay * x


@kernel
def assemble(
    starts: Ints,
    path: Ints,
    shared: Ints,
    kinds: Ints,
    columns: Floats,
    scale: Floats,
    system: Floats,
) -> None:
    """Fill the lower triangle of `system`, (3E, 3E) = J Jᵀ."""
    for e in range(len(scale)):
        for f in range(e + 1):
            b00, b01, b02 = 0.0, 0.0, 0.0
            b10, b11, b12 = 0.0, 0.0, 0.0
            b20, b21, b22 = 0.0, 0.0, 0.0
            for step in range(shared[e, f]):
                bone = path[starts[e] + step]
                one, other = columns[starts[e] + step], columns[starts[f] + step]
                if kinds[bone] == FREE:
                    r0, r1, r2 = one[0, 0], one[0, 1], one[0, 2]
                    t0, t1, t2 = other[0, 0], other[0, 1], other[0, 2]
                    b00 += r1 * t1 + r2 * t2
                    b11 += r0 * t0 + r2 * t2
                    b22 += r0 * t0 + r1 * t1
                    b01 -= t0 * r1
                    b02 -= t0 * r2
                    b10 -= t1 * r0
                    b12 -= t1 * r2
                    b20 -= t2 * r0
                    b21 -= t2 * r1
                else:
                    for axis in range(3):
                        r0, r1, r2 = one[axis, 0], one[axis, 1], one[axis, 2]
                        t0, t1, t2 = other[axis, 0], other[axis, 1], other[axis, 2]
                        b00 += r0 * t0
                        b01 += r0 * t1
                        b02 += r0 * t2
                        b10 += r1 * t0
                        b11 += r1 * t1
                        b12 += r1 * t2
                        b20 += r2 * t0
                        b21 += r2 * t1
                        b22 += r2 * t2
            both = scale[e] * scale[f]
            i, j = 3 * e, 3 * f
            system[i, j], system[i, j + 1], system[i, j + 2] = both * b00, both * b01, both * b02
            i += 1
            system[i, j], system[i, j + 1], system[i, j + 2] = both * b10, both * b11, both * b12
            i += 1
            system[i, j], system[i, j + 1], system[i, j + 2] = both * b20, both * b21, both * b22


@kernel
def solve(system: Floats, damping: float, values: Floats) -> None:
    """Cholesky of the lower triangle of `system` + damping; `values` become the solution."""
    count = len(values)
    for j in range(count):
        total = system[j, j] + damping
        for k in range(j):
            total -= system[j, k] * system[j, k]
        system[j, j] = math.sqrt(total)
        for i in range(j + 1, count):
            total = system[i, j]
            for k in range(j):
                total -= system[i, k] * system[j, k]
            system[i, j] = total / system[j, j]
    for i in range(count):
        total = values[i]
        for k in range(i):
            total -= system[i, k] * values[k]
        values[i] = total / system[i, i]
    for i in range(count - 1, -1, -1):
        total = values[i]
        for k in range(i + 1, count):
            total -= system[k, i] * values[k]
        values[i] = total / system[i, i]


@kernel
def fill_steps(
    starts: Ints,
    path: Ints,
    kinds: Ints,
    columns: Floats,
    scale: Floats,
    forces: Floats,
    steps: Floats,
) -> None:
    """Fill `steps`, (B, 3) rad = Jᵀ forces.

    A free bone's step is a turn about the armature's axes, a bounded one's is added to its vector.
    """
    for k in range(len(path)):
        for i in range(3):
            steps[path[k], i] = 0.0
    for e in range(len(scale)):
        x, y, z = (
            forces[3 * e] * scale[e],
            forces[3 * e + 1] * scale[e],
            forces[3 * e + 2] * scale[e],
        )
        for k in range(starts[e], starts[e + 1]):
            bone = path[k]
            column = columns[k]
            if kinds[bone] == FREE:
                steps[bone, 0] += column[0, 1] * z - column[0, 2] * y
                steps[bone, 1] += column[0, 2] * x - column[0, 0] * z
                steps[bone, 2] += column[0, 0] * y - column[0, 1] * x
            else:
                for i in range(3):
                    steps[bone, i] += column[i, 0] * x + column[i, 1] * y + column[i, 2] * z


@kernel
def stiffen(path: Ints, stiffness: Floats, values: Floats, by_bone: bool) -> None:
    """Make bones stiff in one direction, in place: ``v - h (h·v)`` over the axes of each.

    stiffness: (B, 3), the direction h, with a length from 0, free, to 1, rigid. values: columns
    (P, 3, 3), or with `by_bone` steps (B, 3, 1). Only of bounded bones.
    """
    for k in range(len(values)):
        h = stiffness[k] if by_bone else stiffness[path[k]]
        if h[0] == 0.0 and h[1] == 0.0 and h[2] == 0.0:
            continue
        for i in range(values.shape[2]):
            along = h[0] * values[k, 0, i] + h[1] * values[k, 1, i] + h[2] * values[k, 2, i]
            for axis in range(3):
                values[k, axis, i] -= h[axis] * along
