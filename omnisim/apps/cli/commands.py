"""Names of all commands by the headings of `omnisim --help`, and where their requests are."""

# By heading and name: the folder whose module `requests` has the command, or those of the group.
COMMANDS: dict[str, dict[str, str]] = {
    "Images": dict.fromkeys(("render", "live", "unwarp", "scan"), "images"),
    "Runs": dict.fromkeys(
        ("drive", "record", "evaluate", "plot", "video", "export", "localize", "landmarks",
         "robot"),
        "runs",
    ),
    "Data sets": dict.fromkeys(("generate", "dataset"), "datasets"),
    "Worlds": dict.fromkeys(("scene", "bake"), "worlds"),
    "Cameras": dict.fromkeys(("sensor", "mirror", "calibration"), "cameras")
    | {"measure": "measure", "optics": "cameras"},
    "Checks": dict.fromkeys(("doctor", "schema", "info", "validate", "experiments"), "checks"),
}  # fmt: skip
GROUPS = {  # help texts of the groups
    "landmarks": "Learn the colors of landmarks, and detect them.",
    "robot": "Robots: list, show, check, or import from USARSim, Gazebo, URDF or MuJoCo.",
    "dataset": "Data sets: summarize, check the hashes, view samples, convert.",
    "scene": "Scenes: summarize (`omnisim scene SCENE`), or convert to GLB.",
    "calibration": "Calibration files of other tools: convert, show, list the formats.",
    "measure": "Measure a camera from its own images.",
    "optics": "Non-central optical systems: check, plot, design, calibrate.",
}
