// Stream to the server: sends JSON, receives a length, a JSON text and the parts that it lists.

export class Stream {
  #socket = null;
  #handlers;
  #delay = 300;

  /** @param handlers functions by message type; `open` and `closed` for the stream itself. */
  constructor(handlers) {
    this.#handlers = handlers;
    this.connect();
  }

  connect() {
    const url = new URL("stream", location.href);
    url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    url.search = location.search;
    const socket = new WebSocket(url);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.#delay = 300;
      this.#handlers.open?.();
    };
    socket.onmessage = (event) => {
      const message = unpack(event.data);
      this.#handlers[message.type]?.(message);
    };
    socket.onclose = () => {
      this.#handlers.closed?.();
      setTimeout(() => this.connect(), this.#delay);
      this.#delay = Math.min(2 * this.#delay, 5000);
    };
    this.#socket = socket;
  }

  send(type, content = {}) {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify({ type, ...content }));
  }
}

function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const message = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let offset = 4 + length;
  for (const part of message.parts) {
    part.data = new Uint8Array(buffer, offset, part.size);
    part.blob = new Blob([part.data], { type: part.media_type });
    offset += part.size;
  }
  return message;
}
