"""Files of a page, which servers of streams answer on their own port by plain HTTP."""

from __future__ import annotations

import gzip
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

PAGES = Path(__file__).with_name("pages")
SHARED = PAGES / "shared"  # style, views, map, keys and stream of all pages
MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".jpg": "image/jpeg",
}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' ws: wss:; style-src 'self' 'unsafe-inline'; frame-ancestors *",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


@dataclass(frozen=True)
class PageFiles:
    """Files of a page's own folder and of the shared one, at the root of its server."""

    folder: Path

    @cached_property
    def contents(self) -> dict[str, bytes]:
        """Files by URL path."""
        return {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for folder in (SHARED, self.folder)
            for path in sorted(folder.rglob("*"))
            if path.suffix in MEDIA_TYPES
        }

    def answer(self, request: Request) -> Response | None:
        """Answer a request for a file; None: there is no such file."""
        name = request.path.partition("?")[0].removeprefix("/") or "index.html"
        content = self.contents.get(name)
        if content is None:
            return None
        headers = Headers(HEADERS)
        headers["Content-Type"] = MEDIA_TYPES[Path(name).suffix]
        if "gzip" in request.headers.get("Accept-Encoding", "") and not name.endswith(".jpg"):
            content = gzip.compress(content, 6, mtime=0)
            headers["Content-Encoding"] = "gzip"
        headers["Content-Length"] = str(len(content))
        return Response(200, "OK", headers, content)
