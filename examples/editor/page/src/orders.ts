// What the page asks the server to do, and what it says when it is refused.

import type { Model } from "./model";
import { type Refusal, type Wire, reason } from "./wire";

/** By their names, such as "front.gain". */
export type Fields = Record<string, unknown>;

/** Fields of a section as the server names them: "front.gain". */
export function flat(section: string, fields: Record<string, unknown>): Record<string, unknown> {
  return Object.fromEntries(Object.entries(fields).map(([key, value]) => [`${section}.${key}`, value]));
}

let gestures = 0;
/** Changes with the same gesture are undone in one step. */
export const newGesture = (): string => `${Date.now().toString(36)}-${++gestures}`;

export class Orders {
  /** What concerns no field is told here. */
  onNotice: (text: string, isBad: boolean) => void = () => {};

  constructor(readonly wire: Wire, readonly model: Model) {}

  /** Sends a command; a refusal becomes a notice. Returns null if it was refused. */
  async ask(name: string, fields: Record<string, unknown> = {}): Promise<any> {
    try {
      return await this.wire.send(name, fields);
    } catch (refused) {
      this.onNotice(reason(refused), true);
      return null;
    }
  }

  /** All of them or none. fields: the same for all, or a list with those of each. */
  change(names: string[], fields: Fields | Fields[], gesture = newGesture(), more: Record<string, unknown> = {}): Promise<any> {
    if (!names.length) return Promise.reject({ text: "what is selected is locked", field: "", status: "DENIED" });
    return this.wire.send("change", { names, fields, gesture, ...more });
  }

  async stopForce(): Promise<void> {
    await this.ask("stop"); // that it is stopped is said as long as it is, by the state
  }

  /** Undo or redo, with a word about what it was. */
  async step(name: "undo" | "redo"): Promise<void> {
    const step = await this.ask(name);
    if (step) this.onNotice(`${name === "undo" ? "Undone" : "Done again"}: ${step.text} (${step.who})`, false);
  }

  /** Adds an object, and selects it when it is there. Returns whether it was added. */
  async add(name: string, primitive: string, fields: Record<string, unknown>): Promise<boolean> {
    const made = await this.ask("add", { name, primitive, fields, gesture: newGesture() });
    if (made) this.selectWhenThere(made.name);
    return Boolean(made);
  }

  async remove(names: string[]): Promise<void> {
    await this.ask("remove", { names, gesture: newGesture() });
  }

  async adopt(name: string): Promise<void> {
    const made = await this.ask("adopt", { name, gesture: newGesture() });
    if (made) this.selectWhenThere(made.name);
  }

  selectWhenThere(name: string): void {
    let looks = 0;
    const look = () => {
      const item = this.model.byName(name);
      if (item) this.model.select([item.told.id]);
      else if (++looks < 1000) setTimeout(look, 30);
    };
    look();
  }
}

/** Sends the newest of many values: the next one when the last was answered. */
export class Latest<T> {
  private next: T | null = null;
  private isBusy = false;
  /** refused: hears why a value was not taken. */
  constructor(private readonly send: (value: T) => Promise<unknown>, private readonly refused: (why: Refusal) => void = () => {}) {}

  async put(value: T): Promise<void> {
    this.next = value;
    if (this.isBusy) return;
    this.isBusy = true;
    try {
      while (this.next !== null) {
        const now: T = this.next;
        this.next = null;
        await this.send(now).catch((refused) => this.refused(refused as Refusal));
      }
    } finally {
      this.isBusy = false;
    }
  }
}
