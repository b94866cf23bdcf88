"""Built-in scenes, and mip levels and clusters of scenes, made once per process for all tests."""

import hashlib
from collections import OrderedDict
from pathlib import Path

from omnisim.core.files.sources import SourceReader
from omnisim.core.package_files import SCENES
from omnisim.rendering.opengl.world import clustered_geometry
from omnisim.rendering.opengl.world import scene_textures as textures
from omnisim.scene.files import load

_MAX_SCENES = 24
_MAX_TEXTURES = 256
_MAX_CLUSTERED = 64


def read_built_in_scenes_once(monkeypatch):
    """Read each built-in scene once with the same options: scenes do not change."""
    build_scene, scenes = load._build, _Recent(_MAX_SCENES)

    def build(files, options, reader, outer=()):
        if not _is_built_in(files.name) or options.resources or options.sky is not None:
            return build_scene(files, options, reader, outer)

        def read():
            own = SourceReader()
            return build_scene(files, options, own, outer), own

        built, own = scenes.get((files.name, repr(options)), read)
        reader.update(own)
        return built

    monkeypatch.setattr(load, "_build", build)


def make_mipmaps_once(monkeypatch):
    """Make the mip levels of the same array of pixels once."""
    make, levels = textures.mipmaps, _Recent(_MAX_TEXTURES)

    def mipmaps(pixels, is_linear=False):
        # the array is kept, so that its id is not used again
        key = id(pixels), is_linear
        return levels.get(key, lambda: (pixels, make(pixels, is_linear)))[1]

    monkeypatch.setattr(textures, "mipmaps", mipmaps)


def cluster_triangles_once(monkeypatch):
    """Cluster the same triangles with the same keys once: clusters do not change."""
    build, hierarchies = clustered_geometry.build_clusters, _Recent(_MAX_CLUSTERED)

    def build_clusters(*arrays):
        digest = hashlib.sha1()
        for array in arrays:
            digest.update(f"{array.dtype} {array.shape}".encode())
            digest.update(array.tobytes())
        return hierarchies.get(digest.digest(), lambda: build(*arrays))

    monkeypatch.setattr(clustered_geometry, "build_clusters", build_clusters)


class _Recent:
    """The most recently used values."""

    def __init__(self, count):
        self._count, self._values = count, OrderedDict()

    def get(self, key, make):
        if key not in self._values:
            self._values[key] = make()
        self._values.move_to_end(key)
        if len(self._values) > self._count:
            self._values.popitem(last=False)
        return self._values[key]


def _is_built_in(source):
    try:
        path = Path(source)
        if path.is_absolute():
            return path.is_relative_to(SCENES)
        return not path.exists() and (SCENES / path / "scene.toml").is_file()
    except (TypeError, OSError):  # no path, or too long a name
        return False
