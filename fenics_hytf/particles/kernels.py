# SPDX-License-Identifier: MIT
"""Compiled kernels: Newton's inverse of a cell's map, and the search for the cell of a point.

A cell's map x(ξ) = Σ N_i(ξ) X_i is kept in *normalised* coordinates, centred on the cell and
divided by the Jacobian J_c at its centre: with η = ξ - ξ_c and y = J_c⁻¹ (x - x(ξ_c)),

    y(η) = η + Σ_k c_k m_k(η),        m_k the non-linear monomials of the element,

which has no unit, no position, no orientation and no aspect ratio left in it. Affine cells have no
c_k at all. Two-dimensional cells ride along with a third coordinate that is 0 everywhere.

Newton's method solves g(η) = y(η) - y = 0, from the centre, by J δ = -g, η ← η + t δ. A step of
length t is halved until the residual stays in a cone about the straight line to its target,

    |g(η + tδ) - (1 - t) g(η)| ≤ ½ t |g(η)|   and   det J(η + tδ) > 0,

an affine-covariant form of the monotonicity tests of Deuflhard, "Newton Methods for Nonlinear
Problems" (2004), ch. 3. The iterates then follow the preimage of the segment from the cell's centre
to the point. In a convex straight-sided quadrilateral that segment stays in the cell, and no two
places with det J > 0 have the same image: the root found is the right one, and where there is none
the point is outside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

INSIDE, OUTSIDE, UNKNOWN = 0, 1, 2

LAST_STEP = 1e-8  # a step this short leaves a residual of its square: below rounding
ROUNDING = 1e-14  # no residual of coordinates of size one is reliably below this
SHORTEST = 2.0**-12  # steps are not halved further: there is no preimage on this side of det J = 0
MAX_ITERATIONS = 60
MAX_WIDENED = 1e-6  # largest tolerance that a small det J can ask for
NEAR = 1e-4  # a point this near to its cell's boundary may be another cell's: all are asked
WALK = 4  # cells walked through before the tree is asked; a tree query costs about as much
STACK = 128  # of the tree's descent: one node a level waits, and levels <= 64


class CellMaps(NamedTuple):
    """Normalised maps of n cells; see the module. K non-linear monomials, F facets, S starts.

    Only the kernels that run over all points take it whole: numba counts a reference to every
    array of a tuple whenever one is handed on, which cost more than Newton's method.
    """

    frames: npt.NDArray[np.float64]  # x_0 [m], rows of J_c⁻¹ [1/m], J_c⁻¹(x(ξ_c) - x_0): (n, 5, 3)
    coefficients: npt.NDArray[np.float64]  # c_k, shape (n, K, 3)
    boxes: npt.NDArray[np.float64]  # lowest and highest y of the cell, shape (n, 2, 3)
    tolerances: npt.NDArray[np.float64]  # of y; 0 where J_c is singular, no map; shape (n,)
    exponents: npt.NDArray[np.int64]  # of the monomials m_k, shape (K, 3)
    facets: npt.NDArray[np.float64]  # the cell is {f_0 η_0 + f_1 η_1 + f_2 η_2 <= f_3}: (F, 4)
    starts: npt.NDArray[np.float64]  # further starting points η, shape (S, 3)
    centre: npt.NDArray[np.float64]  # ξ_c, shape (3,)


class BoxTree(NamedTuple):
    """Complete binary tree of boxes over the cells; node i has the children 2i+1 and 2i+2."""

    boxes: npt.NDArray[np.float64]  # lowest and highest x [m], shape (2·leaves - 1, 6)
    cells: npt.NDArray[np.int64]  # cell of each leaf, -1 for none, shape (leaves,)


@njit(cache=True, error_model="numpy")
def _power(t, n):  # type: ignore[no-untyped-def]
    """Value and derivative of tⁿ for n = 0, 1, 2."""
    if n == 0:
        return 1.0, 0.0
    if n == 1:
        return t, 1.0
    return t * t, 2.0 * t


@njit(cache=True, error_model="numpy")
def _evaluate(coefficients, exponents, cell, a, b, c):  # type: ignore[no-untyped-def]
    """Image y and Jacobian ∂y/∂η at η = (a, b, c): y_0, y_1, y_2, J_00, J_01, … J_22."""
    y0, y1, y2 = a, b, c
    j00, j01, j02 = 1.0, 0.0, 0.0
    j10, j11, j12 = 0.0, 1.0, 0.0
    j20, j21, j22 = 0.0, 0.0, 1.0
    for k in range(exponents.shape[0]):
        p, dp = _power(a, exponents[k, 0])
        q, dq = _power(b, exponents[k, 1])
        r, dr = _power(c, exponents[k, 2])
        m, m0, m1, m2 = p * q * r, dp * q * r, p * dq * r, p * q * dr
        c0, c1, c2 = coefficients[cell, k, 0], coefficients[cell, k, 1], coefficients[cell, k, 2]
        y0, j00, j01, j02 = y0 + c0 * m, j00 + c0 * m0, j01 + c0 * m1, j02 + c0 * m2
        y1, j10, j11, j12 = y1 + c1 * m, j10 + c1 * m0, j11 + c1 * m1, j12 + c1 * m2
        y2, j20, j21, j22 = y2 + c2 * m, j20 + c2 * m0, j21 + c2 * m1, j22 + c2 * m2
    return y0, y1, y2, j00, j01, j02, j10, j11, j12, j20, j21, j22


@njit(cache=True, error_model="numpy")
def _determinant(f):  # type: ignore[no-untyped-def]
    """Determinant of the Jacobian of :func:`_evaluate`."""
    return (
        f[3] * (f[7] * f[11] - f[8] * f[10])
        - f[4] * (f[6] * f[11] - f[8] * f[9])
        + f[5] * (f[6] * f[10] - f[7] * f[9])
    )


@njit(cache=True, error_model="numpy")
def _solve(f, det, r0, r1, r2):  # type: ignore[no-untyped-def]
    """Solution of J δ = r by Cramer's rule, with the Jacobian of :func:`_evaluate`."""
    d0 = (
        r0 * (f[7] * f[11] - f[8] * f[10])
        + r1 * (f[5] * f[10] - f[4] * f[11])
        + r2 * (f[4] * f[8] - f[5] * f[7])
    )
    d1 = (
        r0 * (f[8] * f[9] - f[6] * f[11])
        + r1 * (f[3] * f[11] - f[5] * f[9])
        + r2 * (f[5] * f[6] - f[3] * f[8])
    )
    d2 = (
        r0 * (f[6] * f[10] - f[7] * f[9])
        + r1 * (f[4] * f[9] - f[3] * f[10])
        + r2 * (f[3] * f[7] - f[4] * f[6])
    )
    return d0 / det, d1 / det, d2 / det


