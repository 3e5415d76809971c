// Fields of the panel: a label, an input, a unit, and the place for what is refused.

import type { Refusal } from "./wire";

export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K, properties: Partial<HTMLElementTagNameMap[K]> = {}, ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** Only where it differs: the same text set again would be laid out and painted again. */
export function put(element: HTMLElement, text: string): void { if (element.textContent !== text) element.textContent = text; }

/** With 12 digits at most, and as short as that can be. */
export function shown(value: number | null | undefined): string {
  if (value === null || value === undefined) return "";
  return String(Number(value.toPrecision(12)));
}

/** "1e-3", "0,5" and "-2" are numbers; all else is null. */
export function parse(text: string): number | null {
  const plain = text.trim().replace("−", "-").replace(/^([+-]?\d*),(\d+)$/, "$1.$2");
  if (plain === "" || !/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain)) return null;
  const value = Number(plain);
  return Number.isFinite(value) ? value : null;
}

let ids = 0;

/** One line of the panel. It shows what the server has, unless the person is typing. */
class Field {
  readonly row: HTMLElement;
  private readonly error = make("div", { className: "error", role: "alert" } as Partial<HTMLDivElement>);
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

  /** Which objects it is about: an answer that comes for those before is of no interest any more. */
  protected subject = 0;
  /** It is about another object from now on. */
  forget(): void {
    ++this.subject;
    this.awaited = null;
    this.refuse("");
  }

  /** again: puts what was typed back into the field. */
  refuse(text: string, again?: () => void): void {
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

/** Sends a value; the promise rejects with a Refusal. */
export type Send = (path: string, value: unknown) => Promise<unknown>;
/** What is typed as the value to send, or the sentence why it is none. */
export type Read = (text: string) => { value: unknown } | string;

/** A field in which the person types. What is refused goes back to what it was. */
abstract class TypedField extends Field {
  private value = "";
  private sending: string | null = null; // what is on its way

  constructor(path: string, label: string, unit: string, private readonly text: HTMLInputElement | HTMLTextAreaElement,
    private readonly send: Send, private readonly read: Read, title = "") {
    super(path, label, unit, text, title);
    text.onchange = () => void this.commit();
    text.oninput = () => this.refuse("");
  }
  forget(): void {
    super.forget();
    this.sending = null;
    this.goBack();
  }
  /** null: the selected objects differ. */
  show(shows: string | number | null): void {
    const value = typeof shows === "number" ? shown(shows) : shows ?? "";
    if (this.sending !== null || this.isOld(value)) return;
    const isTyping = document.activeElement === this.text && this.text.value !== this.value;
    this.value = value;
    this.text.placeholder = shows === null ? "several" : "";
    if (!isTyping && this.text.value !== value) this.text.value = value;
  }
  set isReadOnly(is: boolean) { this.text.readOnly = is; }

  protected goBack(): void { if (this.sending === null) this.text.value = this.value; }

  protected async commit(): Promise<void> {
    const text = this.text.value;
    if (this.sending !== null) return; // Enter is told twice, as a key and as a change; newer text is sent when this answer arrives
    if (text === this.value) return;
    this.refuse("");
    const { subject } = this, read = this.read(text);
    let why = "";
    this.sending = text;
    try {
      if (typeof read === "string") why = read;
      else await this.send(this.path, read.value);
    } catch (refused) {
      why = (refused as Refusal).text;
    }
    if (subject !== this.subject) return;
    this.sending = null;
    if (!why) {
      this.value = text;
      this.await(text);
    }
    if (this.text.value !== text) void this.commit(); // typed meanwhile
    else if (why) {
      this.goBack();
      this.refuse(why, () => {
        this.refuse("");
        this.text.value = text;
        this.text.focus();
      });
    }
  }
}

/** One line. */
export class TextField extends TypedField {
  private readonly line: HTMLInputElement;

  constructor(path: string, label: string, unit: string, send: Send, read: Read, title = "", isNumber = false) {
    const line = make("input", { type: "text", spellcheck: false, autocomplete: "off", title });
    super(path, label, unit, line, send, read, title);
    this.line = line;
    line.onkeydown = (event) => {
      if (event.key === "Enter") { void this.commit(); line.select(); }
      if (isNumber && (event.key === "ArrowUp" || event.key === "ArrowDown")) this.nudge(event);
    };
    line.onblur = () => this.goBack();
  }

  /** What the arrow keys change it by; null: by its second digit. With Shift by a tenth of that. */
  step: (() => number) | null = null;
  private nudge(event: KeyboardEvent): void {
    const value = parse(this.line.value);
    if (value === null) return;
    event.preventDefault();
    const step = this.step?.() ?? (value === 0 ? 0.01 : 10 ** Math.floor(Math.log10(Math.abs(value)))) / 10;
    const by = (event.shiftKey ? step / 10 : step) * (event.key === "ArrowUp" ? 1 : -1);
    this.line.value = shown(value + by);
    void this.commit();
  }
}

export function numberField(path: string, label: string, unit: string, send: Send, title = ""): TextField {
  return new TextField(path, label, unit, send, (text) => {
    const value = parse(text);
    return value === null ? `“${text}” is not a number` : { value };
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
        if (subject !== this.subject) return;
        put(this.value);
        this.refuse((refused as Refusal).text);
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
    super(path, label, select, send, () => select.value, (value) => { select.value = value ?? ""; });
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
