// Fields of the panel: a label, an input, a unit, and the place for what is refused.

import { newGesture } from "./orders";
import { reason } from "./wire";

export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K, properties: Partial<HTMLElementTagNameMap[K]> = {}, ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** Where it is said why something was refused. */
export const errorLine = (): HTMLElement => make("div", { className: "error", role: "alert" } as Partial<HTMLDivElement>);

/** What stands over several fields in a row, with their unit. */
export const over = (text: string): HTMLElement => make("div", { className: "over", textContent: text });

/** Only where it differs: the same text set again would be laid out and painted again. */
export function put(element: HTMLElement, text: string): void { if (element.textContent !== text) element.textContent = text; }

/** With 12 digits at most, and as short as that can be. */
export function shown(value: number | null | undefined): string {
  if (value === null || value === undefined) return "";
  return String(Number(value.toPrecision(12)));
}

/** "1e-3", "0,5" and "-2" are numbers; all else is null, also "1,000", which is 1 for some and 1000 for others. */
export function parse(text: string): number | null {
  if (/^\s*[+-−]?[1-9]\d{0,2},\d{3}\s*$/.test(text)) return null;
  const plain = text.trim().replace("−", "-").replace(/^([+-]?\d*),(\d+)$/, "$1.$2");
  if (plain === "" || !/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain)) return null;
  const value = Number(plain);
  return Number.isFinite(value) ? value : null;
}

let ids = 0;

/** One line of the panel. It shows what the server has, unless the person is typing. */
export abstract class Field {
  /** Hears what cannot be said at a field, as it shows other objects by now. */
  static onLate: (text: string) => void = () => {};
  readonly row: HTMLElement;
  private readonly error = errorLine();
  protected readonly unit = make("span", { className: "unit" });
  private readonly label: HTMLLabelElement;

  constructor(readonly path: string, label: string, unit: string, readonly input: HTMLElement, title = "") {
    input.id = `field-${++ids}`;
    input.dataset.path = path;
    this.error.id = `${input.id}-error`;
    this.label = make("label", { htmlFor: input.id, textContent: label, title });
    this.unit.textContent = unit;
    const line = make("div", { className: "line" }, this.label, input, this.unit);
    this.row = make("div", { className: "field" }, line, this.error);
    this.row.dataset.path = path;
  }
  get name(): string { return this.label.textContent!; }
  set unitText(text: string) { if (this.unit.textContent !== text) this.unit.textContent = text; }
  set isShown(is: boolean) { this.row.hidden = !is; }
  get isShown(): boolean { return !this.row.hidden; }

  private awaited: { value: unknown; until: number } | null = null;
  /** The person has given this value: for a moment the states that are on their way still have the old one. */
  protected await(value: unknown): void { this.awaited = { value, until: performance.now() + 1000 }; }
  protected isOld(value: unknown): boolean {
    if (this.awaited && value !== this.awaited.value && performance.now() < this.awaited.until) return true;
    this.awaited = null;
    return false;
  }

  /** Counts the selections that it was about: what an answer says about an earlier one is not shown here. */
  protected subject = 0;
  /** It is about other objects from now on. */
  forget(): void {
    if (this.why && performance.now() < this.refusedAt + 1000) this.tellLate(this.why); // nobody can have read it
    ++this.subject;
    this.awaited = null;
    this.refuse("");
  }
  protected tellLate(text: string): void { Field.onLate(`${this.name}: ${text}`); }

  private why = "";
  private refusedAt = 0; // ms
  /** again: puts what was typed back into the field. */
  refuse(text: string, again?: () => void): void {
    this.why = text;
    this.refusedAt = performance.now();
    if (text) this.awaited = null;
    this.error.textContent = text;
    const title = "Puts what you typed back into the field";
    if (again) this.error.append(" ", make("button", { textContent: "Edit again", title, onclick: again }));
    this.row.classList.toggle("bad", text !== "");
    this.input.setAttribute("aria-invalid", String(text !== ""));
    if (text) this.input.setAttribute("aria-describedby", this.error.id);
    else this.input.removeAttribute("aria-describedby");
  }
}

/** Sends a value; the promise rejects with a Refusal. What has the same gesture is undone in one step. */
export type Send = (path: string, value: unknown, gesture?: string) => Promise<unknown>;
/** What is typed as the value to send, or the sentence why it is none. */
export type Read = (text: string) => { value: unknown } | string;

/** A field in which the person types. What is refused goes back to what it was. The value that the objects have is the
 * control's own default value. */
abstract class TypedField extends Field {
  private sending: string | null = null; // what is on its way
  private isMore = false; // and that something else is to be sent after it
  protected gesture: string | undefined;

  constructor(path: string, label: string, unit: string, private readonly text: HTMLInputElement | HTMLTextAreaElement,
    private readonly send: Send, private readonly read: Read, title = "") {
    super(path, label, unit, text, title);
    text.onchange = () => void this.commit();
    text.oninput = () => this.refuse("");
  }
  forget(): void {
    const { text } = this, isLost = document.activeElement === text && isUnsent(text), typed = text.value;
    super.forget();
    this.sending = null;
    this.goBack();
    if (!isLost) return;
    text.blur(); // what is typed next must not go to the other objects
    this.tellLate(`“${typed}” was not sent, as the selection has changed`);
  }
  /** null: the selected objects differ. */
  show(shows: string | number | null): void {
    const value = typeof shows === "number" ? shown(shows) : shows ?? "", { text } = this;
    if (this.sending !== null || this.isOld(value)) return;
    const isTyping = document.activeElement === text && isUnsent(text);
    if (text.defaultValue !== value) text.defaultValue = value;
    text.placeholder = shows === null ? "several" : "";
    if (!isTyping && text.value !== value) text.value = value;
  }
  set isReadOnly(is: boolean) { this.text.readOnly = is; }

