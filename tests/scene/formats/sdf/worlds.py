"""Small worlds for the tests."""

from omnisim.scene import load_scene


def visual(geometry: str, name: str = "visual", rest: str = "") -> str:
    return f'<visual name="{name}"><geometry>{geometry}</geometry>{rest}</visual>'


def model(name: str, inner: str, rest: str = "") -> str:
    return f'<model name="{name}">{rest}<link name="link">{inner}</link></model>'


def sdf(inner: str, version: str = "1.9") -> str:
    return f'<?xml version="1.0"?>\n<sdf version="{version}">{inner}</sdf>'


def world(inner: str, version: str = "1.9") -> str:
    return sdf(f'<world name="default">{inner}</world>', version)


def load(folder, text, **options):
    path = folder / "test.world"
    path.write_text(text)
    return load_scene(path, **options)


def write_model(folder, name: str, inner: str, config: str | None = None) -> None:
    """Model in a folder of its own, with its `model.config`."""
    place = folder / name
    place.mkdir(parents=True)
    (place / "model.sdf").write_text(sdf(inner))
    text = f"<model><name>{name}</name><sdf version='1.9'>model.sdf</sdf></model>"
    (place / "model.config").write_text(config or text)


BOX = "<box><size>1 1 1</size></box>"
