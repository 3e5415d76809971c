// The table of all objects, by client. Only the lines that are in sight exist, so thousands of objects cost nothing.
//
// For the keyboard and for screen-readers it is a grid that has the focus as a whole: one of its lines is the active one.

import { make, put, shown } from "./fields";
import { length } from "./frames";
import { type Item, type Model, newtons } from "./model";
import type { Orders } from "./orders";

const lineHeight = 24;
const letters = { point: "•", polyline: "∿", plane: "▱", mesh: "△" };
type Line = { client: string; count: number } | Item;

export class Table {
  private readonly filter = make("input", { type: "search", placeholder: "Filter: name, client, state", title: "Words that the name, the client, the primitive or the state has", id: "filter" });
  private readonly scroll = make("div", { className: "scroll", tabIndex: 0 });
  private readonly space = make("div", { className: "space" });
  private readonly none = make("p", { className: "hint", textContent: "Nothing matches the filter.", hidden: true });
  private readonly check = make("input", { type: "checkbox", id: "metres" });
  private readonly metres = make("label", { hidden: true }, this.check, " distances in the scale of each client");
  private readonly damping = make("p", { id: "damping", title: "The servo damps every motion of the hand, also where no object is felt" });
  private lines: Line[] = [];
  private active = -1; // the id of an object, as is the anchor, from which Shift extends the selection
  private anchor = -1;
  private isChoosing = false;
  private isDue = false;

  constructor(private readonly box: HTMLElement, private readonly model: Model, private readonly orders: Orders) {
    this.filter.setAttribute("aria-label", "Filter the objects");
    this.scroll.setAttribute("role", "grid");
    this.scroll.setAttribute("aria-multiselectable", "true");
    this.scroll.setAttribute("aria-label", "Objects of all clients");
    const head = make("div", { className: "head line" });
    for (const [text, title] of [["", "shown"], ["", "enabled"], ["object", ""], ["state", ""], ["distance", ""], ["force", ""]] as const) {
      head.append(make("span", { textContent: text, title }));
    }
    this.space.setAttribute("role", "rowgroup");
    this.scroll.append(this.space);
    this.check.onchange = () => {
      model.inClientMetres = this.check.checked;
      model.tell("rows");
    };
    box.append(make("div", { className: "above" }, this.filter, this.metres), head, this.none, this.scroll, this.damping);
    this.filter.oninput = () => this.sort();
    this.scroll.onscroll = () => this.draw();
    this.scroll.onkeydown = (event) => this.key(event);
    this.space.onclick = (event) => this.click(event);
    model.on(["objects"], () => this.sort());
    model.on(["selection"], () => {
      const [first] = model.selected;
      if (model.selected.size === 1 && !this.isChoosing) this.active = this.anchor = first!; // it was selected elsewhere
      this.draw();
      this.reveal();
    });
    model.on(["rows", "state"], () => this.later());
    model.on(["state"], () => { this.metres.hidden = ![...model.clients.values()].some((client) => client.frame.scale !== 1); });
    new ResizeObserver(() => this.draw()).observe(this.scroll);
  }

  /** The numbers change with every state: five times a second can be read. */
  private later(): void {
    if (this.isDue) return;
    this.isDue = true;
    setTimeout(() => {
      this.isDue = false;
      if (this.filter.value) this.sort(); // by the state, perhaps
      else this.draw();
      const { model } = this, stats = model.told.stats;
      put(this.damping, stats ? `Damping of the servo (${shown(stats.damping)} N s/m): ${newtons(model.damping)}` : "");
    }, 200);
  }

  private sort(): void {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const groups = new Map<string, Item[]>();
    for (const client of [this.model.me, ...this.model.clients.keys()]) groups.set(client, []);
    for (const item of this.model.items.values()) {
      const text = `${item.told.name} ${item.told.client} ${item.told.primitive} ${item.condition}`.toLowerCase();
      if (!words.every((word) => text.includes(word))) continue;
      if (!groups.has(item.told.client)) groups.set(item.told.client, []);
      groups.get(item.told.client)!.push(item);
    }
    this.lines = [];
    const order = new Intl.Collator("en", { numeric: true });
    for (const [client, items] of groups) {
      if (!items.length && (words.length || client === "server")) continue;
      items.sort((a, b) => order.compare(a.told.short, b.told.short));
      this.lines.push({ client, count: items.length }, ...items);
    }
    this.none.hidden = this.lines.length > 0 || !words.length;
    this.box.dataset.count = String(this.model.items.size);
    this.draw();
  }

