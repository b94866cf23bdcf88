"""Response and vignetting of a camera, from images by exposure time and flat fields."""

from omnisim.measurement.response.response_curve import (
    MeasuredResponse,
    MeasuredVignetting,
    measure_response,
    measure_vignetting,
)

__all__ = ["MeasuredResponse", "MeasuredVignetting", "measure_response", "measure_vignetting"]
