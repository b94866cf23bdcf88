"""What only omnisim says of a camera, in files of formats that have no word for it.

A remark is one JSON object a camera: in a comment line `# omnisim {…}`, an XML comment, or under
the key `omnisim`, which the formats' own readers leave alone.

| key | |
| --- | --- |
| camera | name of the camera in the file |
| mirrored | true: the file's rays are (x, y, −z) of the camera's, which looks into a mirror |
| turned | true: they are (−x, −y, −z), as an elliptic mirror's |
| theta_max_rad | angle from the axis where the camera's domain ends |
| fitted_from | model of the camera that this one was fitted to |
| rms_px, max_px | how far off the fit is, within cone_deg of the axis |
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import Field

from omnisim.calibration.calibration import Residual
from omnisim.calibration.documents import parse_json
from omnisim.calibration.fields import Foreign, parse
from omnisim.calibration.formats import Format, Remarks
from omnisim.errors import CalibrationError
from omnisim.parameters import Number

_LINES = {
    Remarks.LINES: re.compile(r"^# omnisim (\{.*)$", re.M),
    Remarks.XML: re.compile(r"^<!-- omnisim (\{.*) -->$", re.M),
}
Angle = Annotated[Number, Field(gt=0.0, le=math.pi)]


class Remark(Foreign):
    """One camera's remark."""

    camera: str
    mirrored: Annotated[bool, Field(strict=True)] = False
    turned: Annotated[bool, Field(strict=True)] = False
    theta_max_rad: Angle | None = None
    fitted_from: str | None = None
    rms_px: Number | None = None
    max_px: Number | None = None
    cone_deg: Number | None = None

    @property
    def residual(self) -> Residual | None:
        """The fit, if the camera was fitted."""
        numbers = self.rms_px, self.max_px, self.cone_deg
        if self.fitted_from is None or None in numbers:
            return None
        return Residual(
            float(self.rms_px or 0.0),
            float(self.max_px or 0.0),
            math.radians(self.cone_deg or 0.0),
            self.fitted_from,
        )


def remark_of(
    name: str,
    mirrored: bool,
    turned: bool,
    limit_rad: float | None,
    residual: Residual | None,
) -> dict[str, Any]:
    """A camera's remark; only its name where there is nothing to say."""
    told: dict[str, Any] = {"camera": name}
    if mirrored:
        told["mirrored"] = True
    if turned:
        told["turned"] = True
    if limit_rad is not None:
        told["theta_max_rad"] = limit_rad
    if residual is not None:
        told["fitted_from"] = residual.source_model
        told["rms_px"], told["max_px"] = residual.rms_px, residual.max_px
        told["cone_deg"] = math.degrees(residual.theta_max_rad)
    return told


def with_remarks(text: str, remarks: Sequence[dict[str, Any]], form: Format) -> str:
    """A file's text with the remarks that say something."""
    remarks = [remark for remark in remarks if len(remark) > 1]
    if not remarks:
        return text
    if form.remarks is Remarks.KEY:
        return json.dumps({**json.loads(text), "omnisim": list(remarks)}, indent=2) + "\n"
    opening, closing = ("<!-- ", " -->") if form.remarks is Remarks.XML else ("# ", "")
    # "--" must not be in an XML comment
    lines = ["omnisim " + json.dumps(remark).replace("--", "-\\u002d") for remark in remarks]
    if any(remark.get("mirrored") for remark in remarks):
        lines.append("mirrored: (x, y, z) here is (x, y, -z) of the camera, which faces a mirror")
    return text + "".join(f"{opening}{line}{closing}\n" for line in lines)


def read_remarks(text: str, form: Format, source: str) -> dict[str, Remark]:
    """The remarks of a file, by the cameras' names.

    Raises:
        CalibrationError: one that is none.
    """
    place = f"{source}: omnisim's remark"
    if form.remarks is Remarks.KEY:
        found = parse_json(text, source).get("omnisim", [])
        if not isinstance(found, list):
            raise CalibrationError(f"{place}: want a list")
    else:
        found = [parse_json(line, place) for line in _LINES[form.remarks].findall(text)]
    remarks = (parse(one, Remark, place) for one in found)
    return {remark.camera: remark for remark in remarks}