  private draw(): void {
    this.space.style.height = `${this.lines.length * lineHeight}px`;
    this.scroll.setAttribute("aria-rowcount", String(this.lines.length));
    this.scroll.removeAttribute("aria-activedescendant"); // unless it is among those that are drawn
    const first = Math.max(0, Math.floor(this.scroll.scrollTop / lineHeight) - 2);
    const last = Math.min(this.lines.length, first + Math.ceil(this.scroll.clientHeight / lineHeight) + 5);
    const wanted = last - first;
    while (this.space.children.length > wanted) this.space.lastChild!.remove();
    while (this.space.children.length < wanted) this.space.append(make("div", { className: "line" }));
    for (let i = first; i < last; ++i) this.drawLine(this.space.children[i - first] as HTMLElement, this.lines[i]!, i);
  }

  private drawLine(element: HTMLElement, line: Line, index: number): void {
    element.style.transform = `translateY(${index * lineHeight}px)`;
    element.dataset.index = String(index);
    element.setAttribute("role", "row");
    element.setAttribute("aria-rowindex", String(index + 1));
    const html = (text: string) => text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
    if ("count" in line) {
      const colour = `#${this.model.colourOf(line.client).toString(16).padStart(6, "0")}`;
      const client = this.model.clients.get(line.client);
      const locked = client?.locked && line.client !== this.model.me ? " 🔒" : "";
      const own = line.client === this.model.me ? " (this editor)" : "";
      element.className = "line group";
      set(element, `<b role="rowheader" style="--c:${colour}">${html(line.client)}</b><i>${own}${locked}</i>` +
        `<span role="gridcell" class="sum">${line.count} · ${newtons(client ? length(this.model.forceOf(client)) : 0)}</span>`);
      element.removeAttribute("aria-selected");
      element.removeAttribute("id");
      delete element.dataset.name;
      return;
    }
    const { told } = line, condition = line.condition, isHidden = this.model.hidden.has(told.id);
    const isSelected = this.model.selected.has(told.id), isActive = this.active === told.id;
    element.className = `line item${isSelected ? " selected" : ""}${isActive ? " active" : ""}${isHidden ? " hidden" : ""}`;
    element.setAttribute("aria-selected", String(isSelected));
    element.id = `object-${told.id}`;
    if (isActive) this.scroll.setAttribute("aria-activedescendant", element.id);
    element.dataset.name = told.name;
    element.dataset.state = condition;
    const near = Number.isFinite(line.distance);
    // The keys of the table do what the button and the checkbox do.
    const eye = isHidden ? 'title="Show (H)">◌' : 'title="Hide (H)">◉', on = `${told.enabled ? "checked" : ""} ${line.isLocked ? "disabled" : ""}`;
    set(element, `<span role="gridcell"><button class="eye" tabindex="-1" ${eye}</button></span>` +
      `<span role="gridcell"><input type="checkbox" class="on" tabindex="-1" title="Enabled (Space)" ${on}></span>` +
      `<span role="rowheader" class="name" title="${html(told.name)}"><i>${letters[told.primitive]}</i> <bdi>${html(told.short)}</bdi></span>` +
      '<span role="gridcell" class="state"></span><span role="gridcell" class="number"></span><span role="gridcell" class="number"></span>');
    // What changes all the time, without making the rest anew: a click on the rest may be half done.
    const [state, distance, force] = [...element.children].slice(3) as HTMLElement[];
    state!.className = `state ${condition}`;
    put(state!, line.word);
    put(distance!, near ? this.model.distance(line) : "–");
    put(force!, near ? newtons(length(line.push)) : "–");
  }