@njit(cache=True, error_model="numpy")
def _newton(coefficients, exponents, cell, y, a, b, c):  # type: ignore[no-untyped-def]
    """Solve y(η) = y from η = (a, b, c): η_0, η_1, η_2, number of iterations, converged."""
    if exponents.shape[0] == 0:  # affine: y(η) = η
        return y[0], y[1], y[2], 1, True
    f = _evaluate(coefficients, exponents, cell, a, b, c)
    det = _determinant(f)
    r0, r1, r2 = f[0] - y[0], f[1] - y[1], f[2] - y[2]
    if not det > 0.0:
        return a, b, c, 0, False
    for iteration in range(1, MAX_ITERATIONS + 1):
        size = np.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
        d0, d1, d2 = _solve(f, det, -r0, -r1, -r2)
        if max(abs(d0), abs(d1), abs(d2)) <= LAST_STEP:
            return a + d0, b + d1, c + d2, iteration, True
        t = 1.0
        while True:
            e0, e1, e2 = a + t * d0, b + t * d1, c + t * d2
            f = _evaluate(coefficients, exponents, cell, e0, e1, e2)
            det = _determinant(f)
            s0, s1, s2 = f[0] - y[0], f[1] - y[1], f[2] - y[2]
            v0, v1, v2 = s0 - (1.0 - t) * r0, s1 - (1.0 - t) * r1, s2 - (1.0 - t) * r2
            if det > 0.0 and np.sqrt(v0 * v0 + v1 * v1 + v2 * v2) <= 0.5 * t * size + ROUNDING:
                break
            t *= 0.5
            if t < SHORTEST:
                return a, b, c, iteration, size <= ROUNDING
        a, b, c = e0, e1, e2
        r0, r1, r2 = s0, s1, s2
    return a, b, c, MAX_ITERATIONS, size <= ROUNDING


@njit(cache=True, error_model="numpy")
def _excess(facets, a, b, c):  # type: ignore[no-untyped-def]
    """How far η lies beyond the facet it exceeds most (negative: within), and that facet."""
    worst, facet = -np.inf, 0
    for k in range(facets.shape[0]):
        e = facets[k, 0] * a + facets[k, 1] * b + facets[k, 2] * c - facets[k, 3]
        if e > worst:
            worst, facet = e, k
    return worst, facet


