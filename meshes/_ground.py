# SPDX-License-Identifier: MIT
"""What the scripts of slopes share: layers, seam and air, sizes of cells, and options.

The last axis is up, the base is at zero. Lines of the mesh follow the ground's surface and the
layers (style ``fitted``), or it is of equal squares or cubes (style ``grid``); then each cell is
given to what its centroid lies in: a layer, the seam, the air, or nothing, which leaves it out.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

RealArray = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Names = npt.NDArray[np.str_]
Cells = tuple[RealArray, Numbers, npt.NDArray[np.bool_]]

AIR = "air"
STYLES = ("fitted", "grid")
_MOST_CELLS = 2_000_000
_TRIALS = 10
_NEAR = 0.1  # of a cell
SMALLEST, LARGEST = 1e-6, 1e9  # of lengths [m] and velocities [m/s]
ROUNDING = 1e-9  # of a number of cells, or of a length of the mesh
# Ends of a cell's sides, in gmsh's order of its corners.
_SIDES = {
    2: ([0, 1, 2, 3], [1, 2, 3, 0]),
    3: ([0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3], [1, 2, 3, 0, 5, 6, 7, 4, 4, 5, 6, 7]),
}


@dataclass(frozen=True)
class Ground:
    """Layers and their cells, as all scripts of slopes take them.

    Attributes:
        layers: Name and elevation of the top [m] of each, bottom up; the last reaches the surface.
        seam: A weak band ``(x1, y1, x2, y2, thickness)`` from a point to another [m], or ``None``.
            Where the points lie outside the ground, it crosses the ground. In 3D y is the height.
        seam_name: Its region.
        size: Of cells [m]; 1 m if neither it nor a frequency is given. Beside a face sides vary, to
            1.8 times as much.
        max_frequency: In the place of a size, the frequency whose waves are to be resolved [Hz].
        vs: Shear wave velocity of each layer, or one of all [m/s].
        cells_per_wavelength: No side of a cell in a layer is longer than its shortest wave over
            this.
        air: Height of background cells above the crest [m]; they fill the box beside the slope as
            well, as the region ``air``. ``None``: only the ground has cells.
        style: ``fitted`` or ``grid``.
    """

    layers: Sequence[tuple[str, float]] = (("soil", math.inf),)
    seam: Sequence[float] | None = None
    seam_name: str = "seam"
    size: float | None = None
    max_frequency: float | None = None
    vs: Sequence[float] | None = None
    cells_per_wavelength: float = 10.0
    air: float | None = None
    style: str = "fitted"

    def __post_init__(self) -> None:
        if self.style not in STYLES:
            raise ValueError(f"found style {self.style!r}; expected {' or '.join(STYLES)}")
        if self.air is not None and not 0 < self.air < math.inf:
            raise ValueError(f"found {self.air} m of air; expected a positive height")
        names = [name for name, _ in self.layers]
        names += [self.seam_name] if self.seam is not None else []
        if not self.layers or len({*names, AIR, ""}) != len(names) + 2:
            raise ValueError(
                f"found layers and seam {', '.join(names)}; expected names that differ, and from "
                f"{AIR!r}"
            )
        tops = [0.0, *(top for _, top in self.layers)]
        if tops[-1] != math.inf or any(b <= a for a, b in pairwise(tops)):
            raise ValueError(
                f"found tops {tops[1:]} m; expected one for every layer but the last, ascending "
                "from above 0"
            )
        if self.seam is not None and not (
            len(self.seam) == 5
            and all(map(math.isfinite, self.seam))
            and tuple(self.seam[:2]) != tuple(self.seam[2:4])
            and self.seam[4] > 0
        ):
            raise ValueError(
                f"found seam {tuple(self.seam)}; expected two different points and a positive "
                "thickness"
            )
        self._check_sizes()

    def _check_sizes(self) -> None:
        if self.max_frequency is None:
            if self.vs is not None:
                raise ValueError("found velocities; expected a frequency with them")
            positive(size=1.0 if self.size is None else self.size)
            return
        if self.size is not None:
            raise ValueError("found a size and a frequency; expected one of them")
        positive(max_frequency=self.max_frequency, cells_per_wavelength=self.cells_per_wavelength)
        given = self.vs or ()
        if len(given) not in (1, len(self.layers)):
            raise ValueError(
                f"found {len(given)} velocities for {len(self.layers)} layers; expected one, or "
                "one a layer"
            )
        for velocity in given:
            positive(vs=velocity)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Of the cells of each layer [m]."""
        if self.max_frequency is None:
            return (1.0 if self.size is None else self.size,) * len(self.layers)
        given = tuple(self.vs or ())
        each = given if len(given) == len(self.layers) else given * len(self.layers)
        return tuple(v / (self.max_frequency * self.cells_per_wavelength) for v in each)

    @property
    def width(self) -> float:
        """Of columns of cells: the size of those of the softest layer [m]."""
        return min(self.sizes)

    def layer_of(self, height: npt.ArrayLike) -> npt.NDArray[np.intp]:
        """Number of the layer at heights above the base [m]."""
        tops = [top for _, top in self.layers[:-1]]
        return np.searchsorted(tops, np.asarray(height, float), side="right")

    def tops(self, bends: Sequence[float]) -> list[float]:
        """Heights at which layers end but the last, for lines of the mesh.

        Args:
            bends: Heights at which the surface bends [m].

        Returns:
            [m], ascending; through the bend where one is nearer than a tenth of a cell.

        Raises:
            ValueError: A layer that begins above the crest.
        """
        found = []
        for _, top in self.layers[:-1]:
            nearest = min(bends, key=lambda height: abs(height - top))
            found.append(nearest if abs(nearest - top) < _NEAR * self.width else top)
        if found and found[-1] >= max(bends):
            raise ValueError(
                f"found a layer's top at {found[-1]} m; expected it below the crest, which is at "
                f"{max(bends)} m"
            )
        return found

    def sizes_between(self, heights: npt.ArrayLike) -> list[float]:
        """Sizes of the cells between heights [m]."""
        ends = np.asarray(heights, float)
        return [self.sizes[layer] for layer in self.layer_of((ends[1:] + ends[:-1]) / 2)]

    def regions(self, centre: RealArray, inside: npt.NDArray[np.bool_]) -> Names:
        """Region of every cell; empty where there is to be none.

        Args:
            centre: Centroids of the cells [m], shape ``(num_cells, dim)``.
            inside: Whether each is in the ground, shape ``(num_cells,)``.

        Returns:
            Names, shape ``(num_cells,)``.

        Raises:
            ValueError: A layer or a seam without a cell.
        """
        names = np.array([name for name, _ in self.layers])[self.layer_of(centre[:, -1])]
        names = np.where(inside, names, AIR if self.air is not None else "").astype(object)
        if self.seam is not None:
            names[inside & self._in_seam(centre[:, 0], centre[:, -1])] = self.seam_name
        expected = [name for name, _ in self.layers] + [self.seam_name] * (self.seam is not None)
        bare = [name for name in expected if not (names == name).any()]
        if bare:
            raise ValueError(
                f"found no cell with its centroid in {', '.join(bare)}; expected smaller cells, or "
                "that it lie in the ground and be thicker"
            )
        return names.astype(np.str_)

    def _in_seam(self, x: RealArray, height: RealArray) -> npt.NDArray[np.bool_]:
        assert self.seam is not None
        start, end = np.array(self.seam[:2], float), np.array(self.seam[2:4], float)
        length = float(np.hypot(*(end - start)))
        along = (end - start) / length
        place = np.stack([x, height], axis=-1) - start
        off = np.abs(place @ np.array([-along[1], along[0]]))
        on = place @ along
        return (off <= self.seam[4] / 2) & (on >= 0) & (on <= length)


