# SPDX-License-Identifier: MIT
"""How many material points a cell can have: the sizes of the rules they are seeded on.

The rules are basix's default ones: Gauss-Legendre with m points in each direction, exact to degree
2 m - 1, for quadrilaterals and hexahedra; those of Xiao and Gimbutas (2010) and the like for
triangles and tetrahedra. A displacement of degree k has a regular M where the rule is exact to
degree 2 k, that of the products of its shape functions.
"""

from __future__ import annotations

from functools import cache
from types import MappingProxyType

import basix
import numpy as np

_HIGHEST = 19  # degree of ten Gauss points in a direction


@cache
def rule_degrees(cell_type: str) -> MappingProxyType[int, int]:
    """The rules of a cell, by number of points.

    Where several rules have as many points it is the one of the highest degree. Rules with a
    negative weight are left out: no point weighs less than nothing. For triangles and tetrahedra
    (k + 1)^dim, the size that quadrilaterals and hexahedra have for the displacement degree k,
    stands for the rule exact to degree 2 k, which has fewer points.

    Args:
        cell_type: ``triangle``, ``quadrilateral``, ``tetrahedron`` or ``hexahedron``.

    Returns:
        Degree to which each rule is exact by points a cell, ascending.
    """
    cell = basix.CellType[cell_type]
    dim = len(basix.topology(cell)) - 1
    degrees = {}
    for degree in range(1, _HIGHEST + 1):
        weights = basix.make_quadrature(cell, degree)[1]
        if np.all(weights > 0):
            degrees[weights.size] = degree
    for k in (1, 2):
        degrees.setdefault((k + 1) ** dim, 2 * k)
    return MappingProxyType(dict(sorted(degrees.items())))


def allowed_points_per_cell(cell_type: str, degree: int) -> tuple[int, ...]:
    """Numbers of points a cell with which M is regular, ascending.

    Args:
        cell_type: Name of the cell, as in ``"triangle"``.
        degree: Displacement degree, 1 or 2.
    """
    return tuple(n for n, exact in rule_degrees(cell_type).items() if exact >= 2 * degree)


def default_points_per_cell(cell_type: str, degree: int) -> int:
    """Fewest points a cell with which M is regular.

    Args:
        cell_type: Name of the cell, as in ``"triangle"``.
        degree: Displacement degree, 1 or 2.

    Returns:
        ``(degree + 1)^dim`` for quadrilaterals and hexahedra; for degrees 1 and 2, 3 and 6 for
        triangles, 4 and 14 for tetrahedra.
    """
    return allowed_points_per_cell(cell_type, degree)[0]
