"""Table of all commands, by the headings of `omnisim --help`."""

from omnisim.apps.cli.command import Entry, GroupEntry

COMMANDS: dict[str, dict[str, Entry | GroupEntry]] = {
    "Images": {
        "render": Entry(
            "Render a frame, or a rig along a trajectory, with ground truth.",
            "images.render.run", "images.requests.RenderRequest",
        ),
        "live": Entry(
            "Serve a live page: a camera in the browser, driven by keys, with all its parameters.",
            "images.live.run", "images.requests.LiveRequest",
        ),
        "unwarp": Entry(
            "Unwarp an omnidirectional image to a cylinder, a perspective view or a map.",
            "images.unwarp.run", "images.requests.UnwarpRequest",
        ),
        "scan": Entry(
            "Simulate one scan of a laser scanner, a SICK LMS200.",
            "images.scan.run", "images.requests.ScanRequest",
        ),
    },
    "Runs": {
        "drive": Entry(
            "Drive a robot along a path and record images, scans, odometry and ground truth.",
            "runs.drive.run", "runs.requests.DriveRequest",
        ),
        "evaluate": Entry(
            "Apply odometry and SLAM methods to a run, and report their errors; exits with 1 if "
            "all fail.",
            "runs.evaluate.run", "runs.requests.EvaluateRequest",
        ),
        "plot": Entry(
            "Plot a run from above: map, path, odometry, landmarks, images.",
            "runs.plot.run", "runs.requests.PlotRequest", "plots",
        ),
        "video": Entry(
            "Encode the images of a run as a video.",
            "images.video.run", "runs.requests.VideoRequest", "video",
        ),
        "export": Entry(
            "Export a run for other tools: ROS 2 bags, data sets, structure from motion.",
            "runs.export.run", "runs.requests.ExportRequest",
        ),
        "localize": Entry(
            "Localize the robot of a run from its odometry and the landmarks in its images.",
            "runs.localize.run", "runs.requests.LocalizeRequest", "reports",
        ),
        "landmarks": GroupEntry(
            "Learn the colors of landmarks, and detect them.",
            {
                "train": Entry(
                    "Learn the colors from a run recorded with --also instance.",
                    "runs.landmarks.train", "runs.requests.TrainRequest",
                ),
                "detect": Entry(
                    "Detect landmarks with range and bearing in an image, or in all images of a "
                    "run.",
                    "runs.landmarks.detect", "runs.requests.DetectRequest",
                ),
            },
        ),
        "robot": GroupEntry(
            "Robots: list, show, check, or import from USARSim, Gazebo, URDF or MuJoCo.",
            {
                "list": Entry("List the built-in robots.", "runs.robot.list_robots"),
                "show": Entry(
                    "Print a robot file, to save and edit: what it extends is merged into it, and "
                    "names of files are absolute.",
                    "runs.robot.show_robot", "runs.requests.CheckRequest",
                ),
                "check": Entry(
                    "Check a robot file with its body and sensors, and summarize it.",
                    "runs.robot.check_robot", "runs.requests.CheckRequest",
                ),
                "import": Entry(
                    "Convert a robot of USARSim, Gazebo, URDF or MuJoCo to a robot file.",
                    "runs.robot.import_robot", "runs.requests.ImportRequest",
                ),
            },
        ),
    },
    "Data sets": {
        "generate": Entry(
            "Generate a data set from a plan: deterministic shards, reproducible by index.",
            "datasets.generate.run", "datasets.requests.GenerateRequest",
        ),
        "dataset": GroupEntry(
            "Data sets: summarize, check the hashes, view samples, convert.",
            {
                "info": Entry(
                    "Summarize a data set: samples, scenes, cameras, channels, size.",
                    "datasets.dataset.info", "datasets.requests.DatasetInfoRequest",
                ),
                "check": Entry(
                    "Compare the hash of each shard with the manifest.",
                    "datasets.dataset.check", "datasets.requests.DatasetCheckRequest",
                ),
                "convert": Entry(
                    "Write a data set in another layout: COCO's, YOLO's, KITTI-360's, "
                    "nerfstudio's or COLMAP's.",
                    "datasets.dataset.convert", "datasets.requests.DatasetConvertRequest",
                ),
                "view": Entry(
                    "Write a sheet of samples with their channels.",
                    "datasets.dataset.view", "datasets.requests.DatasetViewRequest",
                ),
            },
        ),
    },
    "Worlds": {
        "scene": GroupEntry(
            "Scenes: summarize (`omnisim scene SCENE`), or convert to GLB.",
            {
                "show": Entry(
                    "Summarize a scene: instances, bounds, floors, starts, paths, lights, classes.",
                    "worlds.scene.run", "worlds.requests.SceneRequest",
                ),
                "convert": Entry(
                    "Write a scene of any format as GLB: instances, materials, textures, lights.",
                    "worlds.scene_convert.run", "worlds.requests.SceneConvertRequest",
                ),
            },
        ),
        "bake": Entry(
            "Bake a scene's light: shadows, sky and bounces on all static surfaces.",
            "worlds.bake.run", "worlds.requests.BakeRequest",
        ),
    },
    "Cameras": {
        "sensor": Entry(
            "Print the default sensor file with a comment per key, or check a sensor file.",
            "cameras.sensor.run", "cameras.requests.SensorRequest",
        ),
        "mirror": Entry(
            "Write the mirror's mesh, textured for the unfolded cube, to open in Blender.",
            "cameras.mirror.run", "cameras.requests.MirrorRequest",
        ),
        "calibration": GroupEntry(
            "Calibration files of other tools: convert, show, list the formats.",
            {
                "convert": Entry(
                    "Convert a calibration to another format, exactly or by the best fit, with "
                    "its residual.",
                    "cameras.calibration.convert", "cameras.requests.ConvertRequest",
                ),
                "show": Entry(
                    "Show the cameras of a calibration file: model, parameters, field of view, "
                    "valid domain.",
                    "cameras.calibration.show", "cameras.requests.ShowRequest",
                ),
                "formats": Entry(
                    "List the formats, and the camera models that each represents exactly.",
                    "cameras.calibration.list_formats",
                ),
            },
        ),
        "measure": GroupEntry(
            "Measure a camera from its own images.",
            {
                "plan": Entry(
                    "Measure a camera part by part by a plan, and write a report.",
                    "measure.measure_plan.plan", "measure.requests.MeasurePlanRequest",
                ),
                "geometry": Entry(
                    "Measure a camera's model from images of a calibration board.",
                    "measure.measure_geometry.geometry",
                    "measure.requests.MeasureGeometryRequest",
                ),
                "compare": Entry(
                    "Compare a camera's images of a board or a scene with its sensor file's.",
                    "measure.measure_compare.compare",
                    "measure.requests.MeasureCompareRequest",
                ),
                "noise": Entry(
                    "Measure gain, noise and fixed pattern from dark frames and flat fields.",
                    "measure.measure_noise.noise", "measure.requests.MeasureNoiseRequest",
                ),
                "response": Entry(
                    "Measure response and vignetting from exposure series and flat fields.",
                    "measure.measure_response.response",
                    "measure.requests.MeasureResponseRequest",
                ),
                "timing": Entry(
                    "Measure readout and exposure from a flickering lamp or a turning board.",
                    "measure.measure_timing.timing",
                    "measure.requests.MeasureTimingRequest",
                ),
                "sharpness": Entry(
                    "Measure point spread and lateral color over the field from slanted edges.",
                    "measure.measure_sharpness.sharpness",
                    "measure.requests.MeasureSharpnessRequest",
                ),
            },
        ),
        "optics": GroupEntry(
            "Non-central optical systems: check, plot, design, calibrate.",
            {
                "check": Entry(
                    "Check an optical system, and measure the errors of its central approximation "
                    "by distance.",
                    "cameras.optics.check", "cameras.requests.OpticsCheckRequest",
                ),
                "plot": Entry(
                    "Plot an optical system: profile, rays, caustic, resolution by image radius.",
                    "cameras.optics.plot", "cameras.requests.OpticsPlotRequest", "plots",
                ),
                "rays": Entry(
                    "Write the ray of each pixel, origin and direction, as a table.",
                    "cameras.optics.rays", "cameras.requests.OpticsRaysRequest",
                ),
                "design": Entry(
                    "Design a mirror's profile: constant resolution by angle, or on the ground.",
                    "cameras.optics.design", "cameras.requests.OpticsDesignRequest",
                ),
                "profile": Entry(
                    "Write the profile of a surface, for a lathe.",
                    "cameras.optics.profile", "cameras.requests.OpticsProfileRequest",
                ),
                "calibrate": Entry(
                    "Fit an optical system's parameters to the corners of a board in images.",
                    "cameras.optics_calibration.calibrate",
                    "cameras.requests.OpticsCalibrateRequest",
                ),
            },
        ),
    },
    "Checks": {
        "doctor": Entry(
            "Examine OpenGL on this machine step by step, and say what to do; exits with 1 if a "
            "step fails.",
            "checks.doctor.run", "checks.requests.DoctorRequest",
        ),
        "schema": Entry(
            "Print the JSON Schema of a TOML file, for editors.",
            "checks.schema.run", "checks.requests.SchemaRequest",
        ),
        "info": Entry(
            "Show versions, built-in scenes, and the GPUs that can render.", "info.run"
        ),
        "validate": Entry(
            "Validate the geometry against the paper's figures and independent oracles; exits with "
            "1 if a tolerance is exceeded.",
            "checks.validate.run", "checks.requests.ValidateRequest", "reports",
        ),
        "experiments": Entry(
            "Repeat the paper's experiments in self-localization; exits with 1 if a tolerance is "
            "exceeded.",
            "checks.experiments.run", "checks.requests.ExperimentsRequest", "reports",
        ),
    },
}  # fmt: skip
