"""One small picture with all colors and labels of an object, so that a node can have several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image, ImageDraw
from trimesh.visual.material import PBRMaterial

from scenes.modeling.geometry import Patch, box, join, polygon
from scenes.modeling.lettering import draw_word
from scenes.modeling.pbr_materials import Color, textured

CELL_PX = 160
STRIP = 0.88  # of a cell is as wide as a label: the rest keeps neighbors out at coarse mip levels
OVERSAMPLING = 4  # rounds the letters' edges


@dataclass(frozen=True)
class Label:
    """A word on a plain ground; colors are sRGB in 0..1.

    Attributes:
        word: in block capitals.
        aspect: width over height, at least 1.
        ink, ground: colors of the letters and around them.
        letters: their height over the label's.
    """

    word: str
    aspect: float
    ink: Color
    ground: Color
    letters: float = 0.6

    def picture(self) -> np.ndarray:
        """Square picture in 0..1: ground with the label as a strip across its middle."""
        side = CELL_PX * OVERSAMPLING
        canvas = Image.new("RGB", (side, side), _bytes(self.ground))
        letters = self.letters * STRIP * side / self.aspect
        draw_word(
            ImageDraw.Draw(canvas), self.word, (side / 2, side / 2), letters, _bytes(self.ink)
        )
        return np.asarray(canvas.reduce(OVERSAMPLING), float) / 255


@dataclass(frozen=True)
class Palette:
    """Plain colors (sRGB in 0..1) and labels by name, in the cells of one picture."""

    colors: Mapping[str, Color]
    labels: Mapping[str, Label]

    @property
    def _columns(self) -> int:
        return int(np.ceil(np.sqrt(len(self.colors) + len(self.labels))))

    def material(self, name: str) -> PBRMaterial:
        """The one material of all that is painted from this palette."""
        columns = self._columns
        image = np.zeros((columns * CELL_PX, columns * CELL_PX, 3))
        cells = [np.broadcast_to(color, (CELL_PX, CELL_PX, 3)) for color in self.colors.values()]
        cells += [label.picture() for label in self.labels.values()]
        for index, cell in enumerate(cells):
            row, column = (CELL_PX * place for place in divmod(index, columns))
            image[row : row + CELL_PX, column : column + CELL_PX] = cell
        return textured(name, image, roughness=0.6, lossless=True)

    def paint(self, color: str, *patches: Patch) -> Patch:
        """Parts in one plain color: every corner shows the middle of its cell."""
        patch = join(patches)
        column, row = self._cell(list(self.colors).index(color))
        middle = np.array([column + 0.5, self._columns - row - 0.5]) / self._columns
        return replace(patch, uvs=np.tile(middle, (len(patch.positions), 1)))

    def label(
        self,
        name: str,
        height: float,
        edge_color: str,
        thickness: float = 0.002,
        columns: int = 1,
    ) -> Patch:
        """Plate facing +x with a label on it, its front at x = 0; `columns` let it be bent."""
        label = self.labels[name]
        y = np.linspace(-0.5, 0.5, columns + 1) * height * label.aspect
        z = height / 2
        column, row = self._cell(len(self.colors) + list(self.labels).index(name))
        u = column + 0.5 + STRIP * np.linspace(-0.5, 0.5, columns + 1)
        u /= self._columns
        middle, half = self._columns - row - 0.5, 0.5 * STRIP / label.aspect
        low, high = (middle - half) / self._columns, (middle + half) / self._columns
        front, rest = [], []
        for index, (right, left) in enumerate(zip(y[1:], y[:-1], strict=True)):
            corners = [(0, left, -z), (0, right, -z), (0, right, z), (0, left, z)]
            a, b = u[index : index + 2]
            front.append(polygon(corners, [(a, low), (b, low), (b, high), (a, high)]))
            inner = "" if columns == 1 else "-y" * (index > 0) + "+y" * (index < columns - 1)
            size, at = (thickness, right - left, height), (-thickness / 2, (left + right) / 2, 0)
            rest.append(box(size, at, without="+x" + inner))
        return join([*front, self.paint(edge_color, *rest)])

    def _cell(self, index: int) -> tuple[int, int]:
        row, column = divmod(index, self._columns)
        return column, row


def _bytes(color: Color) -> tuple[int, ...]:
    return tuple(round(255 * part) for part in color)
