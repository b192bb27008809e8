// The websocket to the cockpit's server: JSON both ways, and a new try when it is lost.

const RETRY = 1000; // ms

export class Connection {
  #path;
  #socket = null;
  #listeners = new Map();

  constructor(path) {
    this.#path = path;
  }

  on(type, listener) {
    this.#listeners.set(type, listener);
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}${this.#path}`);
    this.#socket = socket;
    socket.onopen = () => this.#tell("open");
    socket.onmessage = (event) => {
      const message = JSON.parse(event.data);
      this.#tell(message.type, message);
    };
    socket.onclose = (event) => {
      this.#socket = null;
      this.#tell("close", event.reason);
      setTimeout(() => this.open(), RETRY);
    };
  }

  send(message) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }

  #tell(type, content) {
    this.#listeners.get(type)?.(content);
  }
}
