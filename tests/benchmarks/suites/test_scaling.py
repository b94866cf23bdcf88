"""The suite of growing frames, run as little as can be: no times, only what must be there."""

import dataclasses

import numpy as np
import pytest

from benchmarks.embree_rays import EmbreeRays, has_embree
from benchmarks.options import Options
from benchmarks.peers import quality
from benchmarks.report import check
from benchmarks.suites import scaling
from benchmarks.town import build_town
from omnisim import OmniCamera, Renderer, open_sensor
from omnisim.plots.style import write_plot


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_every_size_is_timed(tmp_path, monkeypatch):
    coarse = dataclasses.replace(quality.REFERENCE, supersampling=4, texels_per_pixel=4.0)
    monkeypatch.setattr(quality, "REFERENCE", coarse)
    options = Options(rounds=1, warm_up=0, scenes=("rings",))
    sizes, render_batch = {}, Renderer.render_batch

    def batch(renderer, poses):
        sizes.setdefault(id(renderer), set()).add(len(poses))
        return render_batch(renderer, poses)

    monkeypatch.setattr(Renderer, "render_batch", batch)
    report = scaling.run(
        options, triangles=(1000,), sizes_px=(32, 64), cameras=(1, 3), batches=(2, 64)
    )
    check(report)
    rows = [(row["against"], row["image_px"], row["cameras"]) for row in report["rows"]]
    assert rows == [
        ("triangles", 360, 1), ("image", 32, 1), ("image", 64, 1), ("cameras", 360, 1),
        ("cameras", 360, 3), ("batch", 84, 2), ("batch", 84, 64),
    ]  # fmt: skip
    # a renderer whose size of batch changes allocates its atlas anew
    assert sorted(sizes.values(), key=max) == [{2}, {64}]
    batch = report["rows"][-1]
    assert [bound["value"] for bound in report["bounds"][-2:]] == [
        batch["batch_ratio"], batch["batch_processor_ratio"]
    ]  # fmt: skip
    assert batch["images_per_second"] == pytest.approx(64 * batch["fps"])
    assert report["rows"][0]["triangles"] == build_town(1000).triangle_count
    town = report["rows"][0]
    assert 0 < town["seen_triangles"] < town["submitted_triangles"]
    assert town["seen_triangles"] < town["triangles"]
    if has_embree():
        assert report["bounds"][0]["value"] == town["embree_ratio"]
        assert town["as_good_psnr_db"] >= town["embree_psnr_db"] > 10.0
    assert len(scaling.lines(report)) >= 1 + len(rows)
    write_plot(tmp_path / "scaling.png", scaling.figure(report))
    assert (tmp_path / "scaling.png").stat().st_size > 0


def test_without_embree_nothing_is_compared_with_it(monkeypatch, needs_opengl):
    monkeypatch.setattr(scaling, "has_embree", lambda: False)
    report = scaling.run(
        Options(1, 0, scenes=("rings",)),
        triangles=(1000,),
        sizes_px=(32,),
        cameras=(1,),
        batches=(1,),
    )
    check(report)
    assert not any("Embree" in bound["name"] for bound in report["bounds"])
    assert any("embreex is not installed" in line for line in scaling.lines(report))


def test_slow_variants_have_fewer_rounds():
    options = Options(30, 20)
    fewer = [scaling._town_options(options, count) for count in (1000, 1_000_000, 5_000_000)]
    assert [(one.rounds, one.warm_up) for one in fewer] == [(30, 20), (10, 6), (6, 1)]


def test_embree_hits_visible_triangles(needs_opengl):
    if not has_embree():
        pytest.skip("embreex, the ray caster to compare with, is missing")
    scene, sensor = build_town(1000), OmniCamera(polygons=None).resized(120)
    eye = scaling.STREET[0]
    rays = EmbreeRays(scene, sensor.model)
    with open_sensor(scene, sensor) as renderer:
        frame = renderer.render(eye, also=("range",))
    assert rays.count == frame.valid.sum()
    hit = rays.cast(eye) >= 0
    seen = np.isfinite(frame.channels["range"][frame.valid])
    # at silhouettes the last bit decides: a ray in five thousand
    assert np.mean(hit == seen) > 0.999
