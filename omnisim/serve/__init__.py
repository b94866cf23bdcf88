"""Live streams: simulated robots for Foxglove, ROS 2 nodes, and programs of any kind.

    omnisim serve soccer --robot p2at

A client is one file, `omnisim.serve.client`:

    with omnisim.serve.connect(topics=["/omnicam/image_raw"]) as robot:
        image = robot.next(timeout_s=10.0).image
        robot.command(0.3, 0.1)

The same loop runs in your own program: `Simulation`, `ServeLoop` and any `Publisher`.
"""

from omnisim.core.lazy_names import lazy_names

TYPE_CHECKING = False
if TYPE_CHECKING:
    from omnisim.serve.client import (
        ServeConnectionError,
        ServedMessage,
        ServedRobotClient,
        connect,
    )
    from omnisim.serve.protocols.plain_publisher import PlainPublisher
    from omnisim.serve.publisher import Client, Controls, Publisher, Topic
    from omnisim.serve.serve_loop import ServeLoop
    from omnisim.serve.served_world import ServeSettings, Simulation

_MODULES = {
    "Client": "publisher",
    "Controls": "publisher",
    "PlainPublisher": "protocols.plain_publisher",
    "Publisher": "publisher",
    "ServeConnectionError": "client",
    "ServeLoop": "serve_loop",
    "ServeSettings": "served_world",
    "ServedMessage": "client",
    "ServedRobotClient": "client",
    "Simulation": "served_world",
    "Topic": "publisher",
    "connect": "client",
}
__all__ = [
    "Client", "Controls", "PlainPublisher", "Publisher", "ServeConnectionError", "ServeLoop",
    "ServeSettings", "ServedMessage", "ServedRobotClient", "Simulation", "Topic", "connect",
]  # fmt: skip
__getattr__ = lazy_names(__name__, _MODULES)