def positive(**values: float) -> None:
    """Raise ValueError unless all values are positive, of a size that anything in ground has."""
    for name, value in values.items():
        if not SMALLEST <= value <= LARGEST:
            raise ValueError(
                f"found {name.replace('_', ' ')} {value}; expected a positive number, from "
                f"{SMALLEST:g} to {LARGEST:g}"
            )


def run_over_rise(slope: float | None, angle: float | None, usual: float = 1.5) -> float:
    """Inclination of a face, given as one or the other.

    Args:
        slope: Run over rise [-].
        angle: From the horizontal [degrees].
        usual: Where neither is given.

    Returns:
        Run over rise [-]; 0 is vertical.

    Raises:
        ValueError: Both, or a face that overhangs or is flatter than 5 degrees.
    """
    if slope is not None and angle is not None:
        raise ValueError("found a slope and an angle; expected one of them")
    if angle is not None:
        if not 5 <= angle <= 90:
            raise ValueError(f"found an angle of {angle} degrees; expected 5 to 90")
        return 0.0 if angle == 90 else 1 / math.tan(math.radians(angle))
    slope = usual if slope is None else slope
    if not 0 <= slope <= 1 / math.tan(math.radians(5)):
        raise ValueError(f"found a slope of {slope} (run over rise); expected 0 to 11.43")
    return slope


