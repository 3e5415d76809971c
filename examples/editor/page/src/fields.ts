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

export class TextField extends Field {
  private readonly text: HTMLInputElement;
  private value = "";
  private sending: string | null = null; // what is on its way

  /** read: what is typed as the value to send, or the sentence why it is none. */
  constructor(path: string, label: string, unit: string, send: Send, private readonly read: (text: string) => { value: unknown } | string,
    title = "", isNumber = false) {
    const text = make("input", { type: "text", spellcheck: false, autocomplete: "off", title });
    super(path, label, unit, text, title);
    this.text = text;
    const commit = () => void this.commit(send);
    text.onchange = commit;
    text.onkeydown = (event) => {
      if (event.key === "Enter") { commit(); text.select(); }
      if (isNumber && (event.key === "ArrowUp" || event.key === "ArrowDown")) this.nudge(event, commit);
    };
    text.onfocus = () => text.select();
    text.onblur = () => { if (this.sending === null) text.value = this.value; };
  }
  forget(): void {
    super.forget();
    this.sending = null;
    this.text.value = this.value;
  }
  show(value: string): void {
    if (this.sending !== null || this.isOld(value)) return;
    const isTyping = this.text.value !== this.value;
    this.value = value;
    if (this.text.value !== value && (document.activeElement !== this.text || !isTyping)) this.text.value = value;
  }
  set isReadOnly(is: boolean) { this.text.readOnly = is; }

  private async commit(send: Send): Promise<void> {
    const text = this.text.value;
    if (this.sending !== null) return; // Enter is told twice, as a key and as a change; newer text is sent when this answer arrives
    if (text === this.value) { this.refuse(""); return; }
    const read = this.read(text);
    if (typeof read === "string") { this.back(read); return; }
    const { subject } = this;
    this.sending = text;
    this.refuse("");
    let why = "";
    try {
      await send(this.path, read.value);
    } catch (refused) {
      why = (refused as Refusal).text;
    }
    if (subject !== this.subject) return;
    this.sending = null;
    if (!why) {
      this.value = text;
      this.await(text);
    }
    if (this.text.value !== text) void this.commit(send); // typed meanwhile
    else if (why) this.back(why);
  }
  private back(why: string): void { this.text.value = this.value; this.refuse(why); }

  /** What the arrow keys change it by; null: by its second digit. With Shift by a tenth of that. */
  step: (() => number) | null = null;
  private nudge(event: KeyboardEvent, commit: () => void): void {
    const value = parse(this.text.value);
    if (value === null) return;
    event.preventDefault();
    const step = this.step?.() ?? (value === 0 ? 0.01 : 10 ** Math.floor(Math.log10(Math.abs(value)))) / 10;
    const by = (event.shiftKey ? step / 10 : step) * (event.key === "ArrowUp" ? 1 : -1);
    this.text.value = shown(value + by);
    commit();
  }
}

export function numberField(path: string, label: string, unit: string, send: Send, title = ""): TextField {
  return new TextField(path, label, unit, send, (text) => {
    const value = parse(text);
    return value === null ? `“${text}” is not a number` : { value };
  }, title, true);
}

export class ChoiceField extends Field {
  private readonly select: HTMLSelectElement;
  private value = "";
  constructor(path: string, label: string, choices: [string, string][], send: Send) {
    const select = make("select", {}, ...choices.map(([value, text]) => make("option", { value, textContent: text })));
    super(path, label, "", select);
    this.select = select;
    select.onchange = async () => {
      const { subject } = this;
      this.await(select.value);
      this.refuse("");
      try {
        await send(path, select.value);
      } catch (refused) {
        if (subject !== this.subject) return;
        select.value = this.value;
        this.refuse((refused as Refusal).text);
      }
    };
  }
  show(value: string): void {
    if (this.isOld(value)) return;
    this.value = value;
    this.select.value = value;
  }
  set isReadOnly(is: boolean) { this.select.disabled = is; }
}

export class CheckField extends Field {
  private readonly check: HTMLInputElement;
  constructor(path: string, label: string, send: Send) {
    const check = make("input", { type: "checkbox" });
    super(path, label, "", check);
    this.check = check;
    check.onchange = async () => {
      const { subject } = this;
      this.await(check.checked);
      this.refuse("");
      try {
        await send(path, check.checked);
      } catch (refused) {
        if (subject !== this.subject) return;
        check.checked = !check.checked;
        this.refuse((refused as Refusal).text);
      }
    };
  }
  show(value: boolean): void { if (!this.isOld(value)) this.check.checked = value; }
  set isReadOnly(is: boolean) { this.check.disabled = is; }
}

/** Many lines: an expression, or a table that may be pasted from a spreadsheet. */
export class AreaField extends Field {
  private readonly area: HTMLTextAreaElement;
  private value = "";
  private sending: string | null = null; // what is on its way
  constructor(path: string, label: string, send: Send, read: (text: string) => { value: unknown } | string, rows: number) {
    const area = make("textarea", { rows, spellcheck: false });
    super(path, label, "", area);
    this.area = area;
    this.row.classList.add("tall");
    const commit = async () => {
      if (this.sending !== null || area.value === this.value) return;
      const { subject } = this, text = this.sending = area.value, what = read(text);
      this.refuse("");
      let why = "";
      try {
        if (typeof what === "string") throw { text: what };
        await send(path, what.value);
      } catch (refused) {
        why = (refused as Refusal).text;
      }
      if (subject !== this.subject) return;
      this.sending = null;
      if (!why) {
        this.value = text;
        this.await(text);
      }
      if (area.value !== text) void commit(); // typed meanwhile
      else if (why) {
        area.value = this.value;
        this.refuse(why, () => { area.value = text; area.focus(); });
      }
    };
    area.onchange = () => void commit();
    area.onkeydown = (event) => { if (event.key === "Enter" && (rows === 2 || event.ctrlKey)) { event.preventDefault(); void commit(); } };
  }
  forget(): void {
    super.forget();
    this.sending = null;
    this.area.value = this.value;
  }
  show(value: string): void {
    if (this.sending !== null || this.isOld(value)) return;
    const isTyping = document.activeElement === this.area && this.area.value !== this.value;
    this.value = value;
    if (!isTyping) this.area.value = value;
  }
  set isReadOnly(is: boolean) { this.area.readOnly = is; }
}

export type AnyField = TextField | ChoiceField | CheckField | AreaField;
