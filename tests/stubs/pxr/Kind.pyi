class Registry:
    @staticmethod
    def IsA(kind: str, base: str) -> bool: ...

class Tokens:
    component: str
