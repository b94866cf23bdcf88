// Stream of a server: sends JSON; receives a length, a JSON text, and the parts or arrays that it lists.

const TYPES = {
  "|u1": Uint8Array, "|i1": Int8Array, "<u2": Uint16Array, "<i2": Int16Array, "<u4": Uint32Array,
  "<i4": Int32Array, "<f4": Float32Array, "<f8": Float64Array,
};

export class Stream {
  #path;
  #socket = null;
  #handlers;
  #delay = 300;

  /** @param handlers functions by a message's op or type; `open` and `closed` for the stream itself. */
  constructor(path, handlers) {
    this.#path = path;
    this.#handlers = handlers;
    this.connect();
  }

  connect() {
    const url = new URL(this.#path, location.href);
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
      this.#handlers[message.op ?? message.type]?.(message);
    };
    socket.onclose = () => {
      this.#handlers.closed?.();
      setTimeout(() => this.connect(), this.#delay);
      this.#delay = Math.min(2 * this.#delay, 5000);
    };
    this.#socket = socket;
  }

  send(content) {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(content));
  }
}

function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const message = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let offset = 4 + length;
  for (const part of message.parts ?? []) {
    part.data = new Uint8Array(buffer, offset, part.size);
    part.blob = new Blob([part.data], { type: part.media_type });
    offset += part.size;
  }
  const arrays = (message.arrays ?? []).map(({ dtype, shape }) => {
    const bytes = shape.reduce((product, side) => product * side, TYPES[dtype].BYTES_PER_ELEMENT);
    offset += bytes;
    return new TYPES[dtype](buffer.slice(offset - bytes, offset)); // which are not aligned
  });
  return arrays.length ? withArrays(message, arrays) : message;
}

/** Value with its arrays in place of `{array: number}`. */
function withArrays(value, arrays) {
  if (typeof value !== "object" || value === null) return value;
  if ("array" in value) return arrays[value.array];
  if (Array.isArray(value)) return value.map((item) => withArrays(item, arrays));
  return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, withArrays(item, arrays)]));
}
