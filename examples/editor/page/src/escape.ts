// Escape: closes what is open, and stops all force where nothing is. Shift+Escape always stops it, and so does the red button,
// also while a window is open, which makes all behind it inert.

import { put } from "./fields";

// A browser that knows no popovers must not fail here.
const windows = CSS.supports("selector(:popover-open)") ? "dialog[open], :popover-open" : "dialog[open]";
type Typed = HTMLInputElement | HTMLTextAreaElement;

export class Escape {
  private readonly button = document.getElementById("stop")!;
  private readonly key = document.getElementById("stop-key")!;

  /** drawing: how to leave the line that is being drawn; null: none is. */
  constructor(private readonly stop: () => void, private readonly drawing: () => (() => void) | null) {
    window.addEventListener("keydown", (event) => this.press(event), true);
    window.addEventListener("pointerdown", (event) => this.point(event), true);
    this.button.onclick = stop;
    for (const kind of ["focusin", "focusout", "toggle", "close"]) document.addEventListener(kind, () => setTimeout(() => this.tell()), true);
    this.tell();
  }

  /** Says on the button which key stops the force now. */
  tell(): void { put(this.key, this.opened() ? "Shift Esc" : "Esc"); }

  /** Closes what is open; null: nothing is. */
  private opened(): (() => void) | null {
    const focused = document.activeElement as HTMLElement | null;
    const isTyping = focused?.matches("input:not([type=checkbox]), textarea, select") ?? false;
    if (document.querySelector(windows)) return () => { if (isTyping) forget(focused as Typed); }; // the browser does the rest
    if (isTyping) return () => { forget(focused as Typed); focused!.blur(); };
    return this.drawing();
  }

  private press(event: KeyboardEvent): void {
    if (event.key !== "Escape" || event.isComposing) return;
    const close = event.shiftKey ? null : this.opened();
    if (!close) event.preventDefault(); // Shift+Escape is a key of the browser too
    if (event.repeat) return; // a key that is held closes one thing and no more
    if (close) close();
    else this.stop();
    this.tell();
  }

  private point(event: PointerEvent): void {
    const { left, right, top, bottom } = this.button.getBoundingClientRect();
    const isOver = event.clientX >= left && event.clientX <= right && event.clientY >= top && event.clientY <= bottom;
    if (isOver && (event.target as HTMLElement).matches("dialog")) this.stop();
  }
}

/** What is typed goes back to what it was; a filter becomes empty. */
function forget(field: Typed): void {
  if (!("defaultValue" in field) || field.value === field.defaultValue) return;
  field.value = field.defaultValue;
  if (field.type === "search") field.dispatchEvent(new Event("input"));
}
