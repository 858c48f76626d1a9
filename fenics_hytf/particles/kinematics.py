# SPDX-License-Identifier: MIT
"""Volume, strain and static stress of the points through one lapse's increment of displacement.

With the increment's gradient at a point, L = grad(du), constant over the lapse's step,

    dF = exp(L),   volume <- volume exp(tr L),   strain <- strain + d,   d = sym L,
    stress <- dF (stress + lambda tr(d) I + 2 G d) dF^T / det dF.

A rotation (L skew) makes dF orthogonal: it changes neither a volume nor an invariant, where I + L
and the midpoint rule would. The stress update's tangent is K_L + K_NL. What lapses hand over of the
dynamic strain, memory and stress is turned by exp(skew L). Tensors of two-dimensional
points are the in-plane ones; the third stretch is 1 and does not mix with them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.particles.geometry import RealArray, chunks
from fenics_hytf.particles.points import Points

# Where the components xx, yy(, zz, yz, xz), xy stand in the tensor.
_PLACES = {3: ((0, 1, 0), (0, 1, 1)), 6: ((0, 1, 2, 1, 0, 0), (0, 1, 2, 2, 2, 1))}

# Tensors that change within lapses and only turn with the ground between them, and what a shear
# component stands for: γ = 2ε in strain.
_TURNING = {"dynamic_strain": 2.0, "memory_strain": 2.0, "dynamic_stress": 1.0}

_UNIT = 0.5  # norm up to which the exponential's series is summed as it is


def exponentials(matrices: RealArray) -> RealArray:
    """The exponential of many small matrices at once, (Σ_k (L/2ᵐ)ᵏ/k!)^2ᵐ to round-off.

    Of a displacement's gradient a handful of terms is enough, where a routine made for one large
    matrix spends its time on being called.

    Args:
        matrices: L [-], shape ``(n, dim, dim)``.

    Returns:
        exp(L), of the same shape.
    """
    largest = np.abs(matrices).sum(axis=2).max(initial=_UNIT)
    squarings = int(np.ceil(np.log2(largest / _UNIT)))
    scaled = matrices / 2.0**squarings
    term, order = scaled, 1
    total = np.eye(matrices.shape[1]) + term
    while np.abs(term).max(initial=0.0) > np.finfo(np.float64).eps / 4:
        order += 1
        term = term @ scaled / order
        total += term
    for _ in range(squarings):
        total = total @ total
    return np.asarray(total)


def to_tensor(components: RealArray) -> RealArray:
    """Symmetric tensors from their components.

    Args:
        components: xx, yy, xy or xx, yy, zz, yz, xz, xy, shape ``(n, 3)`` or ``(n, 6)``.

    Returns:
        Tensors, shape ``(n, 2, 2)`` or ``(n, 3, 3)``.
    """
    row, column = _PLACES[components.shape[1]]
    dim = max(row) + 1
    tensor = np.empty((len(components), dim, dim))
    tensor[:, row, column] = components
    tensor[:, column, row] = components
    return tensor


def to_components(tensor: RealArray) -> RealArray:
    """Components of symmetric tensors, the inverse of ``to_tensor``."""
    row, column = _PLACES[3 * tensor.shape[1] - 3]
    return tensor[:, row, column]


def update_volume(volume: RealArray, gradient: RealArray) -> RealArray:
    """Volumes after the increment.

    Args:
        volume: [m^3] or [m^2], shape ``(n,)``.
        gradient: L[p, i, j] = d du_i / d x_j [-], shape ``(n, gdim, gdim)``.

    Returns:
        ``volume exp(tr L)``, shape ``(n,)``.
    """
    return volume * np.exp(np.trace(gradient, axis1=1, axis2=2))


def rotate(columns: RealArray, gradient: RealArray, shear: float) -> RealArray:
    """Symmetric tensors turned with the ground, R T Rᵀ with R = exp(skew L).

    Args:
        columns: Components as ``to_tensor`` takes them, shape ``(n, ..., 3)`` or ``(n, ..., 6)``.
        gradient: L [-], shape ``(n, gdim, gdim)``.
        shear: What an off-diagonal component is in the columns: 1, or 2 for strain as γ = 2ε.

    Returns:
        Components, shaped like ``columns``.
    """
    turned = np.empty_like(columns)
    scale = np.ones(columns.shape[-1])
    scale[gradient.shape[1] :] = shear
    for chunk in chunks(len(columns)):
        L = gradient[chunk]
        R = exponentials(0.5 * (L - L.transpose(0, 2, 1)))
        inner = int(np.prod(columns.shape[1:-1], dtype=int))
        flat = (columns[chunk] / scale).reshape(-1, len(scale))
        many = np.repeat(R, inner, axis=0)
        tensors = many @ to_tensor(flat) @ many.transpose(0, 2, 1)
        turned[chunk] = (to_components(tensors) * scale).reshape(columns[chunk].shape)
    return turned


def shear_strain(gradient: RealArray) -> RealArray:
    """γ = √(2 e:e) of the deviator e of the symmetric part, in plane strain that of the section.

    Args:
        gradient: L [-], shape ``(n, gdim, gdim)``.

    Returns:
        Not negative [-], shape ``(n,)``.
    """
    gdim = gradient.shape[1]
    strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    mean = np.trace(strain, axis1=1, axis2=2) / gdim
    deviator = strain - mean[:, None, None] * np.eye(gdim)
    return np.asarray(np.sqrt(2.0 * np.sum(deviator**2, axis=(1, 2))))


def update_stress(
    stress: RealArray, gradient: RealArray, lame_lambda: RealArray, shear_modulus: RealArray
) -> RealArray:
    """Cauchy stress after the increment.

    Args:
        stress: Components [Pa], shape ``(n, 3)`` or ``(n, 6)``.
        gradient: L [-], shape ``(n, gdim, gdim)``.
        lame_lambda: Lame's first constant [Pa], shape ``(n,)``.
        shear_modulus: G [Pa], shape ``(n,)``.

    Returns:
        Components [Pa], shaped like ``stress``.
    """
    updated = np.empty_like(stress)
    for chunk in chunks(len(stress)):
        L = gradient[chunk]
        F = exponentials(L)
        sigma = to_tensor(stress[chunk]) + shear_modulus[chunk, None, None] * (
            L + L.transpose(0, 2, 1)
        )
        trace = np.trace(L, axis1=1, axis2=2)
        sigma += (lame_lambda[chunk] * trace)[:, None, None] * np.eye(L.shape[1])
        sigma = F @ sigma @ F.transpose(0, 2, 1) * np.exp(-trace)[:, None, None]
        updated[chunk] = to_components(sigma)
    return updated


def update_kinematics(
    points: Points,
    gradient: RealArray,
    lame_lambda: npt.ArrayLike | None = None,
    shear_modulus: npt.ArrayLike | None = None,
    plastic: RealArray | None = None,
) -> None:
    """Carry volume, and strain and stress where the points have them, through an increment.

    Call it before ``move``, which changes the order of the points.

    Args:
        points: Points, changed in place.
        gradient: L[p, i, j] = d du_i / d x_j at the points [-], shape ``(n, gdim, gdim)``.
        lame_lambda: Lame's first constant [Pa], shape ``(n,)`` or one for all; for stress only.
        shear_modulus: G [Pa], likewise.
        plastic: Of a plastic part of the increment that comes on top, which turns what points carry
            and strains it without stress, shaped like ``gradient``.

    Raises:
        ValueError: If ``gradient`` has another shape, or points carry stress and a modulus is
            missing.
    """
    n, gdim = points.x.shape
    if gradient.shape != (n, gdim, gdim):
        raise ValueError(
            f"Found gradients of shape {gradient.shape}; expected {(n, gdim, gdim)}: one a point."
        )
    if "stress" in points.history:
        if lame_lambda is None or shear_modulus is None:
            raise ValueError("Found points with stress but no moduli; expected both, in Pa.")
        moduli = (np.broadcast_to(np.asarray(m, float), n) for m in (lame_lambda, shear_modulus))
        points["stress"] = update_stress(points["stress"], gradient, *moduli)
    # What flows plastically keeps its volume, in the mean of a cell if not at every point.
    points.volume = update_volume(points.volume, gradient)
    if plastic is not None:
        if "stress" in points.history:
            points["stress"] = rotate(points["stress"], plastic, 1.0)
        if "plastic_strain" in points.history:
            points["plastic_strain"] = points["plastic_strain"] + shear_strain(plastic)
        gradient = gradient + plastic
    if "strain" in points.history:
        symmetric = 0.5 * (gradient + gradient.transpose(0, 2, 1))
        points["strain"] = points["strain"] + to_components(symmetric)
    if "shear_strain" in points.history:
        points["shear_strain"] = points["shear_strain"] + shear_strain(gradient)
    for name, shear in _TURNING.items():
        if name in points.history:
            points[name] = rotate(points[name], gradient, shear)
