/** The two sockets: opened anew by themselves with growing pauses, never a second one of a kind. */

const FIRST_S = 0.25;
const LONGEST_S = 5;
const REFUSED = 1008;

/** Pauses between attempts: doubling, a quarter to either side at random. */
export class Backoff {
  constructor(random = Math.random) {
    this._random = random;
    this.succeeded();
  }

  succeeded() {
    this._next = FIRST_S;
  }

  /** The next pause in s. */
  pause() {
    const pause = this._next * (0.75 + 0.5 * this._random());
    this._next = Math.min(LONGEST_S, 2 * this._next);
    return pause;
  }
}

/**
 * One socket that says hello with the token and comes back by itself.
 *
 * Emits `hello` (the answer), `message` (a JSON object), `frame` (an ArrayBuffer), `closed` (a reason), and
 * `refused` (a reason) where the server will not have it: then it is not tried again.
 */
export class Socket extends EventTarget {
  constructor(path, token) {
    super();
    this._path = path;
    this._token = token;
    this._backoff = new Backoff();
    this._timer = 0;
    this._socket = null;
    this._wanted = false;
    this.ready = false;
  }

  open() {
    this._wanted = true;
    clearTimeout(this._timer);
    if (this._socket) return;
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    const socket = new WebSocket(`${scheme}://${location.host}${this._path}`);
    socket.binaryType = 'arraybuffer';
    this._socket = socket;
    socket.onopen = () => socket.send(JSON.stringify({ op: 'hello', token: this._token }));
    socket.onmessage = ({ data }) => this._take(data);
    socket.onclose = ({ code, reason }) => this._closed(socket, code, reason);
  }

  /** Close and stay closed. */
  close() {
    this._wanted = this.ready = false;
    clearTimeout(this._timer);
    this._socket?.close(1000);
  }

  /** Send an object as JSON, or bytes; return whether there was anybody to send to. */
  send(data) {
    if (!this.ready) return false;
    this._socket.send(data instanceof ArrayBuffer ? data : JSON.stringify(data));
    return true;
  }

  _take(data) {
    if (typeof data !== 'string') {
      this._emit('frame', data);
      return;
    }
    const message = JSON.parse(data);
    if (message.op === 'hello') {
      this.ready = true;
      this._backoff.succeeded();
      this._emit('hello', message);
    } else {
      this._emit('message', message);
    }
  }

  _closed(socket, code, reason) {
    if (socket !== this._socket) return;
    const greeted = this.ready;
    this.ready = false;
    this._socket = null;
    this._emit('closed', reason);
    if (!this._wanted) return;
    if (code === REFUSED && !greeted) {
      this._wanted = false;
      this._emit('refused', reason);
      return;
    }
    this._timer = setTimeout(() => this.open(), 1000 * this._backoff.pause());
  }

  _emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}

/** Orders on the command socket, each answered once; what is under way when it closes is answered with that. */
export class Orders {
  constructor(socket) {
    this._socket = socket;
    this._waiting = new Map();
    this._id = 0;
    socket.addEventListener('message', ({ detail }) => {
      if (detail.op !== 'answer') return;
      this._waiting.get(detail.id)?.(detail);
      this._waiting.delete(detail.id);
    });
    socket.addEventListener('closed', () => {
      for (const [id, answer] of this._waiting) answer({ id, ok: false, why: 'the connection was lost' });
      this._waiting.clear();
    });
  }

  /** Give an order, `{op, ...}`; resolves to its answer `{ok, why, ...}`. */
  give(order) {
    this._id += 1;
    const id = this._id;
    return new Promise((resolve) => {
      this._waiting.set(id, resolve);
      if (!this._socket.send({ ...order, id })) {
        this._waiting.delete(id);
        resolve({ id, ok: false, why: 'there is no connection' });
      }
    });
  }
}
