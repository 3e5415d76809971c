// The connection to the editor's server: states come in, commands go out and are answered.

export interface Refusal { text: string; field: string; status: string }
/** Why something was refused; or an error that the browser itself raises, such as of a file that has gone. */
export const reason = (refused: unknown): string => (refused as Refusal).text ?? String(refused);

/** poses: 7 numbers for each object that is new in some way; felt: 12; samples: 4 for each (look.py says which). */
export interface State { told: Record<string, unknown>; poses: Float64Array; felt: Float32Array; samples: Float64Array }

const pieceSize = 256 * 1024;
const mostMessage = 1024 * 1024; // bytes: the server ends a connection that sends more

export class Wire {
  /** Takes a state, and says whether the picture is drawn anew for it. */
  onState: (state: State) => boolean = () => false;
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
      const n = ++this.number, text = JSON.stringify({ n, do: name, ...fields });
      if (new Blob([text]).size > mostMessage) {
        return refused({ text: "this is too much for one command, which may have 1 MiB", field: "", status: "FULL" });
      }
      this.waiting.set(n, { done, refused });
      this.count();
      this.socket.send(text);
    });
  }

  /** How many commands are not answered yet. */
  private count(): void { document.body.dataset.busy = String(this.waiting.size); }

  /** Sends a file; a command with `upload: true` then uses it. Returns false if it was not to go on. */
  async upload(file: Blob, name: string, goesOn: () => boolean): Promise<boolean> {
    await this.send("upload", { size: file.size, file: name });
    for (let at = 0; at < file.size; at += pieceSize) {
      while (this.socket && this.socket.bufferedAmount > 8 * pieceSize) await new Promise((done) => setTimeout(done, 20));
      const piece = await file.slice(at, at + pieceSize).arrayBuffer();
      if (!goesOn()) return false;
      this.socket?.send(piece);
    }
    return goesOn();
  }

  private take(data: ArrayBuffer, socket: WebSocket): void {
    const size = new DataView(data).getUint32(0, true);
    const told = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
    const start = Math.ceil((4 + size) / 8) * 8;
    const poses = new Float64Array(data, start, told.rows * 7);
    const samples = new Float64Array(data, start + poses.byteLength, told.samples * 4);
    const felt = new Float32Array(data, start + poses.byteLength + samples.byteLength, told.rows * 12);
    let isDrawn = false;
    try {
      isDrawn = this.onState({ told, poses, felt, samples });
    } catch (error) { // a bug of the page: what comes next may still be shown
      reportError(error);
    }
    // The next state is made when this one has been drawn, or at once where nothing is drawn.
    let isTaken = false;
    const took = () => {
      if (!isTaken && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ took: told.serial }));
      isTaken = true;
    };
    if (document.hidden) setTimeout(took, 200);
    else if (isDrawn) {
      requestAnimationFrame(() => setTimeout(took));
      setTimeout(took, 1000); // a page that is hidden now draws no frame
    } else took();
  }

  private answer(message: { n: number; ok?: unknown; refused?: Refusal }): void {
    const waits = this.waiting.get(message.n);
    this.waiting.delete(message.n);
    this.count();
    if (message.refused) waits?.refused(message.refused);
    else waits?.done(message.ok);
  }
}
