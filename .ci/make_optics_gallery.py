"""Gallery of the optical systems of examples/optics: make gallery.

The page takes its text from the files' comments and from what is measured of the systems.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / ".ci")]

from pages import save_jpeg, write_image_file  # noqa: E402

from omnisim import OmniCamera, open_sensor  # noqa: E402
from omnisim.cameras.mirrors.mirror_mesh import PAPER_POLYGON_COUNTS, MeshError  # noqa: E402
from omnisim.cameras.optics import OpticalSystem, measure_centrality, read_optics_file  # noqa: E402
from omnisim.cameras.optics.mesh_rays import SystemMeshErrors, has_mesh  # noqa: E402
from omnisim.cameras.optics.surface import Fate  # noqa: E402
from omnisim.core.bilinear import corner_and_weights, interpolate  # noqa: E402
from omnisim.plots.contact_sheet import contact_sheet  # noqa: E402
from omnisim.plots.optics_plot import optics_figure  # noqa: E402
from omnisim.rendering.camera.quality import auto_polygons  # noqa: E402
from omnisim.scene import load_scene  # noqa: E402

FOLDER = ROOT / "examples" / "optics"
IMAGES = FOLDER / "gallery"
SCENE = "courtyard"
VIEWPOINT_M = (0.6, -0.5, 1.2)
HEIGHTS_M = {"equi-ground": 0.6}  # that the mirror is designed for
YAW_DEG = 40.0
LONGER_SIDE_PX = 440
SUPERSAMPLING = 4
MAX_BYTES = 50_000
PLOT_COLORS = 64
OUTSIDE = (24, 24, 28)  # where a camera sees nothing
ORDER = (
    "tilted-mirror", "sphere", "cone", "security-mirror", "equi-angular", "equi-ground", "folded",
    "flat-port", "dome-port",
)  # fmt: skip
STRIP = "cone"  # also shown unrolled
STRIP_RADII = (0.12, 0.99)  # shares of the mirror's radius in the image
SHEET, SHEET_PX, SHEET_COLUMNS = "all.jpg", 220, 5  # also on one sheet, the strip last
MESHED, MESHED_PX, LABEL_PX = "sphere", 190, 20  # also shown by meshes


def system_of(name: str) -> OpticalSystem:
    """System of an example, in the size of its image here."""
    system = read_optics_file(FOLDER / f"{name}.toml")
    return system.scaled(LONGER_SIDE_PX / max(system.width_px, system.height_px))


def title_of(name: str) -> str:
    """First comment of a file: sentences."""
    lines = (FOLDER / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    comments = [line[2:] for line in lines[: lines.index("[camera]")] if line.startswith("# ")]
    return " ".join(line for line in comments if not line.startswith("The profile:"))


def page(errors: dict[str, list[MeshError]], chosen: dict[str, int | None]) -> str:
    """README of the examples."""
    parts = [
        "# Optical systems\n\n"
        f"The scene `{SCENE}` through every example, from one viewpoint: `omnisim render {SCENE} "
        "--optics FILE`. Where no ray leaves the system the image is dark: beside the mirror, "
        "beyond a rim, and where it shows the camera's body or a post. Below it: `omnisim optics "
        "plot FILE`. Made by `make gallery`, by the ray back end.\n"
    ]
    for name in ORDER:
        parts.append(
            f"## {name}\n\n{title_of(name)} `examples/optics/{name}.toml`\n\n![{name}](gallery/"
            f"{name}.jpg)\n\n![rays, caustic and resolution of {name}](gallery/{name}-plot.png)\n\n"
            f"{_measured(name)}\n"
        )
        if name == STRIP:
            parts.append(f"Unrolled about its middle:\n\n![strip](gallery/{name}-strip.jpg)\n")
    parts.append(_mesh_section(errors, chosen))
    return "\n".join(parts)


def _measured(name: str) -> str:
    system = read_optics_file(FOLDER / f"{name}.toml")
    fates = system.all_rays().fates
    seen, shadowed = (100.0 * float(np.mean(fates == fate)) for fate in (Fate.SEEN, Fate.SHADOWED))
    found = measure_centrality(system, (0.3,))
    dark = f", and {shadowed:.2g} % a shadow" if shadowed > 0.005 else ""
    return (
        f"{seen:.0f} % of the pixels see the scene{dark}. Rays miss their best common point by up "
        f"to {1e3 * found.misses_m.max():.3g} mm; a model with that viewpoint is off by "
        f"{found.errors[0].median_px:.2g} px for points at 0.3 m."
    )


def _mesh_section(errors: dict[str, list[MeshError]], chosen: dict[str, int | None]) -> str:
    counts = " | ".join(f"{polygons}" for polygons in PAPER_POLYGON_COUNTS)
    rows = [
        f"| {name} | "
        + " | ".join(f"{one.mean_px:.2g}, {one.max_px:.2g}" for one in found)
        + f" | {chosen[name]} |"
        for name, found in errors.items()
    ]
    return (
        "## Polygons\n\n"
        "The paper's mesh for any mirror, `omnisim render --optics FILE -n POLYGONS`: directions "
        "against the exact rays, mean and largest error in pixels of the example's own image, "
        "and the polygons that `-n auto` takes, which keep the largest below 0.1 px. Four times "
        "the polygons leave a quarter of the mean error. `omnisim mirror --optics FILE -n "
        "POLYGONS` prints the same.\n\n"
        f"![{MESHED} by meshes](gallery/mesh.jpg)\n\n"
        f"| | {counts} | auto |\n|{' --- |' * (len(PAPER_POLYGON_COUNTS) + 2)}\n"
        + "\n".join(rows)
        + "\n"
    )


def mesh_errors() -> tuple[dict[str, list[MeshError]], dict[str, int | None]]:
    """Errors of the paper's meshes and polygons of "auto", by example that has a mirror."""
    systems = {name: read_optics_file(FOLDER / f"{name}.toml") for name in ORDER}
    found = {name: SystemMeshErrors(system) for name, system in systems.items() if has_mesh(system)}
    errors = {
        name: [each.of(polygons) for polygons in PAPER_POLYGON_COUNTS]
        for name, each in found.items()
    }
    return errors, {name: auto_polygons(systems[name]) for name in errors}