  protected goBack(): void { if (this.sending === null) this.text.value = this.text.defaultValue; }

  protected async commit(): Promise<void> {
    const { subject, text } = this, typed = text.value;
    if (this.sending !== null) { // sent when this answer is there; a key and the change that it makes are told one by one
      this.isMore = typed !== this.sending;
      return;
    }
    if (!isUnsent(text)) return;
    this.refuse("");
    const read = this.read(typed), old = text.defaultValue;
    let why = "";
    this.sending = text.defaultValue = typed;
    this.isMore = false;
    try {
      if (typeof read === "string") why = read;
      else await this.send(this.path, read.value, this.gesture);
    } catch (refused) {
      why = reason(refused);
    }
    if (subject !== this.subject) {
      if (why) this.tellLate(why);
      return;
    }
    this.sending = null;
    if (why) text.defaultValue = old;
    else this.await(typed);
    if (this.isMore) return this.commit();
    if (!why) return;
    if (text.value === typed) this.goBack(); // else the person is typing again
    this.refuse(why, () => {
      this.refuse("");
      text.value = typed;
      text.focus();
    });
  }
}

/** Whether something is typed that has not been sent. */
export const isUnsent = (text: HTMLInputElement | HTMLTextAreaElement): boolean => text.value !== text.defaultValue;

/** One line. */
export class TextField extends TypedField {
  private readonly line: HTMLInputElement;

  constructor(path: string, label: string, unit: string, send: Send, read: Read, title = "", isNumber = false) {
    const line = make("input", { type: "text", spellcheck: false, autocomplete: "off", title });
    super(path, label, unit, line, send, read, title);
    this.line = line;
    line.onkeydown = (event) => {
      if (event.key === "Enter") { void this.commit(); line.select(); }
      else if (!event.key.startsWith("Arrow")) this.gesture = undefined;
      if (isNumber && (event.key === "ArrowUp" || event.key === "ArrowDown")) this.nudge(event);
    };
    line.onblur = () => this.goBack();
  }

  /** What the arrow keys change it by; null: by its second digit. With Shift by a tenth of that. */
  step: (() => number) | null = null;
  private nudge(event: KeyboardEvent): void {
    const value = parse(this.line.value);
    if (value === null || this.line.readOnly) return;
    event.preventDefault();
    if (!event.repeat) this.gesture = newGesture(); // a key that is held is one step
    const step = this.step?.() ?? (value === 0 ? 0.01 : 10 ** Math.floor(Math.log10(Math.abs(value)))) / 10;
    const by = (event.shiftKey ? step / 10 : step) * (event.key === "ArrowUp" ? 1 : -1);
    this.line.value = shown(value + by);
    void this.commit();
  }
}

export function numberField(path: string, label: string, unit: string, send: Send, title = ""): TextField {
  return new TextField(path, label, unit, send, (text) => {
    const value = parse(text);
    return value === null ? `“${text}” is not a number${/\d,\d/.test(text) ? ", or could be two: write a point" : ""}` : { value };
  }, title, true);
}

/** Many lines: an expression, or a table that may be pasted from a spreadsheet. */
export class AreaField extends TypedField {
  constructor(path: string, label: string, send: Send, read: Read, rows: number) {
    const area = make("textarea", { rows, spellcheck: false });
    super(path, label, "", area, send, read);
    this.row.classList.add("tall");
    area.onkeydown = (event) => { if (event.key === "Enter" && (rows === 2 || event.ctrlKey)) { event.preventDefault(); void this.commit(); } };
  }
}

/** A field in which the person picks one of some values. What is refused goes back to what it was. */
abstract class PickedField<V> extends Field {
  private value: V | null = null;

  constructor(path: string, label: string, private readonly control: HTMLInputElement | HTMLSelectElement, send: Send,
    picked: () => V, private readonly put: (value: V | null) => void) {
    super(path, label, "", control);
    control.onchange = async () => {
      const { subject } = this, value = picked();
      this.await(value);
      this.refuse("");
      try {
        await send(path, value);
      } catch (refused) {
        if (subject !== this.subject) {
          if (reason(refused)) this.tellLate(reason(refused));
          return;
        }
        put(this.value);
        this.refuse(reason(refused));
      }
    };
  }
  /** null: the selected objects differ. */
  show(value: V | null): void {
    if (this.isOld(value)) return;
    this.value = value;
    this.put(value);
  }
  set isReadOnly(is: boolean) { this.control.disabled = is; }
}

export class ChoiceField extends PickedField<string> {
  constructor(path: string, label: string, choices: [string, string][], send: Send) {
    const select = make("select", {}, ...choices.map(([value, text]) => make("option", { value, textContent: text })));
    const several = make("option", { value: "", textContent: "several", hidden: true });
    super(path, label, select, send, () => select.value, (value) => {
      if (value === null) select.append(several);
      else several.remove();
      select.value = value ?? "";
    });
  }
}

export class CheckField extends PickedField<boolean> {
  constructor(path: string, label: string, send: Send) {
    const check = make("input", { type: "checkbox" });
    super(path, label, check, send, () => check.checked, (value) => {
      check.checked = value ?? false;
      check.indeterminate = value === null;
    });
  }
}

export type AnyField = TextField | ChoiceField | CheckField | AreaField;
