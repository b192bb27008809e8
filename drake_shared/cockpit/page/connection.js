// The websocket to the server: JSON in both directions, reconnects when the connection is lost.

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
    socket.onopen = () => this.#dispatch("open");
    socket.onmessage = (event) => {
      const message = JSON.parse(event.data);
      this.#dispatch(message.type, message);
    };
    socket.onclose = (event) => {
      this.#socket = null;
      this.#dispatch("close", event.reason);
      this.#checkKey();
      setTimeout(() => this.open(), RETRY);
    };
  }

  send(message) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }

  // A websocket does not tell why it was refused.
  async #checkKey() {
    const answer = await fetch("/cockpit/overlay.html", { cache: "no-store" }).catch(() => null);
    if (answer?.status === 403) this.#dispatch("refused");
  }

  #dispatch(type, content) {
    this.#listeners.get(type)?.(content);
  }
}
