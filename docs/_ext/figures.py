"""Figures of the explanation, drawn from the code that they explain.

`python docs/_ext/figures.py` writes all of them, also those of `architecture_figures.py`.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from omnisim.cameras.mirrors import HyperbolicMirror

_INK, _RAY, _MIRROR = "#555", "#c33", "#28c"


def write_figures(folder: Path) -> None:
    """Write the figures into a folder as SVG."""
    folder.mkdir(exist_ok=True)
    settings = {"svg.hashsalt": "omnisim", "svg.fonttype": "none", "font.size": 9}
    with plt.rc_context(settings):
        for name, draw in (("optics", _optics), ("frames", _frames)):
            figure = draw()
            figure.savefig(
                folder / f"{name}.svg", metadata={"Date": None}, bbox_inches="tight",
                facecolor="white",
            )  # fmt: skip
            plt.close(figure)


def _optics() -> plt.Figure:
    """A section through the mirror: heights up, although the mirror frame's z points down."""
    mirror = HyperbolicMirror()
    theta = np.linspace(0.0, mirror.theta_max_rad, 200)
    rho = mirror.rho_m(theta) * 1e3
    x, z = rho * np.sin(theta), -rho * np.cos(theta)
    pinhole = -mirror.c_m * 1e3
    figure, axes = plt.subplots(figsize=(6.4, 4.6))
    axes.plot(np.r_[-x[::-1], x], np.r_[z[::-1], z], color=_MIRROR, lw=2.5)
    for angle in np.radians([20.0, 45.0, 70.0, 90.0, 100.0]):
        on_mirror = (
            float(mirror.rho_m(np.array(angle))) * 1e3 * np.array([np.sin(angle), -np.cos(angle)])
        )
        away = 34.0 * np.array([np.sin(angle), -np.cos(angle)])
        axes.plot(*zip(away, on_mirror, (0.0, pinhole), strict=True), color=_RAY, lw=0.9)
        axes.plot(*zip(on_mirror, (0.0, 0.0), strict=True), color=_RAY, lw=0.9, ls=":")
        axes.annotate(f"{np.degrees(angle):.0f}°", away, color=_RAY, ha="left", va="center")
    axes.plot([0.0, 0.0], [0.0, pinhole], "o", color=_INK, ms=5)
    axes.annotate("effective viewpoint", (0.0, 0.0), (-30.0, 6.0), arrowprops={"arrowstyle": "-"})
    axes.annotate("pinhole", (0.0, pinhole), (-22.0, pinhole), arrowprops={"arrowstyle": "-"})
    axes.annotate("mirror", (x[-1] * -1.0, z[-1]), (-26.0, -12.0), color=_MIRROR)
    axes.axhline(0.0, color=_INK, lw=0.5, ls="--")
    axes.set(aspect="equal", xlabel="mm", ylabel="mm", xlim=(-36.0, 40.0), ylim=(-100.0, 12.0))
    axes.set_title("Rays towards the effective viewpoint meet in the pinhole")
    return figure


def _frames() -> plt.Figure:
    """World, base, rig and optical frame of a vehicle whose camera looks up at its mirror."""
    figure = plt.figure(figsize=(6.4, 4.6))
    axes = figure.add_subplot(projection="3d")
    base, rig = np.array([0.6, 1.0, 0.0]), np.array([0.6, 1.0, 0.7])
    axes.plot(*zip(base, rig, strict=True), color=_INK, lw=1.0)
    turn = np.radians(25.0)
    yaw = np.array(
        [[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0, 0, 1]]
    )
    from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP

    for name, origin, rotation, length in (
        ("world", np.zeros(3), np.eye(3), 0.5),
        ("base", base, yaw, 0.5),
        ("rig", rig, yaw, 0.4),
        ("optical", rig + [0.0, 0.0, 0.6], yaw @ RIG_FROM_OPTICAL_LOOKING_UP, 0.35),
    ):
        for axis, color, letter in zip(rotation.T, ("#d33", "#2a2", "#33d"), "xyz", strict=True):
            axes.quiver(*origin, *(length * axis), color=color, arrow_length_ratio=0.2, lw=1.8)
            axes.text(*(origin + 1.2 * length * axis), letter, color=color)
        axes.text(*(origin - [0.0, 0.08, 0.05]), name, ha="right")
    axes.set(xlim=(0.0, 1.6), ylim=(-0.3, 1.3), zlim=(0.1, 1.6), aspect="equal")
    axes.set_axis_off()
    axes.view_init(elev=24.0, azim=-28.0)
    return figure


if __name__ == "__main__":
    from architecture_figures import FOLDER, figures

    write_figures(FOLDER)
    for path, text in figures():
        path.write_text(text, encoding="utf-8")