@njit(cache=True, error_model="numpy")
def _is_inside(  # type: ignore[no-untyped-def]
    coefficients, exponents, tolerance, cell, a, b, c, excess
):
    """Whether η lies in the cell; the tolerance of y is carried to η by J⁻¹."""
    if excess <= tolerance:
        return True
    if excess > MAX_WIDENED:
        return False
    f = _evaluate(coefficients, exponents, cell, a, b, c)
    det = _determinant(f)
    if not det > 0.0:
        return False
    x0, x1, x2 = _solve(f, det, 1.0, 0.0, 0.0)
    y0, y1, y2 = _solve(f, det, 0.0, 1.0, 0.0)
    z0, z1, z2 = _solve(f, det, 0.0, 0.0, 1.0)
    norm = max(
        abs(x0) + abs(y0) + abs(z0), abs(x1) + abs(y1) + abs(z1), abs(x2) + abs(y2) + abs(z2)
    )
    return excess <= min(tolerance * norm, MAX_WIDENED)


@njit(cache=True, error_model="numpy")
def _normalise(frames, cell, p0, p1, p2):  # type: ignore[no-untyped-def]
    """Normalised coordinates y of the point (p0, p1, p2) in a cell."""
    d0, d1, d2 = p0 - frames[cell, 0, 0], p1 - frames[cell, 0, 1], p2 - frames[cell, 0, 2]
    return (
        frames[cell, 1, 0] * d0
        + frames[cell, 1, 1] * d1
        + frames[cell, 1, 2] * d2
        - frames[cell, 4, 0],
        frames[cell, 2, 0] * d0
        + frames[cell, 2, 1] * d1
        + frames[cell, 2, 2] * d2
        - frames[cell, 4, 1],
        frames[cell, 3, 0] * d0
        + frames[cell, 3, 1] * d1
        + frames[cell, 3, 2] * d2
        - frames[cell, 4, 2],
    )


@njit(cache=True, error_model="numpy")
def _in_box(boxes, cell, y):  # type: ignore[no-untyped-def]
    """Whether y lies in a cell's box; False for a y that is not finite."""
    return (
        boxes[cell, 0, 0] <= y[0] <= boxes[cell, 1, 0]
        and boxes[cell, 0, 1] <= y[1] <= boxes[cell, 1, 1]
        and boxes[cell, 0, 2] <= y[2] <= boxes[cell, 1, 2]
    )


@njit(cache=True, error_model="numpy")
def _invert(  # type: ignore[no-untyped-def]
    coefficients, exponents, boxes, tolerances, facets, starts, cell, y
):
    """Invert a regular cell's map: η_0, η_1, η_2, status, iterations of all starts together."""
    tolerance = tolerances[cell]
    a, b, c, iterations, converged = _newton(coefficients, exponents, cell, y, 0.0, 0.0, 0.0)
    excess, _ = _excess(facets, a, b, c)
    if converged and _is_inside(coefficients, exponents, tolerance, cell, a, b, c, excess):
        return a, b, c, INSIDE, iterations
    if not _in_box(boxes, cell, y):
        return a, b, c, OUTSIDE, iterations
    # Curved cells are not star-shaped about their centre: try from elsewhere as well.
    for s in range(starts.shape[0]):
        e0, e1, e2, n, ok = _newton(
            coefficients, exponents, cell, y, starts[s, 0], starts[s, 1], starts[s, 2]
        )
        iterations += n
        if ok:
            beyond, _ = _excess(facets, e0, e1, e2)
            if _is_inside(coefficients, exponents, tolerance, cell, e0, e1, e2, beyond):
                return e0, e1, e2, INSIDE, iterations
    # Either a preimage outside the cell, or none on this side of a singularity outside it.
    if converged or excess > tolerance:
        return a, b, c, OUTSIDE, iterations
    return a, b, c, UNKNOWN, iterations