def count(length: float, size: float) -> int:
    """Cells of at most a size on a length; at least one."""
    return max(1, math.ceil(length / size - ROUNDING))


def resolved(ground: Ground, make: Callable[[float], Cells]) -> Cells:
    """Cells whose sides are as short as the wavelength demands; any where a size was given.

    Args:
        ground: Layers and cells.
        make: Nodes, cells, and which of them are in the ground, for a scale of the sizes.

    Returns:
        What it makes for the largest scale tried at which the sides are short enough.

    Raises:
        RuntimeError: They stay too long.
    """
    scale = 1.0
    for _ in range(_TRIALS):
        points, cells, inside = make(scale)
        layers = ground.layer_of(points[cells[inside]].mean(axis=1)[:, -1])
        longest = longest_sides(points, cells[inside])
        excess = float((longest / np.array(ground.sizes)[layers]).max(initial=0.0))
        if ground.max_frequency is None or excess <= 1 + ROUNDING:
            return points, cells, inside
        scale *= 0.97 / excess
    raise RuntimeError(
        f"found sides {excess:.2f} times as long as the wavelength allows; expected 1. Give a size"
    )


def longest_sides(points: RealArray, cells: Numbers) -> RealArray:
    """Longest side of each cell [m], shape ``(num_cells,)``."""
    start, end = _SIDES[points.shape[1]]
    return np.linalg.norm(points[cells[:, end]] - points[cells[:, start]], axis=-1).max(axis=1)


def check_number(*counts: int) -> None:
    """Raise ValueError for more cells than anyone means."""
    if math.prod(counts) > _MOST_CELLS:
        raise ValueError(
            f"found {math.prod(counts)} cells; expected at most {_MOST_CELLS}: larger ones, or a "
            "lower frequency"
        )


def add_slope_options(parser: argparse.ArgumentParser) -> None:
    """Options of a slope's outline, of the names that slopes in sections and in space share."""
    add = parser.add_argument
    add("--height", type=float, default=10.0, help="from toe to crest [m]")
    add("--depth", type=float, default=5.0, help="from the toe to the base [m]")
    inclination = parser.add_mutually_exclusive_group()
    inclination.add_argument("--slope", type=float, help="run over rise; 1.5 if absent")
    inclination.add_argument("--angle", type=float, help="from the horizontal [degrees]")
    add("--behind", type=float, help="left of the crest [m]; 2 heights if absent")
    add("--before", type=float, help="right of the toe [m]; 2.5 heights if absent")


def add_ground_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that make a :class:`Ground`."""
    usual = Ground()
    add = parser.add_argument
    add(
        "--layers",
        type=_layer,
        nargs="+",
        default=usual.layers,
        metavar="NAME[:TOP]",
        help="bottom up, with the elevation of each top but the last [m]",
    )
    add(
        "--seam",
        type=float,
        nargs=5,
        metavar=("X1", "Y1", "X2", "Y2", "THICKNESS"),
        help="a weak band from one point to another [m]",
    )
    add("--seam-name", default=usual.seam_name, help="its region")
    add("--size", type=float, help="of cells [m]; 1 if not by wavelength")
    add("--max-frequency", type=float, help="whose waves are resolved, in the place of a size [Hz]")
    add("--vs", type=float, nargs="+", help="shear wave velocity, one or one a layer [m/s]")
    add(
        "--cells-per-wavelength",
        type=float,
        default=usual.cells_per_wavelength,
        help="no side of a cell is longer than the shortest wave over this",
    )
    add("--air", type=float, help="height of background cells above the crest [m]; none if absent")
    add("--style", choices=STYLES, default=usual.style, help="surface along mesh lines, or squares")


def _layer(text: str) -> tuple[str, float]:
    name, colon, top = text.partition(":")
    try:
        return name, float(top) if colon else math.inf
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no NAME or NAME:TOP") from None
