"""Raw files in Adobe's DNG 1.4, uncompressed, as LibRaw reads them."""

import struct

import numpy as np

_BYTE, _ASCII, _SHORT, _LONG, _SRATIONAL = 1, 2, 3, 4, 10


def write_dng(path, mosaic, black, white):
    """Write a mosaic (height, width) uint16 with red in its first pixel."""
    height, width = mosaic.shape
    identity = np.stack((np.eye(3).ravel(), np.ones(9)), axis=1).astype("<i4").tobytes()
    data = mosaic.astype("<u2").tobytes()
    entries = [
        (254, _LONG, 1, struct.pack("<I", 0)),
        (256, _LONG, 1, struct.pack("<I", width)),
        (257, _LONG, 1, struct.pack("<I", height)),
        (258, _SHORT, 1, struct.pack("<H", 16)),
        (259, _SHORT, 1, struct.pack("<H", 1)),  # uncompressed
        (262, _SHORT, 1, struct.pack("<H", 32803)),  # color filter array
        (271, _ASCII, 8, b"omnisim\0"),
        (272, _ASCII, 8, b"omnisim\0"),
        (273, _LONG, 1, None),
        (277, _SHORT, 1, struct.pack("<H", 1)),
        (278, _LONG, 1, struct.pack("<I", height)),
        (279, _LONG, 1, struct.pack("<I", len(data))),
        (33421, _SHORT, 2, struct.pack("<HH", 2, 2)),
        (33422, _BYTE, 4, bytes([0, 1, 1, 2])),
        (50706, _BYTE, 4, bytes([1, 4, 0, 0])),
        (50708, _ASCII, 8, b"omnisim\0"),
        (50714, _SHORT, 1, struct.pack("<H", black)),
        (50717, _LONG, 1, struct.pack("<I", white)),
        (50721, _SRATIONAL, 9, identity),
        (50778, _SHORT, 1, struct.pack("<H", 21)),  # daylight
    ]
    tail_at = 8 + 2 + 12 * len(entries) + 4
    tails = b"".join(entry[3] for entry in entries if entry[3] is not None and len(entry[3]) > 4)
    image_at, position = tail_at + len(tails), tail_at
    table = struct.pack("<H", len(entries))
    for tag, kind, count, value in entries:
        stored = struct.pack("<I", image_at) if value is None else value
        if len(stored) > 4:
            stored, position = struct.pack("<I", position), position + len(stored)
        table += struct.pack("<HHI", tag, kind, count) + stored.ljust(4, b"\0")
    path.write_bytes(b"II*\0" + struct.pack("<I", 8) + table + bytes(4) + tails + data)