@njit(cache=True, error_model="numpy")
def map_points(maps, x, cells, X, status, iterations):  # type: ignore[no-untyped-def]
    """Invert the map of ``cells[i]`` at ``x[i]``, shape (n, 3), into X, status, iterations."""
    frames, coefficients, boxes, tolerances, exponents, facets, starts, centre = maps
    dim = X.shape[1]
    for i in range(x.shape[0]):
        for d in range(dim):
            X[i, d] = centre[d]
        iterations[i] = 0
        status[i] = UNKNOWN
        cell, p0, p1, p2 = cells[i], x[i, 0], x[i, 1], x[i, 2]
        if not (0 <= cell < tolerances.shape[0] and tolerances[cell] > 0.0):
            continue
        if not (np.isfinite(p0) and np.isfinite(p1) and np.isfinite(p2)):
            continue
        y = _normalise(frames, cell, p0, p1, p2)
        if not np.isfinite(y[0] + y[1] + y[2]):  # farther away than floating point reaches
            status[i] = OUTSIDE
            continue
        a, b, c, status[i], iterations[i] = _invert(
            coefficients, exponents, boxes, tolerances, facets, starts, cell, y
        )
        X[i, 0] += a
        X[i, 1] += b
        if dim == 3:
            X[i, 2] += c


@njit(cache=True, error_model="numpy")
def _walk(  # type: ignore[no-untyped-def]
    frames, coefficients, boxes, exponents, tolerances, facets, neighbours, cell, p0, p1, p2
):
    """Walk from a cell to the next through the facet that η exceeds most: last cell or -1, η.

    A cell is returned only where the point lies clear of its boundary, so that no other has it.
    """
    for _ in range(WALK):
        if cell < 0 or not tolerances[cell] > 0.0:
            break
        y = _normalise(frames, cell, p0, p1, p2)
        a, b, c = y  # the linear map shows the way where there is no need of more
        converged = False
        if _in_box(boxes, cell, y):
            e0, e1, e2, _, converged = _newton(coefficients, exponents, cell, y, 0.0, 0.0, 0.0)
            if converged:
                a, b, c = e0, e1, e2
        excess, facet = _excess(facets, a, b, c)
        near = NEAR + 16.0 * tolerances[cell]
        if converged and excess <= -near:
            return cell, a, b, c
        if excess <= near:
            break
        cell = neighbours[cell, facet]
    return -1, 0.0, 0.0, 0.0


@njit(cache=True, error_model="numpy")
def _holds(boxes, node, p0, p1, p2):  # type: ignore[no-untyped-def]
    """Whether a node's box of the tree holds the point."""
    return (
        boxes[node, 0] <= p0 <= boxes[node, 3]
        and boxes[node, 1] <= p1 <= boxes[node, 4]
        and boxes[node, 2] <= p2 <= boxes[node, 5]
    )


@njit(cache=True, error_model="numpy")
def find_points(  # type: ignore[no-untyped-def]
    maps, tree, neighbours, input_index, num_owned, x, guess, cells, X
):
    """Find the cell and reference coordinates of points, shape (n, 3), into cells and X.

    A point found clear of its cell's boundary is that cell's. Any other is given to the cell of the
    lowest input index among all that hold it, which is the same on every rank and for every guess.
    """
    frames, coefficients, boxes, tolerances, exponents, facets, starts, centre = maps
    node_boxes, leaf_cells = tree
    first_leaf = leaf_cells.shape[0] - 1
    dim = X.shape[1]
    stack = np.empty(STACK, np.int64)
    for i in range(x.shape[0]):
        p0, p1, p2 = x[i, 0], x[i, 1], x[i, 2]
        found, e0, e1, e2 = _walk(
            frames,
            coefficients,
            boxes,
            exponents,
            tolerances,
            facets,
            neighbours,
            guess[i],
            p0,
            p1,
            p2,
        )
        stack[0], top = 0, 1 if found < 0 else 0
        while top > 0:
            top -= 1
            node = stack[top]
            if not _holds(node_boxes, node, p0, p1, p2):
                continue
            if node < first_leaf:
                stack[top], stack[top + 1] = 2 * node + 1, 2 * node + 2
                top += 2
                continue
            cell = leaf_cells[node - first_leaf]
            if found >= 0 and input_index[cell] > input_index[found]:
                continue
            y = _normalise(frames, cell, p0, p1, p2)
            if not _in_box(boxes, cell, y):
                continue
            a, b, c, status, _ = _invert(
                coefficients, exponents, boxes, tolerances, facets, starts, cell, y
            )
            if status == INSIDE:
                found, e0, e1, e2 = cell, a, b, c
        if found >= num_owned:
            found = -1
        if found < 0:
            e0, e1, e2 = 0.0, 0.0, 0.0
        cells[i] = found
        X[i, 0] = centre[0] + e0
        X[i, 1] = centre[1] + e1
        if dim == 3:
            X[i, 2] = centre[2] + e2
