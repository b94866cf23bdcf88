"""Setups: light and cameras shared by successive samples, as functions of seed and number.

Opening a scene under another light, or opening another camera, takes as long as rendering several
images. A setup therefore lasts for `vary.images_per_setup` images. Invalid setups are drawn again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.datasets.generate.distributions import Stream
from omnisim.datasets.generate.plan_cameras import PlanRig
from omnisim.datasets.generate.plan_light import DrawnLight, draw_light
from omnisim.datasets.generate.prepared_plan import PreparedPlan

_LIGHT, _CAMERA = 16, 32  # purposes of streams, above those of samples: one per rig
ATTEMPTS = 20
T = TypeVar("T")


def setup_light(prepared: PreparedPlan, scene: int, setup: int) -> DrawnLight:
    """Scene of the plan with the light of a setup.

    Raises:
        OmnisimError: a faulty scene, or no valid light was drawn.
    """
    vary, own = prepared.plan.vary, prepared.scene(scene)
    if not vary.lights:
        return DrawnLight(own, {})
    return _draw(
        prepared, setup, _LIGHT, lambda stream: draw_light(own, vary, stream, prepared.path)
    )


def setup_rig(prepared: PreparedPlan, rig: int, setup: int) -> PlanRig:
    """Rig of the plan with the parameters of a setup.

    Raises:
        OmnisimError: a faulty file of the rig, or no valid parameters were drawn.
    """
    file = prepared.rig_files[rig]
    if not file.table.varies:
        return prepared.rigs[rig]
    return _draw(prepared, setup, _CAMERA + rig, file.rig)


def _draw(prepared: PreparedPlan, setup: int, purpose: int, make: Callable[[Stream], T]) -> T:
    """Result of `make` with the first stream that gives a valid one.

    Raises:
        PlanError: no draw was valid.
    """
    fault = ""
    for attempt in range(ATTEMPTS):
        try:
            return make(Stream(prepared.plan.seed, setup, attempt, purpose))
        except OmnisimError as reason:
            fault = str(reason).partition("\n")[0]
    raise PlanError(f"{fault} (setup {setup}, drawn {ATTEMPTS} times)")
