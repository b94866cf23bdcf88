class Error:
    commentary: str

class ErrorException(Exception):
    args: tuple[Error, ...]
