"""Foxglove's server in a browser: pages of Foxglove and of this machine, and those of others."""

import pytest

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
from omnisim.serve.protocols.foxglove_publisher import FoxglovePublisher
from tests.serve import fake_robot
from tests.serve.browsers import chromium

# Subscribes to all topics; the topics whose messages have come, or "refused".
READ_ALL = """
url => new Promise(done => {
  const socket = new WebSocket(url, ["foxglove.sdk.v1"]);
  socket.binaryType = "arraybuffer";
  const names = new Map(), found = new Set();
  socket.onerror = () => done("refused");
  socket.onmessage = ({data}) => {
    if (typeof data === "string") {
      const {op, channels} = JSON.parse(data);
      if (op !== "advertise") return;
      const subscriptions = channels.map(({id}) => ({id, channelId: id}));
      channels.forEach(({id, topic}) => names.set(id, topic));
      socket.send(JSON.stringify({op: "subscribe", subscriptions}));
    } else {
      const view = new DataView(data);
      found.add(view.getUint8(0) === 2 ? "/clock" : names.get(view.getUint32(1, true)));
      if (found.size === COUNT) { socket.close(); done([...found]); }
    }
  };
})
"""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser():
    # which ask the user about websites that connect to this machine: here, the server decides
    checks = "LocalNetworkAccessChecks,LocalNetworkAccessChecksWebSockets"
    with chromium(f"--disable-features={checks}") as found:
        yield found


@pytest.mark.parametrize(
    ("website", "may_connect"),
    [
        ("https://app.foxglove.dev/", True),
        ("http://localhost:8080/", True),
        ("https://evil.example/", False),
    ],
)
def test_pages_read_every_topic_or_none(browser, website, may_connect):
    publisher, topics = FoxglovePublisher(port=0), [one.name for one in fake_robot.topics()]
    publisher.open(fake_robot.topics(), fake_robot.FakeControls())
    page = browser.new_page()
    page.route("**/*", lambda route: route.fulfill(body="<p>page</p>", content_type="text/html"))
    page.goto(website)
    script = READ_ALL.replace("COUNT", str(len(topics)))
    page.evaluate(f"url => {{ window.read = ({script})(url); }}", publisher.url)
    for _ in range(50):
        for topic, message in fake_robot.messages().items():
            publisher.publish(topic, fake_robot.STAMP_NS, message)
        publisher.publish("/clock", fake_robot.STAMP_NS, None)
        page.wait_for_timeout(20)
    read = page.evaluate("window.read")
    page.close()
    publisher.close()
    assert read == "refused" if not may_connect else sorted(read) == sorted(topics), read