  private click(event: MouseEvent): void {
    const target = event.target as HTMLElement;
    const line = target.closest<HTMLElement>(".line");
    const index = Number(line?.dataset.index ?? -1), item = this.lines[index];
    if (!item || "count" in item) return;
    if (target.classList.contains("eye")) return this.model.setHidden([item], !this.model.hidden.has(item.told.id));
    if (target.classList.contains("on")) {
      const enabled = (target as HTMLInputElement).checked;
      (line as HTMLElement & { told?: string }).told = undefined;
      return this.setEnabled([item], enabled);
    }
    this.choose(item, event.shiftKey ? "range" : event.ctrlKey || event.metaKey ? "toggle" : "one");
  }

  /** Makes the object the active one, and selects it alone, with all from the anchor on, or besides what is selected. */
  private choose({ told: { id } }: Item, how: "one" | "range" | "toggle"): void {
    this.active = id;
    const anchor = this.indexOf(this.anchor), index = this.indexOf(id);
    let next = new Set(how === "toggle" ? this.model.selected : []);
    if (how === "range" && anchor >= 0) next = new Set(this.idsFrom(Math.min(anchor, index), Math.max(anchor, index) + 1));
    else {
      this.anchor = id;
      if (how !== "toggle" || !next.delete(id)) next.add(id);
    }
    this.isChoosing = true;
    this.model.select(next);
    this.isChoosing = false;
  }
  private idsFrom(first: number, end: number): number[] {
    return this.lines.slice(first, end).flatMap((line) => ("count" in line ? [] : [line.told.id]));
  }
  private indexOf(id: number): number { return this.lines.findIndex((line) => !("count" in line) && line.told.id === id); }

  private key(event: KeyboardEvent): void {
    const isControl = event.ctrlKey || event.metaKey, { selection } = this.model;
    const item = this.lines[this.indexOf(this.active)] as Item | undefined;
    const target = this.target(event.key);
    if (target) {
      if (isControl && !event.shiftKey) { // Ctrl+Space is to choose it
        this.active = target.told.id;
        this.draw();
        this.reveal();
      } else this.choose(target, event.shiftKey ? "range" : "one");
    } else if (event.key === " " && isControl) {
      if (item) this.choose(item, "toggle");
    } else if (event.key === " ") {
      if (event.target !== this.scroll) return; // on the button or the checkbox of a line
      if (selection.length) this.setEnabled(selection, !selection[0]!.told.enabled);
    } else if (event.key.toLowerCase() === "a" && isControl) {
      this.model.select(this.idsFrom(0, this.lines.length));
    } else if (event.key.toLowerCase() === "h" && !isControl) {
      const isHidden = !this.model.hidden.has(selection[0]?.told.id ?? -1);
      this.model.setHidden(selection, isHidden);
    } else return;
    event.preventDefault();
  }

  /** The object that a key leads to from the active one. */
  private target(key: string): Item | undefined {
    const end = this.lines.length;
    const by = { ArrowDown: 1, ArrowUp: -1, PageDown: 10, PageUp: -10, End: end, Home: -end }[key];
    if (!by) return undefined;
    const start = Math.max(0, Math.min(end - 1, this.indexOf(this.active) + by));
    for (const step of [Math.sign(by), -Math.sign(by)]) { // past the lines of clients; beyond the last object back to it
      for (let i = start; i >= 0 && i < end; i += step) if (!("count" in this.lines[i]!)) return this.lines[i] as Item;
    }
    return undefined;
  }

  /** All of them in one go. */
  private setEnabled(items: Item[], enabled: boolean): void {
    const names = items.filter((item) => !item.isLocked).map((item) => item.told.name);
    this.orders.change(names, { enabled }).catch((refused) => this.orders.onNotice(refused.text, true));
  }

  /** Scrolls to the active line. */
  private reveal(): void {
    const index = this.indexOf(this.active);
    if (index < 0) return;
    const top = index * lineHeight, { scrollTop, clientHeight } = this.scroll;
    if (top < scrollTop) this.scroll.scrollTop = top;
    else if (top + lineHeight > scrollTop + clientHeight) this.scroll.scrollTop = top + lineHeight - clientHeight;
  }
}

/** Only where it differs: else a click that is half done would be lost. */
function set(element: HTMLElement & { told?: string }, text: string): void {
  if (element.told === text) return;
  element.told = text;
  element.innerHTML = text;
}
