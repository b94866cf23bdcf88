"""Hashes of builders of scenes and of their files.

Quick tests build a scene anew only if its hash is not the recorded one. After a change:
python -m tests.scene.builder_hashes
"""

import hashlib
import json
from pathlib import Path

SCENES = Path(__file__).resolve().parents[2] / "scenes"
RECORD = Path(__file__).with_name("builder_hashes.json")
BUILT = sorted(path.parent.name for path in SCENES.glob("*/build.py"))


def builder_hash(name):
    """SHA-256 of the modules and settings that build a scene, and of its file."""
    patterns = ("modeling/*.py", f"{name}/*.py", f"{name}/*.toml", f"{name}/{name}.glb")
    digest = hashlib.sha256()
    for path in sorted(path for pattern in patterns for path in SCENES.glob(pattern)):
        digest.update(path.relative_to(SCENES).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def is_recorded(name):
    """Compare the hash of a scene with that of its last recorded build."""
    return json.loads(RECORD.read_text(encoding="utf-8")).get(name) == builder_hash(name)


if __name__ == "__main__":
    hashes = {name: builder_hash(name) for name in BUILT}
    RECORD.write_text(json.dumps(hashes, indent=1) + "\n", encoding="utf-8")
