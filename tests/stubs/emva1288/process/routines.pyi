from typing import Any

from numpy.typing import NDArray

def get_int_imgs(imgs: list[NDArray[Any]]) -> dict[str, Any]: ...
