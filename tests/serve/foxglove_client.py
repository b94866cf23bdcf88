"""Client of Foxglove's protocol, by websockets and protobuf: nothing of ours or of the SDK's.

Source: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md
"""

import base64
import json
import os
import socket
import struct

import pytest
from websockets.sync.client import connect

pytest.importorskip("google.protobuf", reason="protobuf is not installed")
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TIMEOUT_S = 10.0


def protobuf_class(name, schema):
    """Class of messages, from the descriptors that a channel has as its schema."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


def decoder(channel):
    """Decode messages of a channel by its own schema."""
    if channel["encoding"] == "protobuf":
        schema = channel["schema"]
        data = base64.b64decode(schema) if isinstance(schema, str) else schema
        return protobuf_class(channel["schemaName"], data).FromString
    assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(channel["schema"], channel["schemaName"]))
    return lambda data: store.deserialize_cdr(data, channel["schemaName"])


class FoxgloveClient:
    """Connection to a server; reads until what was asked for has come."""

    def __init__(self, url, subprotocol="foxglove.sdk.v1", **options):
        options |= {"max_size": None, "open_timeout": TIMEOUT_S}
        self._socket = connect(url, subprotocols=[subprotocol], legacy=True, **options)
        self.subprotocol = self._socket.subprotocol
        self._channels, self._services, self._by_id, self._calls = {}, {}, {}, 0
        self.info = self.json("serverInfo")

    def send(self, data):
        self._socket.send(data if isinstance(data, bytes | str) else json.dumps(data))

    def _receive(self):
        received = self._socket.recv(timeout=TIMEOUT_S)
        if isinstance(received, str):
            content = json.loads(received)
            for channel in content.get("channels", ()):
                self._channels[channel["topic"]] = channel
            if content["op"] == "advertiseServices":
                self._services |= {one["name"]: one for one in content["services"]}
            return content
        return received

    def json(self, operation):
        """Next JSON message of a kind."""
        while True:
            received = self._receive()
            if isinstance(received, dict) and received["op"] == operation:
                return received

    def binary(self, code):
        """Next binary message of a kind, after its code."""
        while True:
            received = self._receive()
            if isinstance(received, bytes) and received[0] == code:
                return received[1:]

    def channel(self, topic):
        while topic not in self._channels:
            self._receive()
        return self._channels[topic]

    def service(self, name):
        while name not in self._services:
            self._receive()
        return self._services[name]

    def subscribe(self, *topics):
        for topic in topics:
            channel = self.channel(topic)
            number = 1000 + channel["id"]
            self._by_id[number] = topic, decoder(channel)
            pair = {"id": number, "channelId": channel["id"]}
            self.send({"op": "subscribe", "subscriptions": [pair]})

    def unsubscribe(self, topic):
        number = 1000 + self.channel(topic)["id"]
        self.send({"op": "unsubscribe", "subscriptionIds": [number]})

    def message(self):
        """Topic, time in ns and content of the next message."""
        data = self.binary(1)
        number, time_ns = struct.unpack_from("<IQ", data)
        topic, decode = self._by_id[number]
        return topic, time_ns, decode(data[12:])

    def advertise(self, number, topic, schema="geometry_msgs/Twist"):
        channel = {"id": number, "topic": topic, "encoding": "json", "schemaName": schema}
        self.send({"op": "advertise", "channels": [channel]})

    def publish(self, number, content):
        data = content if isinstance(content, bytes) else json.dumps(content).encode()
        self.send(b"\x01" + struct.pack("<I", number) + data)

    def call(self, name, request):
        """Response of a service."""
        self._calls += 1
        head = struct.pack("<III", self.service(name)["id"], self._calls, 4)
        self.send(b"\x02" + head + b"json" + json.dumps(request).encode())
        data = self.binary(3)
        assert struct.unpack_from("<II", data)[1] == self._calls
        return json.loads(data[16:])

    def ping(self, data):
        self._socket.ping(os.urandom(4) + data[4:])  # each has to be another

    def die(self):
        self._socket.socket.shutdown(socket.SHUT_RDWR)

    def close(self):
        self._socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *reason):
        self.close()