def image_of(name: str, polygons: int | None = None) -> Image.Image:
    """Image of the scene by an example."""
    sensor = OmniCamera(system_of(name), polygons=polygons, supersampling=SUPERSAMPLING)
    x, y, z = VIEWPOINT_M
    with open_sensor(load_scene(SCENE), sensor, backend="rays") as renderer:
        frame = renderer.render(sensor.base_pose((x, y, HEIGHTS_M.get(name, z)), yaw_deg=YAW_DEG))
    pixels = np.where(frame.valid[..., None], frame.rgb, np.array(OUTSIDE, dtype=np.uint8))
    return Image.fromarray(pixels)


def strip_of(image: Image.Image, radius_px: float) -> Image.Image:
    """Image unrolled about its middle: a column an azimuth, clockwise, the rim on top."""
    radii = radius_px * np.arange(STRIP_RADII[1], STRIP_RADII[0], -1.0 / radius_px)
    columns = round(2.0 * np.pi * radii.mean())
    azimuths = np.arange(columns) * (2.0 * np.pi / columns)
    middle = 0.5 * (np.array(image.size) - 1.0)
    rays = np.stack((np.cos(azimuths), -np.sin(azimuths)), axis=-1)  # clockwise from above
    pixels = np.asarray(image)
    at = middle + radii[:, None, None] * rays
    corner, weights, _ = corner_and_weights(at, pixels.shape[:2])
    channels = [interpolate(pixels[..., channel], corner, weights) for channel in range(3)]
    return Image.fromarray(np.stack(channels, axis=-1).round().astype(np.uint8))


def _save(image: Image.Image, name: str) -> None:
    save_jpeg(image, IMAGES / f"{name}.jpg", MAX_BYTES)


def _save_plot(figure: Figure, name: str) -> None:
    data = io.BytesIO()
    figure.savefig(data, format="png")
    few = Image.open(data).convert("RGB").quantize(PLOT_COLORS, dither=Image.Dither.NONE)
    few.save(data := io.BytesIO(), "PNG", optimize=True)
    write_image_file(IMAGES / f"{name}-plot.png", data.getvalue())


def _meshes() -> Image.Image:
    images = {
        f"{polygons} polygons" if polygons else "exact": image_of(MESHED, polygons)
        for polygons in (*PAPER_POLYGON_COUNTS[:4], None)
    }
    sheet = Image.new("RGB", (MESHED_PX * len(images), MESHED_PX + LABEL_PX), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    for number, (label, image) in enumerate(images.items()):
        small = image.resize((MESHED_PX - 4, MESHED_PX - 4), Image.Resampling.LANCZOS)
        sheet.paste(small, (number * MESHED_PX + 2, LABEL_PX))
        middle = (number * MESHED_PX + MESHED_PX // 2, LABEL_PX // 2)
        draw.text(middle, label, "black", font, anchor="mm")
    return sheet


def _save_sheet() -> None:
    """Save the images of all examples on one sheet."""
    tiles = []
    for name in (*ORDER, f"{STRIP}-strip"):
        image = Image.open(IMAGES / f"{name}.jpg")
        image.thumbnail((SHEET_PX, SHEET_PX), Image.Resampling.LANCZOS)
        cell = Image.new("RGB", (SHEET_PX, SHEET_PX), OUTSIDE)
        cell.paste(image, ((SHEET_PX - image.width) // 2, (SHEET_PX - image.height) // 2))
        tiles.append((name, np.asarray(cell)))
    sheet = Image.fromarray(contact_sheet(tiles, SHEET_COLUMNS))
    save_jpeg(sheet, IMAGES / SHEET, 4 * MAX_BYTES)


def main() -> None:
    """Render all images and write the page; with --page only that."""
    IMAGES.mkdir(exist_ok=True)
    errors, chosen = mesh_errors()
    (FOLDER / "README.md").write_text(page(errors, chosen), encoding="utf-8")
    if sys.argv[1:] == ["--page"]:
        return
    for name in ORDER:
        image, system = image_of(name), read_optics_file(FOLDER / f"{name}.toml")
        _save(image, name)
        _save_plot(optics_figure(f"{name}.toml", system), name)
        if name == STRIP:
            exact = system_of(name).all_rays().valid[image.height // 2]
            _save(strip_of(image, 0.5 * float(exact.sum())), f"{name}-strip")
        print(f"{name}: {image.width} × {image.height} px")
    _save(_meshes(), "mesh")
    _save_sheet()


if __name__ == "__main__":
    main()
