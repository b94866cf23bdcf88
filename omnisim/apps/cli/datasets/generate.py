"""`omnisim generate`."""

from __future__ import annotations

import re

from omnisim.apps.cli.console import out, pluralize, print_note, progress, resumable, track
from omnisim.apps.cli.datasets.requests import GenerateRequest
from omnisim.apps.cli.options import words_of
from omnisim.core.errors import OmnisimError, OutputError, PlanError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_distinct, check_target
from omnisim.core.files.image_files import write_image
from omnisim.datasets.generate.generate import Generation, estimate
from omnisim.datasets.generate.prepared_plan import PreparedPlan
from omnisim.datasets.generate.sample_renderer import SampleRenderer
from omnisim.plots.sample_sheet import SampleTiles, channel_tile, sample_sheet

SHARDS = re.compile(r"(\d{1,9})(?::(\d{1,9}))?")


def run(request: GenerateRequest) -> None:
    """Generate a data set, or run one of its trials."""
    if request.address is not None and request.engine != "ray":
        raise PlanError("--address: requires --engine ray")
    trials = {"--check": _check, "--preview": _preview, "--map": _map, "--estimate": _estimate}
    asked = [word for word in words_of(request.trial) if word in trials]
    if len(asked) > 1:
        raise PlanError(f"{', '.join(asked)}: expected one of them")
    run_asked = trials[asked[0]] if asked else _generate
    run_asked(request)


def parse_shards(text: str | None) -> range | None:
    """Parse --shards: `3` or `0:100`, where the last is excluded; None: all shards."""
    if text is None:
        return None
    match = SHARDS.fullmatch(text)
    if match is None:
        raise PlanError(f"--shards: expected FROM:TO or a number, got {text!r}")
    first = int(match[1])
    shards = range(first, first + 1 if match[2] is None else int(match[2]))
    if not shards:
        raise PlanError(f"--shards: expected FROM less than TO, got {text!r}")
    return shards


def _check(request: GenerateRequest) -> None:
    prepared = PreparedPlan.read(request.plan)
    prepared.check()
    plan = prepared.plan
    for notice in prepared.notices():
        print_note(notice)
    for number in range(len(plan.scenes)):
        scene = prepared.scene(number)
        if plan.viewpoints.where == "free":
            free = prepared.free_space(number)
            out.print(f"{scene.name}: {free.area_m2:.1f} m² of free floor")
    out.print(
        f"{request.plan}: {pluralize(plan.images, 'sample')} in "
        f"{pluralize(plan.shards, 'shard')}; plan {prepared.fingerprint}"
    )


def _preview(request: GenerateRequest) -> None:
    if request.output is None or request.output.suffix.lower() not in (".png", ".jpg"):
        raise OutputError("-o: expected a .png or .jpg for the preview's sheet")
    check_target(request.output)
    prepared = PreparedPlan.read(request.plan)
    prepared.check_setups()
    count = min(request.trial.preview or 1, prepared.plan.images)
    renderer = SampleRenderer(prepared, request.gpu.device)
    samples: dict[int, SampleTiles] = {}
    try:
        for number in track(renderer.order(range(count)), "preview", count):
            frame = next(iter(renderer.render(number).frames.values()))
            channels = [
                channel_tile(name, values, frame.labels) for name, values in frame.channels.items()
            ]
            samples[number] = SampleTiles(f"sample {number}", [("rgb", frame.rgb), *channels])
    finally:
        renderer.close()
    sheet = sample_sheet([samples[number] for number in sorted(samples)])
    write_image(request.output, sheet)
    out.print(f"{request.output}: {pluralize(count, 'sample')}")


def _map(request: GenerateRequest) -> None:
    require_extra("plots", "--map")
    from omnisim.plots.plan_map import plan_figure
    from omnisim.plots.style import check_plot_target, write_plot

    if request.output is None:
        raise OutputError("-o: expected a .png, .pdf or .svg for the map")
    check_plot_target(request.output)
    check_distinct({"-o": request.output}, {"the plan": request.plan})
    write_plot(request.output, plan_figure(PreparedPlan.read(request.plan)))
    out.print(f"{request.output}: free floors and positions")


def _estimate(request: GenerateRequest) -> None:
    estimated = estimate(request.plan, request.workers, request.gpu.device)
    seconds = estimated.seconds
    hours, minutes = f"{seconds / 3600.0:.1f} hours", f"{seconds / 60.0:.1f} minutes"
    time = hours if seconds >= 3600.0 else minutes if seconds >= 60.0 else f"{seconds:.0f} seconds"
    out.print(
        f"{request.plan}: {pluralize(estimated.samples, 'sample')}, "
        f"{estimated.samples * estimated.sample_bytes / 1e9:.3g} GB, {time} by "
        f"{pluralize(request.workers, 'worker')}: {estimated.samples_per_s:.1f} samples/s after "
        f"{estimated.start_s:.1f} s"
    )


def _generate(request: GenerateRequest) -> None:
    if request.output is None:
        raise OutputError("-o: missing: expected the folder of the data set")
    shards = parse_shards(request.shards)
    generation = Generation(
        request.plan, request.output, shards, request.workers, request.gpu.device
    )
    for notice in generation.prepared.notices():
        print_note(notice)
    if request.engine == "ray":
        require_extra("ray", "omnisim generate --engine ray")
        from omnisim.datasets.generate.ray_cluster import make_shards_on_ray

        steps = make_shards_on_ray(generation.job, generation.missing, request.address)
    else:
        steps = generation.run()
    each = generation.prepared.plan.images_per_shard
    total, done = each * len(generation.missing), dict[int, int]()  # samples, in all and by shard

    def state() -> str:
        whole = sum(count == each for count in done.values())
        made = f"{whole} of {pluralize(len(generation.missing), 'shard')} made"
        return f"{request.output}: {made}: run the same command to resume"

    try:
        with progress(request.plan.stem, total, "samples") as show, resumable(state):
            for step in steps:
                samples = min(done.get(step.shard, 0) + 1, each)
                done[step.shard] = each if step.is_whole else samples
                show(sum(done.values()), "")
    except OmnisimError:
        generation.give_up()
        raise
    manifest = generation.finish()
    made, existing = len(generation.missing), len(generation.shards) - len(generation.missing)
    before = f", {existing} of them made before" if existing else ""
    planned = generation.prepared.plan.shards
    rest = "" if manifest else f"; the plan's other shards, of {planned} in total, are missing"
    size = f"; {manifest.size_bytes / 1e6:.1f} MB" if manifest else ""
    redrawn = manifest.statistics.redrawn if manifest else 0
    again = f"; {pluralize(redrawn, 'sample')} redrawn" if redrawn else ""
    out.print(f"{request.output}: {pluralize(made + existing, 'shard')}{before}{size}{again}{rest}")
