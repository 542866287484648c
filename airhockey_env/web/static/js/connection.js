/**
 * The page's session: a WebSocket whose messages are JSON objects with a `type`. docs/web.md describes them.
 */
export class Connection {
  #socket = null;
  #listeners = new Map();
  #reason = "";

  /**
   * @param {string} kind - the kind of session: "play", "watch" or "air".
   */
  constructor(kind) {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    this.address = `${scheme}//${location.host}/session/${kind}`;
  }

  /** Call `listener` with every message of this type. Bytes are of type "bytes", the session's end is of type "end". */
  on(type, listener) {
    this.#listeners.set(type, listener);
  }

  /** Begin a session; the server's first message is of type "hello". */
  open() {
    this.#reason = "";
    this.#socket = new WebSocket(this.address);
    this.#socket.binaryType = "arraybuffer";
    this.#socket.onmessage = ({ data }) => {
      if (typeof data !== "string") {
        this.#tell({ type: "bytes", data });
        return;
      }
      const message = JSON.parse(data);
      if (message.type === "end") {
        this.#reason = message.reason;
      } else {
        this.#tell(message);
      }
    };
    this.#socket.onclose = () => this.#tell({ type: "end", reason: this.#reason || "the server is not there any more" });
  }

  /** Whether messages can be sent. */
  get isOpen() {
    return this.#socket !== null && this.#socket.readyState === WebSocket.OPEN;
  }

  /** Send a message, if the session is open. */
  send(type, fields = {}) {
    if (this.isOpen) {
      this.#socket.send(JSON.stringify({ type, ...fields }));
    }
  }

  #tell(message) {
    this.#listeners.get(message.type)?.(message);
  }
}
