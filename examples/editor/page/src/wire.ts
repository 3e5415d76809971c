// The connection to the editor's server: states come in, commands go out and are answered.

export interface Refusal { text: string; field: string; status: string }
export interface State { told: Record<string, unknown>; rows: Float64Array; samples: Float64Array }

const pieceSize = 256 * 1024;

export class Wire {
  onState: (state: State) => void = () => {};
  /** Whether there is a connection to the editor's server. */
  onLine: (isConnected: boolean) => void = () => {};

  private socket: WebSocket | null = null;
  private number = 0;
  private waiting = new Map<number, { done: (answer: any) => void; refused: (why: Refusal) => void }>();

  connect(): void {
    const socket = new WebSocket(new URL("socket", location.href).href.replace(/^http/, "ws"));
    socket.binaryType = "arraybuffer";
    socket.onopen = () => { this.socket = socket; this.onLine(true); };
    socket.onmessage = (event) => {
      if (event.data instanceof ArrayBuffer) this.take(event.data, socket);
      else this.answer(JSON.parse(event.data as string));
    };
    socket.onclose = () => {
      this.socket = null;
      for (const each of this.waiting.values()) {
        each.refused({ text: "the connection to the editor was lost", field: "", status: "DISCONNECTED" });
      }
      this.waiting.clear();
      this.count();
      this.onLine(false);
      setTimeout(() => this.connect(), 500);
    };
  }

  /** Resolves with what the command gives, or rejects with a Refusal. */
  send(name: string, fields: Record<string, unknown> = {}): Promise<any> {
    return new Promise((done, refused) => {
      if (!this.socket) return refused({ text: "there is no connection to the editor", field: "", status: "DISCONNECTED" });
      const n = ++this.number;
      this.waiting.set(n, { done, refused });
      this.count();
      this.socket.send(JSON.stringify({ n, do: name, ...fields }));
    });
  }

  /** How many commands are not answered yet. */
  private count(): void { document.body.dataset.busy = String(this.waiting.size); }

  /** Sends a file; a command with `upload: true` then uses it. */
  async upload(file: Blob, name: string): Promise<void> {
    await this.send("upload", { size: file.size, file: name });
    for (let at = 0; at < file.size; at += pieceSize) {
      while (this.socket && this.socket.bufferedAmount > 8 * pieceSize) await new Promise((done) => setTimeout(done, 20));
      this.socket?.send(await file.slice(at, at + pieceSize).arrayBuffer());
    }
  }

  private take(data: ArrayBuffer, socket: WebSocket): void {
    const size = new DataView(data).getUint32(0, true);
    const told = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
    const start = Math.ceil((4 + size) / 8) * 8;
    const numbers = new Float64Array(data, start);
    const split = told.rows * 19;
    this.onState({ told, rows: numbers.subarray(0, split), samples: numbers.subarray(split) });
    // The next state is made when this one has been drawn, or at once where nothing is drawn (a hidden page).
    const took = () => { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ took: told.serial })); };
    if (document.hidden) setTimeout(took, 200);
    else requestAnimationFrame(() => setTimeout(took));
  }

  private answer(message: { n: number; ok?: unknown; refused?: Refusal }): void {
    const waits = this.waiting.get(message.n);
    this.waiting.delete(message.n);
    this.count();
    if (message.refused) waits?.refused(message.refused);
    else waits?.done(message.ok);
  }
}
