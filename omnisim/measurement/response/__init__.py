"""Response and vignetting of a camera, from images by exposure time and flat fields."""

from omnisim.measurement.response.light_falloff import MeasuredVignetting, measure_vignetting
from omnisim.measurement.response.response_curve import MeasuredResponse, measure_response

__all__ = ["MeasuredResponse", "MeasuredVignetting", "measure_response", "measure_vignetting"]
