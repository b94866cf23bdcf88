class AssetPath:
    path: str
    resolvedPath: str

class Path:
    def HasPrefix(self, prefix: Path) -> bool: ...
    def MakeRelativePath(self, anchor: Path) -> Path: ...
