# SPDX-License-Identifier: MIT
"""The points as they slide, as an animated GIF: a frame a snapshot."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from fenics_hytf.results.figures.plane import Plane, discs, draw_mesh, picture_size
from fenics_hytf.results.figures.style import length_unit, spread
from fenics_hytf.results.ground import StoredPoints, read_points, snapshot_lapses
from fenics_hytf.results.reader import StoredResult

MOST_BYTES = 3_000_000
"""Frames are left out until the file is no larger."""

_MOST_FRAMES = 40  # more snapshots are thinned evenly
_MOST_POINTS = 6_000  # likewise
_HIGHEST = 5.5  # of the picture [inch]
_DPI = 100
_DURATION = 6000  # of the motion [ms], as far as the limits of a frame allow
_A_FRAME = (80, 350)  # [ms]
_HOLD = 1500  # for which the last frame stays besides [ms]
_GREYS = 32  # among 256 colours


def animate(stored: StoredResult, plane: Plane) -> bytes:
    """Draw the animation.

    Args:
        stored: The result.
        plane: In which the points are shown.

    Returns:
        The content of a GIF file.
    """
    frames = _frames(stored)
    drawn = _draw(frames, plane)
    while (size := len(drawn)) > MOST_BYTES and len(frames) > 2:
        # the figure around the points is in the first frame alone: size goes with their number
        fewer = max(2, int(0.9 * len(frames) * MOST_BYTES / size))
        frames = [frames[i] for i in spread(len(frames), fewer)]
        drawn = _draw(frames, plane)
    return drawn


def _frames(stored: StoredResult) -> list[StoredPoints]:
    """The points at the start, and at the ends of lapses."""
    written = snapshot_lapses(stored)
    frames = [read_points(stored, written[i]) for i in spread(len(written), _MOST_FRAMES)]
    first = frames[0]
    nought = np.zeros_like(first.displacement)
    start = first.position - first.displacement
    return [StoredPoints(0.0, first.id, start, nought, first.volume), *frames]


def _draw(frames: list[StoredPoints], plane: Plane) -> bytes:
    lengths = [np.linalg.norm(points.displacement, axis=1) for points in frames]
    largest = max(float(length.max(initial=0.0)) for length in lengths)
    factor, unit = length_unit(largest)
    width, height = picture_size(plane, _HIGHEST)
    figure = Figure(figsize=(width + 1.6, height + 0.9), dpi=_DPI)
    axes = figure.subplots()
    axes.set_ylabel("Elevation [m]")
    axes.set_xlabel("Distance [m]")
    draw_mesh(axes, plane)
    title = axes.set_title("At the start")
    scale = (0.0, factor * largest or 1.0)
    drawn = discs(axes, plane, frames[0], lengths[0], scale, _MOST_POINTS)
    place = axes.inset_axes((1.02, 0.0, 0.02, 1.0))
    bar = figure.colorbar(drawn, cax=place)
    bar.set_label(f"Displacement [{unit}]")
    bar.outline.set_linewidth(0.0)  # type: ignore[operator]
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # nothing shifts from frame to frame
    images = [_image(figure)]
    for points, length in zip(frames[1:], lengths[1:], strict=True):
        drawn.remove()
        drawn = discs(axes, plane, points, factor * length, scale, _MOST_POINTS)
        title.set_text(f"After {points.time:.3g} s")
        images.append(_image(figure))
    each = int(np.clip(_DURATION / len(images), *_A_FRAME))
    durations = [each] * (len(images) - 1) + [each + _HOLD]
    buffer = BytesIO()
    images[0].save(
        buffer,
        format="GIF",
        save_all=True,
        append_images=images[1:],
        duration=durations,
        loop=0,
        optimize=False,
    )
    return buffer.getvalue()


def _image(figure: Figure) -> Image.Image:
    """A frame, in the same colours as all others."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    size = canvas.get_width_height()
    drawn = Image.frombytes("RGBA", size, canvas.buffer_rgba()).convert("RGB")
    return drawn.quantize(palette=_palette(), dither=Image.Dither.NONE)


def _palette() -> Image.Image:
    """The colours of the map, and greys."""
    colours = colormaps["viridis"](np.linspace(0.0, 1.0, 256 - _GREYS))[:, :3]
    greys = np.repeat(np.linspace(0.0, 1.0, _GREYS)[:, None], 3, axis=1)
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.round(255 * np.concatenate([colours, greys])).astype(np.uint8).tobytes())
    return palette
